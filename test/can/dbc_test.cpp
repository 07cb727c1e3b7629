#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <regex>
#include <string>

#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/profile.h"

// The codec's constants against the sources of truth, config/tunnel_pilot.dbc and, for the profile
// j1939, config/tunnel_pilot_j1939.dbc.
namespace tunnel_pilot::can {
namespace {

struct DbcSignal {
  int start, length;
  bool is_signed;
  double factor, offset, min, max;
  std::string unit;
};
struct DbcFrame {
  std::string name;
  int length = 0, data_id = -1;
  std::string sender, format;
  std::map<std::string, DbcSignal> signals;
};

struct File {
  const char* name;
  bool j1939;
};

std::map<unsigned, DbcFrame> readDbc(const File& which) {
  static const std::regex frame_line(R"(BO_ (\d+) (\w+): (\d+) (\w+))");
  static const std::regex signal_line(
      R"( SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\] "([^"]*)\" \w+)");
  static const std::regex data_id_line(R"rx(BA_ "DataId" BO_ (\d+) (\d+);)rx");
  static const std::regex format_line(R"rx(BA_ "VFrameFormat" BO_ (\d+) (\d+);)rx");
  std::ifstream file(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + which.name);
  std::map<unsigned, DbcFrame> frames;
  DbcFrame* frame = nullptr;
  for (std::string line; std::getline(file, line);) {
    std::smatch m;
    if (std::regex_match(line, m, frame_line)) {
      frame = &frames[static_cast<unsigned>(std::stoul(m[1]))];
      frame->name = m[2];
      frame->length = std::stoi(m[3]);
      frame->sender = m[4];
    } else if (std::regex_match(line, m, signal_line) && frame != nullptr) {
      frame->signals[m[1]] = {std::stoi(m[2]), std::stoi(m[3]), m[4] == "-",     std::stod(m[5]),
                              std::stod(m[6]), std::stod(m[7]), std::stod(m[8]), m[9]};
    } else if (std::regex_match(line, m, data_id_line)) {
      frames[static_cast<unsigned>(std::stoul(m[1]))].data_id = std::stoi(m[2]);
    } else if (std::regex_match(line, m, format_line)) {
      frames[static_cast<unsigned>(std::stoul(m[1]))].format = m[2];
    }
  }
  return frames;
}

// A .dbc marks identifiers of 29 bits by bit 31. The addresses are those of the shipped files.
unsigned numberOf(const J1939Group& group) {
  static const auto load = [](const char* file, Side side) {
    config::Node node = config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + file);
    return loadProfile(node, side).j1939;
  };
  const bool pilots = group.sender == Side::kPilot;
  const auto own = load(pilots ? "can_bridge.yaml" : "truck_controller.yaml", group.sender);
  return 1u << 31 | toIdentifier({group.priority, group.pgn, kGlobalAddress, own.source_address});
}

class Dbc : public testing::TestWithParam<File> {
 protected:
  static unsigned numberOf(std::uint32_t id) {
    for (const J1939Group& group : j1939Groups()) {
      if (GetParam().j1939 && group.id == id) return can::numberOf(group);
    }
    return id;
  }
};
INSTANTIATE_TEST_SUITE_P(Files, Dbc,
                         testing::Values(File{"tunnel_pilot.dbc", false},
                                         File{"tunnel_pilot_j1939.dbc", true}),
                         [](const auto& tested) { return tested.param.j1939 ? "j1939" : "plain"; });

TEST_P(Dbc, HoldsTheSameFramesAsTheCodec) {
  const auto dbc = readDbc(GetParam());
  ASSERT_EQ(dbc.size(), frameLayouts().size());
  for (const FrameLayout& layout : frameLayouts()) {
    const unsigned number = numberOf(layout.id);
    ASSERT_EQ(dbc.count(number), 1u) << layout.name << ' ' << number;
    EXPECT_EQ(dbc.at(number).name, layout.name);
    EXPECT_EQ(dbc.at(number).length, 8) << layout.name;
    EXPECT_EQ(dbc.at(number).data_id, layout.data_id) << layout.name;
    EXPECT_EQ(dbc.at(number).signals.size(), layout.signals.size()) << layout.name;
    EXPECT_EQ(dbc.at(number).format, GetParam().j1939 ? "3" : "") << layout.name;
  }
}

TEST_P(Dbc, HoldsTheSameSendersAsTheCodec) {
  const auto dbc = readDbc(GetParam());
  for (const J1939Group& group : j1939Groups()) {
    EXPECT_EQ(dbc.at(numberOf(group.id)).sender, group.sender == Side::kPilot ? "PILOT" : "TRUCK");
  }
}

TEST_P(Dbc, HoldsTheSameSignalsAsTheCodec) {
  const auto dbc = readDbc(GetParam());
  for (const FrameLayout& layout : frameLayouts()) {
    for (const SignalLayout& signal : layout.signals) {
      SCOPED_TRACE(std::string(layout.name) + "." + signal.name);
      const auto& signals = dbc.at(numberOf(layout.id)).signals;
      ASSERT_EQ(signals.count(signal.name), 1u);
      const DbcSignal& other = signals.at(signal.name);
      EXPECT_EQ(signal.start, other.start);
      EXPECT_EQ(signal.length, other.length);
      EXPECT_EQ(signal.is_signed, other.is_signed);
      EXPECT_EQ(signal.factor, other.factor);
      EXPECT_EQ(other.offset, 0.0);
      EXPECT_EQ(signal.min, other.min);
      EXPECT_EQ(signal.max, other.max);
      EXPECT_EQ(signal.unit, other.unit);
    }
  }
}

TEST(DbcVectors, AreWhatCantoolsMakesOfBothFiles) {
  const char* chosen = std::getenv("TUNNEL_PILOT_CANTOOLS_PYTHON");  // a python3 that has cantools
  const std::string python = chosen != nullptr ? chosen : "python3";
  const std::string command =
      "'" + python + "' '" + TUNNEL_PILOT_SOURCE_DIR + "/test/can/make_vectors.py' --check";
  const int status = std::system(command.c_str());
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == 77) {
    GTEST_SKIP() << "cantools is not installed (make_vectors.py --check --venv DIR installs it)";
  }
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace tunnel_pilot::can
