#include "tunnel_pilot/learning/data_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

constexpr std::size_t kBeams = drivers::LidarInputs::kBeams;
constexpr std::size_t kRecord = 4 * (kBeams + 8);  // [bytes]
const float kNan = std::numeric_limits<float>::quiet_NaN();
const float kInfinity = std::numeric_limits<float>::infinity();

std::string contentOf(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

Example exampleOf(int i) {
  Example example;
  const auto x = static_cast<float>(i);
  example.ranges.assign(kBeams, 2.0F + x);
  example.ranges[3] = kNan;
  example.ranges[4] = kInfinity;
  example.articulation = 0.1F + x;
  example.articulation_ahead = 0.2F + x;
  example.speed = 0.3F + x;
  example.yaw_gain = 0.4F + x;
  example.yaw_disturbance = 0.5F + x;
  example.steering_rate = 0.55F + x;
  example.label = 0.6F + x;
  example.tunnel = 4'000'000'000U + static_cast<std::uint32_t>(i);
  return example;
}

class DataFile : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "data_file_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    writeDataSet(file(), {exampleOf(0), exampleOf(1), exampleOf(2)});
    content_ = contentOf(file());
    header_ = content_.find('\n') + 1;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file() const { return (folder_ / "drives.tpds").string(); }

  // Puts `content` in place of the file; returns what reading it complains of.
  std::string complaintAbout(const std::string& content) const {
    std::ofstream(file(), std::ios::binary | std::ios::trunc) << content;
    try {
      readDataSet(file());
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "";
  }

  std::string replaced(const std::string& from, const std::string& to) const {
    std::string content = content_;
    const std::size_t at = content.find(from);
    EXPECT_LT(at, header_) << from;
    return content.replace(at, from.size(), to);
  }

  // The file with one number of its second example changed and the hash made right for it.
  std::string withValue(std::size_t word, float value) const {
    std::string content = content_;
    std::memcpy(&content[header_ + kRecord + 4 * word], &value, sizeof value);
    const std::string hash = config::sha256(content.substr(header_));
    return content.replace(content.find("\"sha256\": \"") + 11, 64, hash);
  }

  std::filesystem::path folder_;
  std::string content_;
  std::size_t header_ = 0;
};

TEST_F(DataFile, GivesBackWhatWasWritten) {
  const DataSet read = readDataSet(file());
  ASSERT_EQ(read.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    const Example expected = exampleOf(i);
    const Example& example = read[static_cast<std::size_t>(i)];
    ASSERT_EQ(example.ranges.size(), kBeams);
    EXPECT_TRUE(std::isnan(example.ranges[3]));
    EXPECT_EQ(example.ranges[4], kInfinity);
    EXPECT_EQ(example.ranges[760], expected.ranges[760]);
    EXPECT_EQ(example.articulation, expected.articulation);
    EXPECT_EQ(example.articulation_ahead, expected.articulation_ahead);
    EXPECT_EQ(example.speed, expected.speed);
    EXPECT_EQ(example.yaw_gain, expected.yaw_gain);
    EXPECT_EQ(example.steering_rate, expected.steering_rate);
    EXPECT_EQ(example.yaw_disturbance, expected.yaw_disturbance);
    EXPECT_EQ(example.label, expected.label);
    EXPECT_EQ(example.tunnel, expected.tunnel);
  }
}

TEST_F(DataFile, AnEmptySetIsOne) {
  writeDataSet(file(), {});
  EXPECT_TRUE(readDataSet(file()).empty());
}

TEST_F(DataFile, ItsHeaderNamesFieldsUnitsAndNumber) {
  const std::string header = content_.substr(0, header_);
  EXPECT_NE(header.find(R"({"name": "ranges", "unit": "m", "count": 761, "type": "float32"})"),
            std::string::npos);
  EXPECT_NE(header.find(R"({"name": "yaw_disturbance", "unit": "1/m", "count": 1, "type": "float32"})"),
            std::string::npos);
  EXPECT_EQ(content_.size(), header_ + 3 * kRecord);
}

TEST_F(DataFile, WordsAreWrittenLeastSignificantByteFirst) {
  const auto* tunnel = reinterpret_cast<const unsigned char*>(&content_[header_ + kRecord - 4]);
  EXPECT_EQ(tunnel[0] | tunnel[1] << 8 | tunnel[2] << 16 | std::uint32_t{tunnel[3]} << 24,
            4'000'000'000U);
}

TEST_F(DataFile, BadFilesAreRefusedWithTheReason) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "not a data set"},
      {"\n", "not a data set"},
      {"no data\n", "not a data set"},
      {std::string(10'000, '{'), "not a data set"},
      {std::string(3000, '{') + "\n", "not a data set"},
      {"{\"format\": \"tunnel", "not a data set"},
      {"[1, 2]\n", "not a data set"},
      {"{}\n", "format"},
      {replaced("tunnel_pilot_data_set", "another"), "format"},
      {replaced("\"version\": 2", "\"version\": 1"), "version"},
      {replaced("\"count\": 761", "\"count\": 760"), "count"},
      {replaced("\"unit\": \"m/s\"", "\"unit\": \"km/h\""), "unit"},
      {replaced("\"name\": \"speed\"", "\"name\": \"haste\""), "name"},
      {replaced("\"uint32\"", "\"int32\""), "type"},
      {replaced("\"sha256\"", "\"colour\": 1, \"sha256\""), "colour"},
      {replaced("                   3,", "                  -3,"), "examples"},
      {replaced("                   3,", "                   4,"), "bytes"},
      {replaced("                   3,", "                   2,"), "bytes"},
      {replaced("                   3,", "       1099511627776,"), "bytes"},
      {replaced("                   3,", "18446744073709551615,"), "examples"},
      {content_.substr(0, content_.size() - 1), "bytes"},
      {content_ + "x", "bytes"},
      {content_.substr(0, header_), "bytes"},
      {withValue(0, -1.0F), "example 1 has a negative range"},
      {withValue(7, -kInfinity), "example 1 has a negative range"},
      {withValue(kBeams, kNan), "'articulation'"},
      {withValue(kBeams + 1, kInfinity), "'articulation_ahead'"},
      {withValue(kBeams + 2, kNan), "'speed'"},
      {withValue(kBeams + 3, kNan), "'yaw_gain'"},
      {withValue(kBeams + 4, -kInfinity), "'yaw_disturbance'"},
      {withValue(kBeams + 5, kNan), "'steering_rate'"},
      {withValue(kBeams + 6, kNan), "'label'"},
  };
  for (const auto& [content, told] : cases) {
    const std::string complaint = complaintAbout(content);
    EXPECT_NE(complaint.find(told), std::string::npos) << "'" << told << "' not in: " << complaint;
    EXPECT_NE(complaint.find("drives.tpds"), std::string::npos) << complaint;
  }
}

TEST_F(DataFile, NoFileAndAFolderAreNoDataSets) {
  EXPECT_THROW(readDataSet((folder_ / "none").string()), config::ConfigError);
  EXPECT_THROW(readDataSet(folder_.string()), config::ConfigError);
}

TEST_F(DataFile, AnyWrongBitInTheExamplesIsNoticed) {
  simulation::Random random(1000, simulation::Stream::kWander);
  for (int i = 0; i < 200; ++i) {
    std::string bad = content_;
    bad[header_ + random.bits() % (bad.size() - header_)] ^= static_cast<char>(1 << random.bits() % 8);
    EXPECT_NE(complaintAbout(bad).find("damaged"), std::string::npos);
  }
}

TEST_F(DataFile, AMutatedHeaderIsRefusedOrMeansTheSame) {
  simulation::Random random(1001, simulation::Stream::kWander);
  for (int i = 0; i < 500; ++i) {
    std::string bad = content_;
    for (std::uint64_t k = 0; k <= random.bits() % 4; ++k) {
      const std::size_t at = random.bits() % header_;
      switch (random.bits() % 3) {
        case 0:
          bad[at] = static_cast<char>(random.bits());
          break;
        case 1:
          bad.erase(at, 1 + random.bits() % 8);
          break;
        default:
          bad.insert(at, content_.substr(random.bits() % header_, random.bits() % 16));
      }
    }
    std::ofstream(file(), std::ios::binary | std::ios::trunc) << bad;
    try {
      const DataSet read = readDataSet(file());
      ASSERT_EQ(read.size(), 3U);
      EXPECT_EQ(read[2].label, exampleOf(2).label);
    } catch (const config::ConfigError&) {
    }
  }
}

TEST_F(DataFile, AppearsOnlyWhenComplete) {
  const std::string other = (folder_ / "other.tpds").string();
  {
    DataWriter writer(other);
    writer.add(exampleOf(0));
    EXPECT_FALSE(std::filesystem::exists(other));
  }
  EXPECT_FALSE(std::filesystem::exists(other));
  EXPECT_FALSE(std::filesystem::exists(other + ".part"));
}

TEST_F(DataFile, AnUnfinishedWriterLeavesTheOldFile) {
  {
    DataWriter writer(file());
    writer.add(exampleOf(7));
  }
  EXPECT_EQ(contentOf(file()), content_);
}

TEST_F(DataFile, TheWriterRefusesWhatTheReaderWould) {
  const std::vector<std::function<void(Example&)>> faults = {
      [](Example& e) { e.ranges.pop_back(); }, [](Example& e) { e.ranges[0] = -0.1F; },
      [](Example& e) { e.label = kNan; }, [](Example& e) { e.speed = kInfinity; }};
  DataWriter writer(file());
  for (const auto& fault : faults) {
    Example example = exampleOf(0);
    fault(example);
    EXPECT_THROW(writer.add(example), config::ConfigError);
  }
  writer.add(exampleOf(0));
  writer.finish();
  EXPECT_EQ(readDataSet(file()).size(), 1U);
}

TEST_F(DataFile, WhereItCannotBeWrittenThatIsTold) {
  EXPECT_THROW(DataWriter("/dev/null/drives.tpds"), config::ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::learning
