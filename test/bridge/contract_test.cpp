#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/supervision/command.h"

// What stands twice, in the code and in a document, must be the same.
namespace tunnel_pilot::bridge {
namespace {

std::string read(const std::string& name) {
  std::ifstream file(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/" + name);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

using ValueTable = std::map<int, std::string>;

ValueTable valueTable(const std::string& file, const std::string& frame, const std::string& signal) {
  const std::string dbc = read(file);
  std::smatch line;
  ValueTable table;
  if (!std::regex_search(dbc, line, std::regex("\nVAL_ " + frame + " " + signal + " ([^\n]*) ;")))
    return table;
  const std::string body = line[1];
  const std::regex entry("(\\d+) \"([^\"]*)\"");
  for (std::sregex_iterator i(body.begin(), body.end(), entry), end; i != end; ++i) {
    table[std::stoi((*i)[1])] = (*i)[2];
  }
  return table;
}

// All numbers of an enumeration that have words.
template <class Enum>
ValueTable wordsOf() {
  ValueTable table;
  for (int i = 0; i < 256; ++i) {
    const std::string words = toString(static_cast<Enum>(i));
    if (words.rfind("unknown", 0) != 0) table[i] = words;
  }
  return table;
}

TEST(Dbc, ValueTablesAreTheEnumerationsOfTheCode) {
  struct File {
    std::string name, command, info, status;
  };
  for (const File& file :
       {File{"config/tunnel_pilot.dbc", "272", "273", "274"},
        File{"config/tunnel_pilot_j1939.dbc", "2365526144", "2566852992", "2566853248"}}) {
    EXPECT_EQ(valueTable(file.name, file.command, "Mode"), wordsOf<supervision::Mode>());
    EXPECT_EQ(valueTable(file.name, file.command, "Reason"), wordsOf<supervision::Reason>());
    EXPECT_EQ(valueTable(file.name, file.status, "Reason"), wordsOf<supervision::Reason>());
    EXPECT_EQ(valueTable(file.name, file.info, "Source"), wordsOf<supervision::Source>());
    EXPECT_EQ(valueTable(file.name, file.status, "State"), wordsOf<SafetyState>());
  }
}

std::string stateList(const std::vector<SafetyState>& states) {
  std::string list;
  for (const SafetyState state : states) list += (list.empty() ? "" : ", ") + toString(state);
  return list;
}

std::string transitionsAsMarkdown() {
  std::string table = "| from | event | to | reason |\n|---|---|---|---|\n";
  for (const Transition& row : transitionTable()) {
    const std::string reason = row.to == SafetyState::kStopped ? "the stop's"
                               : row.reason                    ? supervision::toString(*row.reason)
                                                               : "the command's";
    table += "| " + stateList(row.from) + " | " + toString(row.event) + " | " + toString(row.to) +
             " | " + reason + " |\n";
  }
  return table;
}

TEST(CanDocument, DrawsTheTransitionTableOfTheCode) {
  const std::string table = transitionsAsMarkdown();
  EXPECT_NE(read("docs/can.md").find(table), std::string::npos) << "docs/can.md must hold:\n" << table;
}

std::string framesAsMarkdown() {
  std::ostringstream table;
  table << "| frame | id | DataId | signal | bits | factor | range | unit "
           "|\n|---|---|---|---|---|---|---|---|\n";
  for (const can::FrameLayout& layout : can::frameLayouts()) {
    for (std::size_t i = 2; i < layout.signals.size(); ++i) {
      const can::SignalLayout& s = layout.signals[i];
      std::ostringstream name;
      name << std::hex << std::uppercase << layout.name << " | 0x" << layout.id << " | 0x"
           << static_cast<int>(layout.data_id);
      table << "| " << (i == 2 ? name.str() : " | | ") << " | " << s.name << " | " << s.start << ".."
            << s.start + s.length - 1 << (s.is_signed ? " signed" : "") << " | " << s.factor << " | ["
            << s.min << ", " << static_cast<long long>(s.max) << "] | " << s.unit << " |\n";
    }
  }
  return table.str();
}

TEST(CanDocument, ListsTheFramesOfTheCode) {
  const std::string table = framesAsMarkdown();
  EXPECT_NE(read("docs/can.md").find(table), std::string::npos) << "docs/can.md must hold:\n" << table;
}

std::string groupsAsMarkdown() {
  const auto source = [](const char* file, can::Side side) {
    config::Node node =
        config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + std::string(file));
    return can::loadProfile(node, side).j1939.source_address;
  };
  const std::uint8_t pilot = source("can_bridge.yaml", can::Side::kPilot);
  const std::uint8_t truck = source("truck_controller.yaml", can::Side::kTruck);
  std::string table = "| frame | group | priority | identifier |\n|---|---|---|---|\n";
  for (const can::J1939Group& group : can::j1939Groups()) {
    const std::uint8_t sender = group.sender == can::Side::kPilot ? pilot : truck;
    char line[96];
    std::snprintf(line, sizeof line, "| %s | 0x%04X | %d | 0x%08X |\n", can::findLayout(group.id)->name,
                  group.pgn, group.priority,
                  can::toIdentifier({group.priority, group.pgn, can::kGlobalAddress, sender}));
    table += line;
  }
  return table;
}

TEST(CanDocument, ListsTheGroupsOfTheCode) {
  const std::string table = groupsAsMarkdown();
  EXPECT_NE(read("docs/can.md").find(table), std::string::npos) << "docs/can.md must hold:\n" << table;
}

// -------- the table's own sense

TEST(TransitionTable, HasOneRowForEachStateAndEvent) {
  std::map<std::pair<SafetyState, Event>, int> rows;
  for (const Transition& row : transitionTable()) {
    for (const SafetyState from : row.from) ++rows[{from, row.event}];
  }
  for (const auto& [key, count] : rows) {
    EXPECT_EQ(count, 1) << toString(key.first) << ", " << toString(key.second);
  }
}

TEST(TransitionTable, EveryEventIsUsedAndHasAName) {
  for (int i = 0; i < kEventCount; ++i) {
    const auto event = static_cast<Event>(i);
    bool used = false;
    for (const Transition& row : transitionTable()) used = used || row.event == event;
    EXPECT_TRUE(used) << toString(event);
    EXPECT_FALSE(toString(event).empty());
  }
}

TEST(TransitionTable, WhatIsNoEventHasNoNameAndNoRow) {
  for (const int code : {kEventCount, 255}) {
    EXPECT_EQ(toString(static_cast<Event>(code)), "unknown event");
    EXPECT_EQ(findTransition(SafetyState::kActive, static_cast<Event>(code)), nullptr);
  }
}

TEST(TransitionTable, StopsAreLeftOnlyByStandstillAndTheOperatorsReset) {
  for (int i = 0; i < kEventCount; ++i) {
    const auto event = static_cast<Event>(i);
    const Transition* stopping = findTransition(SafetyState::kStopping, event);
    EXPECT_TRUE(stopping == nullptr || stopping->to == SafetyState::kStopped) << toString(event);
    const Transition* stopped = findTransition(SafetyState::kStopped, event);
    EXPECT_EQ(stopped != nullptr, event == Event::kOperatorReset);
  }
}

// CanBridge looks for the gravest fault alone: what it hides must make no difference.
TEST(TransitionTable, EveryFaultLeavesArmedActiveAndDegraded) {
  for (const Event fault :
       {Event::kBusFault, Event::kForeignSender, Event::kFeedbackCorrupt, Event::kFeedbackStale,
        Event::kOperatorOverride, Event::kKeyTurned, Event::kTruckFault, Event::kProcessSilent,
        Event::kCommandStale, Event::kMeasurementStale}) {
    for (const SafetyState state : {SafetyState::kArmed, SafetyState::kActive, SafetyState::kDegraded}) {
      const Transition* row = findTransition(state, fault);
      ASSERT_NE(row, nullptr) << toString(state) << ", " << toString(fault);
      EXPECT_FALSE(isEngaged(row->to)) << toString(state) << ", " << toString(fault);
    }
  }
}

TEST(TransitionTable, ASilentProcessAndAnOldCommandChangeNoOtherState) {
  for (const Event fault : {Event::kProcessSilent, Event::kCommandStale, Event::kMeasurementStale}) {
    for (const SafetyState state :
         {SafetyState::kInit, SafetyState::kStandby, SafetyState::kStopping, SafetyState::kStopped}) {
      EXPECT_EQ(findTransition(state, fault), nullptr) << toString(state) << ", " << toString(fault);
    }
  }
}

// CanBridge counts the time of recovery while it drives, and begins anew with what leads into DEGRADED.
TEST(TransitionTable, OnlyWhatDegradesLeadsIntoDegradedAndOnlyFromThereOneRecovers) {
  for (const Transition& row : transitionTable()) {
    const bool degrades = row.event == Event::kDegradeAsked || row.event == Event::kMeasurementLate;
    EXPECT_EQ(row.to == SafetyState::kDegraded, degrades) << toString(row.event);
    if (row.event != Event::kRecovered) continue;
    EXPECT_EQ(row.from, std::vector{SafetyState::kDegraded});
  }
}

TEST(TransitionTable, DrivingIsReachedOnlyThroughTheOperatorsEngage) {
  for (const Transition& row : transitionTable()) {
    EXPECT_EQ(row.to == SafetyState::kArmed, row.event == Event::kEngage) << toString(row.event);
    for (const SafetyState from : row.from) {
      EXPECT_TRUE(row.to != SafetyState::kActive || isEngaged(from)) << toString(row.event);
    }
  }
}

}  // namespace
}  // namespace tunnel_pilot::bridge
