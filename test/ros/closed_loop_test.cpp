// One lap through roslaunch: simulator, nodelets and bridge as processes, CAN frames between them. The
// figures are those of the same lap without ROS.
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <tunnel_pilot/TruckCommand.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "tunnel_pilot/ros/lap_monitor.h"
#include "tunnel_pilot/simulation/episode.h"

namespace tunnel_pilot::shell {
namespace {

// Within 20 % or 0.02 m.
void expectAlike(double with_ros, double without, const char* what) {
  EXPECT_NEAR(without, with_ros, std::max(0.2 * std::abs(without), 0.02)) << what;
}

// The laps that `evaluate` tells of, one a seed: each figure's values, in ascending order.
std::map<std::string, std::vector<double>> lapsWithoutRos(simulation::DriverChoice driver) {
  const auto scenario =
      simulation::loadScenario(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/scenarios/default_drift.yaml");
  auto setup = simulation::loadSetup(scenario);
  simulation::chooseDriver(scenario, driver, "", setup);
  std::map<std::string, std::vector<double>> figures;
  for (const auto& plan : simulation::episodePlans(scenario, 5)) {
    for (const auto& [figure, value] : simulation::runEpisode(scenario, setup, plan).metrics) {
      figures[figure].push_back(value);
    }
  }
  for (auto& [figure, values] : figures) std::sort(values.begin(), values.end());
  return figures;
}

double median(const std::vector<double>& values) { return simulation::quantile(values, 0.5); }

// Commands while the pilot drives, by who steered.
class SteeringCount {
 public:
  explicit SteeringCount(ros::NodeHandle nh)
      : subscriber_(nh.subscribe("command", 100, &SteeringCount::onCommand, this)) {}

  double share(std::uint8_t source) const { return 1.0 * counts_.at(source) / total_; }

 private:
  void onCommand(const TruckCommand& command) {
    if (command.mode != TruckCommand::MODE_AUTONOMOUS) return;
    ++counts_.at(command.source);
    ++total_;
  }

  ros::Subscriber subscriber_;
  std::array<int, 16> counts_{};
  int total_ = 0;
};

TEST(ClosedLoop, DrivesOneLapAsWellAsWithoutRos) {
  const bool by_network = ros::param::param<bool>("~by_network", false);
  const SteeringCount steering{ros::NodeHandle()};
  LapMonitor monitor{ros::NodeHandle(), ros::NodeHandle("~lap_monitor")};
  while (ros::ok() && !monitor.passed()) {
    ros::spinOnce();
    ros::WallDuration(0.001).sleep();
  }
  ASSERT_TRUE(monitor.passed().has_value());
  EXPECT_TRUE(*monitor.passed()) << monitor.verdict();
  RecordProperty("verdict", monitor.verdict());
  const auto with_ros = monitor.metrics();
  const auto without = lapsWithoutRos(by_network ? simulation::DriverChoice::kAll
                                                 : simulation::DriverChoice::kPreviewDriver);
  ASSERT_EQ(1.0, without.at("completed").front());
  const double share = steering.share(by_network ? TruckCommand::SOURCE_LIDAR_DRIVER
                                                 : TruckCommand::SOURCE_PREVIEW_DRIVER);
  EXPECT_GT(share, 0.9);
  RecordProperty("share", std::to_string(share));
  for (const char* figure : {"lateral_mean", "lateral_rms"}) {
    expectAlike(with_ros.at(figure), median(without.at(figure)), figure);
  }
  // The timing of processes makes the lap with ROS a draw of its own: of an extreme, the seeds' medians
  // are no measure, but the nearest of the seeds is.
  for (const char* figure : {"lateral_max", "clearance_min"}) {
    const auto& values = without.at(figure);
    const double value = with_ros.at(figure);
    RecordProperty(figure, std::to_string(values.front()) + " to " + std::to_string(values.back()));
    expectAlike(value, std::clamp(value, values.front(), values.back()), figure);
  }
  EXPECT_NEAR(median(without.at("heading_mean")), with_ros.at("heading_mean"), 0.01);  // [rad]
  const double lap_time = median(without.at("lap_time"));
  EXPECT_NEAR(lap_time, with_ros.at("lap_time"), 0.05 * lap_time);
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "closed_loop_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
