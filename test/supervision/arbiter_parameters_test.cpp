#include <gtest/gtest.h>

#include <string>

#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::supervision {
namespace {

const std::string kFile = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/arbiter.yaml";

std::string refusal(const YAML::Node& yaml) {
  try {
    loadArbiter(config::Node(yaml, "arbiter.yaml"));
  } catch (const config::ConfigError& e) {
    return e.what();
  }
  return "(accepted)";
}

TEST(ArbiterParameters, TheShippedFileIsRead) {
  const ArbiterParameters p = loadArbiter(config::loadFile(kFile));
  EXPECT_FALSE(p.sources.empty());
  EXPECT_TRUE(p.needs_truck_state);
  EXPECT_TRUE(p.wall_checks);
}

TEST(ArbiterParameters, UnknownSourceIsRefused) {
  YAML::Node yaml = YAML::LoadFile(kFile);
  yaml["sources"][0]["source"] = "autopilot";
  EXPECT_NE(refusal(yaml).find("source"), std::string::npos);
}

TEST(ArbiterParameters, TwoRowsOfOneSourceAreRefused) {
  YAML::Node yaml = YAML::LoadFile(kFile);
  yaml["sources"][1]["source"] = yaml["sources"][0]["source"].as<std::string>();
  EXPECT_NE(refusal(yaml).find("twice"), std::string::npos);
}

TEST(ArbiterParameters, TwoSourcesOfOnePriorityAreRefused) {
  YAML::Node yaml = YAML::LoadFile(kFile);
  yaml["sources"][1]["priority"] = yaml["sources"][0]["priority"].as<int>();
  EXPECT_NE(refusal(yaml).find("priority"), std::string::npos);
}

TEST(ArbiterParameters, AStopAgeBelowTheDegradedAgeIsRefused) {
  YAML::Node yaml = YAML::LoadFile(kFile);
  yaml["ages"]["scan_stop"] = 0.05;
  EXPECT_NE(refusal(yaml).find("scan_stop"), std::string::npos);
}

TEST(ArbiterParameters, ATableWithoutASourceIsRefused) {
  YAML::Node yaml = YAML::LoadFile(kFile);
  yaml["sources"] = YAML::Load("[]");
  EXPECT_NE(refusal(yaml).find("sources"), std::string::npos);
}

TEST(ArbiterParameters, MissingLimitIsNamed) {
  YAML::Node yaml = YAML::LoadFile(kFile);
  yaml["limiter"].remove("max_jerk");
  EXPECT_NE(refusal(yaml).find("limiter.max_jerk"), std::string::npos);
}

}  // namespace
}  // namespace tunnel_pilot::supervision
