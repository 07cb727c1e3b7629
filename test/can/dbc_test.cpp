#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <regex>
#include <string>

#include "tunnel_pilot/can/layout.h"

// The codec's constants against the source of truth, config/tunnel_pilot.dbc.
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
  std::map<std::string, DbcSignal> signals;
};

std::map<unsigned, DbcFrame> readDbc() {
  static const std::regex frame_line(R"(BO_ (\d+) (\w+): (\d+) \w+)");
  static const std::regex signal_line(
      R"( SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\] "([^"]*)\" \w+)");
  static const std::regex data_id_line(R"rx(BA_ "DataId" BO_ (\d+) (\d+);)rx");
  std::ifstream file(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/tunnel_pilot.dbc");
  std::map<unsigned, DbcFrame> frames;
  DbcFrame* frame = nullptr;
  for (std::string line; std::getline(file, line);) {
    std::smatch m;
    if (std::regex_match(line, m, frame_line)) {
      frame = &frames[static_cast<unsigned>(std::stoul(m[1]))];
      frame->name = m[2];
      frame->length = std::stoi(m[3]);
    } else if (std::regex_match(line, m, signal_line) && frame != nullptr) {
      frame->signals[m[1]] = {std::stoi(m[2]), std::stoi(m[3]), m[4] == "-",     std::stod(m[5]),
                              std::stod(m[6]), std::stod(m[7]), std::stod(m[8]), m[9]};
    } else if (std::regex_match(line, m, data_id_line)) {
      frames[static_cast<unsigned>(std::stoul(m[1]))].data_id = std::stoi(m[2]);
    }
  }
  return frames;
}

TEST(Dbc, HoldsTheSameFramesAsTheCodec) {
  const auto dbc = readDbc();
  ASSERT_EQ(dbc.size(), frameLayouts().size());
  for (const FrameLayout& layout : frameLayouts()) {
    ASSERT_EQ(dbc.count(layout.id), 1u) << layout.name;
    EXPECT_EQ(dbc.at(layout.id).name, layout.name);
    EXPECT_EQ(dbc.at(layout.id).length, 8) << layout.name;
    EXPECT_EQ(dbc.at(layout.id).data_id, layout.data_id) << layout.name;
    EXPECT_EQ(dbc.at(layout.id).signals.size(), layout.signals.size()) << layout.name;
  }
}

TEST(Dbc, HoldsTheSameSignalsAsTheCodec) {
  const auto dbc = readDbc();
  for (const FrameLayout& layout : frameLayouts()) {
    for (const SignalLayout& signal : layout.signals) {
      SCOPED_TRACE(std::string(layout.name) + "." + signal.name);
      const auto& signals = dbc.at(layout.id).signals;
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

TEST(Dbc, VectorsAreWhatCantoolsMakesOfIt) {
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
