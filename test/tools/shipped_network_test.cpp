// The network that the package ships drives the truck: a short way of drifts that it never saw.
#include <gtest/gtest.h>

#include <fstream>

#include "program.h"

namespace tunnel_pilot {
namespace {

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;

std::string shortDrift() {
  return "name: short_drift\ntitle: The first 100 m of unseen drifts\nconfig: " + kPackage +
         "/config\nfirst_seed: 3900\nseeds: 3\n"
         "plant: {model: dynamic, load: loaded, rough_road: true, variation: 0.2}\n"
         "experiment:\n  kind: drive\n  world: " +
         kPackage +
         "/worlds/random_drift.yaml\n  both_directions: true\n  station: 14.0\n  lateral_offset: 0.0\n"
         "  heading_error: 0.0\n  rolling_speed: 0.0\n  top_speed: 3.0\n  distance: 100.0\n"
         "  time_limit: 60.0\n  return_metrics: false\ngoals:\n"
         "  - {metric: lateral_rms, paper: '-', judge: every_seed, max: 0.10}\n"
         "  - {metric: lateral_max, paper: '-', judge: every_seed, max: 0.25}\n"
         "  - {metric: contacts, paper: '-', judge: every_seed, max: 0.0}\n"
         "  - {metric: completed, paper: '-', judge: every_seed, min: 1.0}\n"
         "  - {metric: lidar_driver_share, paper: '-', judge: every_seed, min: 0.95}\n";
}

TEST(ShippedNetwork, DrivesUnseenDriftsWithinItsGoals) {
  Workplace place;
  std::ofstream(place.file("short_drift.yaml")) << shortDrift();
  const Outcome outcome = runProgram(
      EVALUATE_PROGRAM, {place.file("short_drift.yaml"), "--driver", "lidar_driver", "--network",
                         kPackage + "/networks/lidar_driver.yaml", "--jobs", "2"});
  EXPECT_EQ(outcome.status, 0) << outcome.output;
}

}  // namespace
}  // namespace tunnel_pilot
