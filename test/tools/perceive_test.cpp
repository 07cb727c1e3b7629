#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Header.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>

#include "program.h"
#include "tunnel_pilot/simulation/metrics.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/simulator.h"
#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot {
namespace {

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;

Outcome perceive(const std::vector<std::string>& arguments) {
  return runProgram(PERCEIVE_PROGRAM, arguments);
}

struct Row {
  double stamp = 0.0;
  bool valid = false;
  double width = 0.0, heading_error = 0.0, lateral_offset = 0.0;
};

std::vector<Row> rowsOf(const std::string& file) {
  std::istringstream in(contentOf(file));
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "stamp,valid,width,heading_error,lateral_offset,curvature");
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    Row row;
    int valid = -1;
    const int read = std::sscanf(line.c_str(), "%lf,%d,%lf,%lf,%lf", &row.stamp, &valid, &row.width,
                                 &row.heading_error, &row.lateral_offset);
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 5) << line;
    EXPECT_EQ(read, valid == 1 ? 5 : 2) << line;
    row.valid = valid == 1;
    rows.push_back(row);
  }
  return rows;
}

ros::Time timeOf(int i) { return ros::Time(100.0 + 0.1 * i); }

// What a lidar sees that stands 0.4 m left of the middle of a straight drift 5 m wide, turned by 0.05
// rad.
sensor_msgs::LaserScan scanOf(const geometry::Scan& scan, int i) {
  sensor_msgs::LaserScan message;
  message.header.stamp = timeOf(i);
  message.header.frame_id = "laser";
  message.angle_min = static_cast<float>(scan.angle_min);
  message.angle_max = static_cast<float>(scan.angleMax());
  message.angle_increment = static_cast<float>(scan.angle_increment);
  message.range_min = static_cast<float>(scan.range_min);
  message.range_max = static_cast<float>(scan.range_max);
  message.ranges = scan.ranges;
  return message;
}

class Perceive : public ::testing::Test {
 protected:
  void SetUp() override { writeBag(bag(), {"/scan"}, 20); }

  std::string bag() const { return place_.file("drift.bag"); }
  std::string csv() const { return place_.file("out.csv"); }

  static void writeBag(const std::string& file, const std::vector<std::string>& topics, int scans,
                       double half_width = 2.5) {
    const auto parameters =
        simulation::loadSimulator(config::loadFile(kPackage + "/config/simulator.yaml")).lidar;
    const std::vector<world::WallChain> walls = {{{-50.0, half_width}, {80.0, half_width}},
                                                 {{-50.0, -half_width}, {80.0, -half_width}}};
    const world::RayCaster caster(walls, simulation::LidarModel::beams(parameters));
    simulation::LidarModel lidar(parameters, 1000);
    rosbag::Bag out(file, rosbag::bagmode::Write);
    for (int i = 0; i < scans; ++i) {
      nav_msgs::Odometry odometry;
      odometry.header.stamp = timeOf(i);
      odometry.pose.pose.orientation.w = 1.0;
      out.write("/odom", timeOf(i), odometry);
      const geometry::Scan& scan =
          lidar.sweep(caster, {0.0, 0.4, 0.05}, {0.0, 0.4, 0.05}, 1.5, 0.0, Stamp(i));
      for (const std::string& topic : topics) out.write(topic, timeOf(i), scanOf(scan, i));
    }
    std_msgs::Header other;
    out.write("/other", timeOf(0), other);
  }

  Workplace place_;
};

TEST_F(Perceive, WritesWhatEachScanShows) {
  const Outcome outcome = perceive({"--bag", bag(), "--csv", csv()});
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  const std::vector<Row> rows = rowsOf(csv());
  ASSERT_EQ(rows.size(), 20u);
  const Row& last = rows.back();
  EXPECT_NEAR(last.stamp, 101.9, 1e-6);
  ASSERT_TRUE(last.valid);
  EXPECT_NEAR(last.width, 5.0, 0.1);
  EXPECT_NEAR(last.lateral_offset, 0.4, 0.03);
  EXPECT_NEAR(last.heading_error, 0.05, 0.01);
}

TEST_F(Perceive, ATransformMovesTheAnswerToTheBase) {
  ASSERT_EQ(perceive({"--bag", bag(), "--csv", csv(), "--transform", "0.0", "0.5", "-0.05"}).status, 0);
  const Row last = rowsOf(csv()).back();
  ASSERT_TRUE(last.valid);
  // The laser sits 0.5 m left of the base and looks 0.05 to its right: the base looks 0.10 to the left.
  EXPECT_NEAR(last.heading_error, 0.10, 0.02);
  EXPECT_NEAR(last.lateral_offset, 0.4 - 0.5 * std::cos(0.10), 0.05);
}

TEST_F(Perceive, OtherWidthsAreNoTunnel) {
  ASSERT_EQ(perceive({"--bag", bag(), "--csv", csv(), "--config", kPackage + "/config/corridor"}).status,
            0);
  for (const Row& row : rowsOf(csv())) EXPECT_FALSE(row.valid);
}

TEST_F(Perceive, SameBagGivesTheSameBytes) {
  ASSERT_EQ(perceive({"--bag", bag(), "--csv", csv()}).status, 0);
  ASSERT_EQ(perceive({"--bag", bag(), "--csv", place_.file("again.csv")}).status, 0);
  EXPECT_EQ(contentOf(csv()), contentOf(place_.file("again.csv")));
}

TEST_F(Perceive, AmongSeveralScanTopicsOneMustBeChosen) {
  writeBag(place_.file("two.bag"), {"/left", "/right"}, 3);
  const Outcome unsaid = perceive({"--bag", place_.file("two.bag"), "--csv", csv()});
  EXPECT_EQ(unsaid.status, 2);
  EXPECT_NE(unsaid.output.find("/left /right"), std::string::npos) << unsaid.output;
  EXPECT_EQ(perceive({"--bag", place_.file("two.bag"), "--csv", csv(), "--topic", "right"}).status, 0);
  EXPECT_EQ(rowsOf(csv()).size(), 3u);
  EXPECT_EQ(perceive({"--bag", place_.file("two.bag"), "--csv", csv(), "--topic", "/odom"}).status, 2);
}

TEST_F(Perceive, ATopicIsFoundWithItsSlashAndWithout) {
  writeBag(place_.file("bare.bag"), {"left", "right"}, 3);
  for (const char* topic : {"right", "/right"}) {
    EXPECT_EQ(perceive({"--bag", place_.file("bare.bag"), "--csv", csv(), "--topic", topic}).status, 0);
    EXPECT_EQ(rowsOf(csv()).size(), 3u);
  }
  writeBag(place_.file("scan.bag"), {"left", "scan"}, 3);
  EXPECT_EQ(perceive({"--bag", place_.file("scan.bag"), "--csv", csv()}).status, 0);
}

TEST_F(Perceive, WhereNoTunnelIsSeenOtherWidthsAreNamed) {
  EXPECT_EQ(perceive({"--bag", bag(), "--csv", csv()}).output.find("config/corridor"),
            std::string::npos);
  writeBag(bag(), {"/scan"}, 1, 1.0);
  EXPECT_NE(perceive({"--bag", bag(), "--csv", csv()}).output.find("config/corridor"),
            std::string::npos);
}

TEST_F(Perceive, BadInputExitsTwoAndSaysWhy) {
  std::ofstream(place_.file("text.bag")) << "this is no bag\n";
  std::ofstream(place_.file("empty.bag"));
  writeBag(place_.file("scanless.bag"), {}, 3);
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--csv", csv()}, "bag"},
      {{"--bag", bag()}, "csv"},
      {{"--bag", place_.file("none.bag"), "--csv", csv()}, "no such file"},
      {{"--bag", place_.file(""), "--csv", csv()}, "no such file"},
      {{"--bag", place_.file("text.bag"), "--csv", csv()}, "text.bag"},
      {{"--bag", place_.file("empty.bag"), "--csv", csv()}, "empty.bag"},
      {{"--bag", place_.file("scanless.bag"), "--csv", csv()}, "no sensor_msgs/LaserScan"},
      {{"--bag", bag(), "--csv", "/dev/null/out.csv"}, "/dev/null/out.csv"},
      {{"--bag", bag(), "--csv", csv(), "--config", place_.file("none")}, "none"},
      {{"--bag", bag(), "--csv", csv(), "--transform", "1.0"}, "transform"},
      {{"--bag", bag(), "--csv", csv(), "--transform", "a", "b", "c"}, "transform"},
      {{"--bag", bag(), "--csv", csv(), "--transform", "nan", "0", "0"}, "transform"},
      {{"--bag", bag(), "--csv", bag()}, "the bag itself"},
      {{"--bag", bag(), "--csv", "/dev/full"}, "/dev/full"},
      {{"--bag", bag(), "--csv", csv(), "--colour", "red"}, "colour"},
  };
  for (const auto& [arguments, told] : cases) {
    const Outcome outcome = perceive(arguments);
    EXPECT_EQ(outcome.status, 2) << outcome.output;
    EXPECT_NE(outcome.output.find(told), std::string::npos) << outcome.output;
  }
}

TEST_F(Perceive, ABagCutAnywhereIsRefusedOrReadButNeverCrashes) {
  const std::string content = contentOf(bag());
  simulation::Random random(1000, simulation::Stream::kWander);
  for (int i = 0; i < 20; ++i) {
    const auto size = static_cast<std::size_t>(random.uniform() * static_cast<double>(content.size()));
    std::ofstream(place_.file("cut.bag"), std::ios::binary) << content.substr(0, size);
    const Outcome outcome = perceive({"--bag", place_.file("cut.bag"), "--csv", csv()});
    EXPECT_EQ(outcome.signal, 0) << "cut to " << size;
    EXPECT_EQ(outcome.status, 2) << "cut to " << size << ": " << outcome.output;
  }
}

// Sizes of 4 GB in the index end the bag library by an assertion.
TEST_F(Perceive, ABagThatEndsTheBagLibraryIsToldAsDamaged) {
  std::string bad = contentOf(bag());
  const std::string key = "index_pos=";
  std::uint64_t index = 0;
  std::memcpy(&index, bad.data() + bad.find(key) + key.size(), sizeof index);
  std::fill_n(bad.begin() + static_cast<std::ptrdiff_t>(index), 64, '\xEE');
  std::ofstream(place_.file("bad.bag"), std::ios::binary) << bad;
  const Outcome outcome = perceive({"--bag", place_.file("bad.bag"), "--csv", csv()});
  EXPECT_EQ(outcome.signal, 0);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_NE(outcome.output.find("bad.bag: the bag is damaged"), std::string::npos) << outcome.output;
}

TEST_F(Perceive, ABagWithWrongBytesNeverCrashes) {
  const std::string content = contentOf(bag());
  simulation::Random random(1001, simulation::Stream::kWander);
  for (int i = 0; i < 40; ++i) {
    std::string bad = content;
    // Half of the faults fall on the headers at the front and the index at the end.
    const std::size_t range = i % 4 == 0 ? 8192 : i % 4 == 1 ? 4096 : content.size();
    for (int k = 0; k < 8; ++k) {
      const auto at =
          static_cast<std::size_t>(random.uniform() * static_cast<double>(std::min(range, bad.size())));
      bad[i % 4 == 1 ? bad.size() - 1 - at : at] = static_cast<char>(random.bits());
    }
    std::ofstream(place_.file("bad.bag"), std::ios::binary) << bad;
    const Outcome outcome = perceive({"--bag", place_.file("bad.bag"), "--csv", csv()});
    EXPECT_EQ(outcome.signal, 0) << "fault set " << i;
    EXPECT_TRUE(outcome.status == 0 || outcome.status == 2) << outcome.output;
  }
}

// Recordings are other people's: they lie beside the repository or where TUNNEL_PILOT_DATA says.
std::string recording(const std::string& name) {
  const char* folder = std::getenv("TUNNEL_PILOT_DATA");
  const std::string file =
      (folder != nullptr ? std::string(folder) : kPackage + "/../shared/data") + "/" + name;
  return std::filesystem::exists(file) ? file : "";
}

#define SKIP_WITHOUT(file) \
  if ((file).empty()) GTEST_SKIP() << "recording not found: set TUNNEL_PILOT_DATA to its folder"

// Columns of a CSV file with a header line.
std::vector<std::map<std::string, double>> tableOf(const std::string& file) {
  std::istringstream in(contentOf(file));
  std::string line, cell;
  std::getline(in, line);
  std::vector<std::string> names;
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
  std::vector<std::map<std::string, double>> rows;
  while (std::getline(in, line)) {
    std::map<std::string, double> row;
    std::istringstream cells(line);
    for (const std::string& name : names) {
      std::getline(cells, cell, ',');
      row[name] = std::strtod(cell.c_str(), nullptr);
    }
    rows.push_back(row);
  }
  return rows;
}

TEST_F(Perceive, AgreesWithIndependentFitsOfARealCorridor) {
  const std::string duke = recording("duke_loop5.bag");
  SKIP_WITHOUT(duke);
  ASSERT_EQ(perceive({"--bag", duke, "--csv", csv(), "--config", kPackage + "/config/corridor"}).status,
            0);
  const std::vector<Row> rows = rowsOf(csv());
  EXPECT_EQ(rows.size(), 551u);
  int usable = 0;
  std::vector<double> offset, heading, width;
  for (const char* segment : {"duke_loop5_segment_a.csv", "duke_loop5_segment_b.csv"}) {
    for (const auto& fit : tableOf(recording(segment))) {
      if (fit.at("usable") != 1.0) continue;
      ++usable;
      const Row& row = rows.at(static_cast<std::size_t>(fit.at("index")));
      ASSERT_NEAR(row.stamp, fit.at("stamp"), 1e-3);
      if (!row.valid) continue;
      offset.push_back(std::abs(row.lateral_offset - fit.at("offset_single")));
      heading.push_back(std::abs(row.heading_error - fit.at("heading_err_single_deg") * M_PI / 180));
      width.push_back(std::abs(row.width - fit.at("width_single")));
    }
  }
  ASSERT_GT(usable, 100);
  EXPECT_GE(static_cast<double>(offset.size()) / usable, 0.90);
  EXPECT_LE(simulation::quantile(offset, 0.9), 0.10);
  EXPECT_LE(simulation::quantile(heading, 0.9), 2.0 * M_PI / 180);
  EXPECT_LE(simulation::quantile(width, 0.9), 0.15);
  std::cout << "[          ] p90: offset " << simulation::quantile(offset, 0.9) << " m, heading "
            << simulation::quantile(heading, 0.9) * 180 / M_PI << " deg, width "
            << simulation::quantile(width, 0.9) << " m, answered " << offset.size() << " of " << usable
            << std::endl;
}

TEST_F(Perceive, SeesNoTunnelAmongWalkingPeople) {
  const std::string people = recording("leg_tracker_positive_1.bag");
  SKIP_WITHOUT(people);
  for (const std::string& config : {kPackage + "/config", kPackage + "/config/corridor"}) {
    ASSERT_EQ(perceive({"--bag", people, "--csv", csv(), "--config", config}).status, 0);
    const std::vector<Row> rows = rowsOf(csv());
    EXPECT_EQ(rows.size(), 400u);
    for (const Row& row : rows) EXPECT_FALSE(row.valid) << row.stamp;
  }
}

TEST_F(Perceive, ReadsAHallAndASickWithItsOddities) {
  for (const auto& [name, scans] :
       {std::pair{"malaga_telecom.bag", 225u}, std::pair{"sick_tim.bag", 762u}}) {
    const std::string file = recording(name);
    SKIP_WITHOUT(file);
    ASSERT_EQ(perceive({"--bag", file, "--csv", csv()}).status, 0) << name;
    EXPECT_EQ(rowsOf(csv()).size(), scans) << name;
  }
}

}  // namespace
}  // namespace tunnel_pilot
