// Recorded lidar through the nodelets gives the answers of `perceive`.
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>
#include <tunnel_pilot/TunnelState.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "stage_test.h"

namespace tunnel_pilot::shell {
namespace {

std::filesystem::path recording(const std::string& name) {
  const char* folder = std::getenv("TUNNEL_PILOT_DATA");
  if (folder != nullptr) return std::filesystem::path(folder) / name;
  return std::filesystem::path(TUNNEL_PILOT_SOURCE_DIR) / "../shared/data" / name;
}

struct Answer {
  bool valid = false;
  double width = 0.0, heading_error = 0.0, lateral_offset = 0.0;
};

// stamp [ns] to answer, from the CSV that perceive writes.
std::map<std::int64_t, Answer> perceive(const std::filesystem::path& bag) {
  const std::string csv = std::filesystem::temp_directory_path() / "tunnel_pilot_replay_test.csv";
  const std::string command = std::string(TUNNEL_PILOT_NODE_FOLDER) + "/perceive --bag '" +
                              bag.string() + "' --csv '" + csv + "' --config '" +
                              TUNNEL_PILOT_SOURCE_DIR + "/config/corridor' 2>/dev/null";
  std::map<std::int64_t, Answer> answers;
  if (std::system(command.c_str()) != 0) return answers;
  std::ifstream file(csv);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    long long seconds = 0, nanoseconds = 0;
    int valid = 0;
    Answer answer;
    std::sscanf(line.c_str(), "%lld.%lld,%d,%lf,%lf,%lf", &seconds, &nanoseconds, &valid, &answer.width,
                &answer.heading_error, &answer.lateral_offset);
    answer.valid = valid != 0;
    answers[seconds * 1'000'000'000 + nanoseconds] = answer;
  }
  std::filesystem::remove(csv);
  return answers;
}

class ReplayTest : public StageTest {
 protected:
  ReplayTest()
      : scan_(nh_.advertise<sensor_msgs::LaserScan>("scan", 10)),
        odometry_(nh_.advertise<nav_msgs::Odometry>("odom", 10)),
        transform_(nh_.advertise<tf2_msgs::TFMessage>("/tf", 10)),
        states_(nh_, "tunnel_state") {}

  // Plays the bag message by message; after each scan waits until its answer is there.
  void play(const std::filesystem::path& file) {
    rosbag::Bag bag(file.string(), rosbag::bagmode::Read);
    // The query of perceive, so that messages of one time come in its order.
    rosbag::View view(bag, rosbag::TopicQuery(std::vector<std::string>{"/scan", "/odom"}));
    for (const auto& message : view) {
      ros::Time::setNow(message.getTime());
      if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
        odometry_.publish(odometry);
      } else if (const auto scan = message.instantiate<sensor_msgs::LaserScan>()) {
        scan_.publish(scan);
        spinUntil([&] { return states_.has(scan->header.stamp); }, 0.5);
      }
    }
  }

  // Lets the scan filter find the lidar's pose before the first scan counts: it says so when it rejects
  // a scan for another reason than a missing transform.
  void announceLidar(const std::filesystem::path& file) {
    rosbag::Bag bag(file.string(), rosbag::bagmode::Read);
    rosbag::View transforms(bag, rosbag::TopicQuery("/tf"));
    transform_.publish(transforms.begin()->instantiate<tf2_msgs::TFMessage>());
    ros::Time::setNow(transforms.getBeginTime());
    sensor_msgs::LaserScan nothing;
    nothing.header.frame_id = "laser";
    ASSERT_TRUE(spinUntil([&] {
      send(scan_, nothing);
      return diagnosticsSay("scan_filter", "scan rejected");
    }));
  }

  ros::Publisher scan_, odometry_, transform_;
  Listener<TunnelState> states_;
};

TEST_F(ReplayTest, GivesTheAnswersOfPerceive) {
  const auto bag = recording("duke_loop5.bag");
  if (!std::filesystem::exists(bag)) {
    GTEST_SKIP() << "SKIPPED: no recording " << bag << "; name its folder in TUNNEL_PILOT_DATA";
  }
  const auto expected = perceive(bag);
  ASSERT_EQ(551u, expected.size());
  for (const char* stage : {"scan_filter", "wall_segmentation", "centerline"})
    ASSERT_TRUE(load(stage, stage));
  ASSERT_TRUE(spinUntil([&] {
    return scan_.getNumSubscribers() > 0 && odometry_.getNumSubscribers() > 0 &&
           transform_.getNumSubscribers() > 0 && states_.connected();
  }));
  announceLidar(bag);
  play(bag);

  std::size_t compared = 0, valid = 0;
  for (const auto& state : states_.messages) {
    const auto found = expected.find(static_cast<std::int64_t>(state.header.stamp.toNSec()));
    ASSERT_NE(expected.end(), found);
    const Answer& answer = found->second;
    ++compared;
    EXPECT_EQ(answer.valid, state.valid) << state.header.stamp;
    if (!answer.valid || !state.valid) continue;
    ++valid;
    EXPECT_NEAR(answer.width, state.width, 0.005) << state.header.stamp;
    EXPECT_NEAR(answer.heading_error, state.heading_error, 0.005) << state.header.stamp;
    EXPECT_NEAR(answer.lateral_offset, state.lateral_offset, 0.005) << state.header.stamp;
  }
  EXPECT_EQ(551u, compared);
  EXPECT_GE(valid, 200u);
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "replay_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
