// What an operator reads in a terminal while the truck drives: status and self_check, as programs.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tunnel_pilot/SimulatorTruth.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>

namespace tunnel_pilot::shell {
namespace {

constexpr const char* kStatusNode = "/status_of_the_test";

std::string programOf(const std::string& name) {
  return std::string(TUNNEL_PILOT_NODE_FOLDER) + "/" + name;
}

// Runs self_check; its exit status and what it said.
std::pair<int, std::string> selfCheck(const std::string& remapping = "") {
  std::string output;
  FILE* pipe = popen(("'" + programOf("self_check") + "' " + remapping + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return {-1, ""};
  char buffer[4096];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) output += buffer;
  const int state = pclose(pipe);
  return {WIFEXITED(state) ? WEXITSTATUS(state) : -1, output};
}

// The program `status`, running, with what it said in a file.
class StatusProgram {
 public:
  explicit StatusProgram(const std::string& remapping = "")
      : file_(std::filesystem::temp_directory_path() / ("status_lines_" + std::to_string(getpid()))) {
    const std::string name = std::string("__name:=") + (kStatusNode + 1);
    const std::string program = programOf("status");
    process_ = fork();
    if (process_ != 0) return;
    const int out = open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    dup2(out, STDOUT_FILENO);
    const char* last = remapping.empty() ? nullptr : remapping.c_str();
    execl(program.c_str(), program.c_str(), name.c_str(), last, nullptr);
    _exit(127);
  }
  ~StatusProgram() {
    kill(process_, SIGINT);
    waitpid(process_, nullptr, 0);
    std::filesystem::remove(file_);
  }
  StatusProgram(const StatusProgram&) = delete;
  StatusProgram& operator=(const StatusProgram&) = delete;

  std::string output() const {
    std::ostringstream text;
    text << std::ifstream(file_).rdbuf();
    return text.str();
  }
  bool says(const std::string& words) const { return output().find(words) != std::string::npos; }
  bool runs() const {
    siginfo_t info{};
    return waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == 0;
  }

 private:
  std::filesystem::path file_;
  pid_t process_;
};

class StatusLinesTest : public ::testing::Test {
 protected:
  StatusLinesTest() {
    truth_ = nh_.subscribe<SimulatorTruth>("simulator/truth", 50,
                                           [this](const SimulatorTruth::ConstPtr& m) { truth = *m; });
  }

  static bool spinUntil(const std::function<bool()>& done, double seconds = 20.0) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(seconds);
    while (ros::SteadyTime::now() < end) {
      if (done()) return true;
      ros::spinOnce();
      ros::WallDuration(0.002).sleep();
    }
    return false;
  }

  void drive() {
    std_srvs::Trigger engage;
    ASSERT_TRUE(spinUntil([&] {
      ros::WallDuration(0.02).sleep();
      return truth.speed > 1.5 || (ros::service::call("engage", engage) && engage.response.success);
    }));
    ASSERT_TRUE(spinUntil([&] { return truth.speed > 1.5; })) << engage.response.message;
  }

  // Takes a subscriber's publishers away, as a cut cable would: the node is told that there are none.
  static bool cut(const std::string& node, const std::string& topic) {
    XmlRpc::XmlRpcValue call, answer, uri;
    call[0] = ros::this_node::getName();
    call[1] = node;
    std::string host;
    std::uint32_t port = 0;
    if (!ros::master::execute("lookupNode", call, answer, uri, false) ||
        !ros::network::splitURI(uri, host, port)) {
      return false;
    }
    XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
    XmlRpc::XmlRpcValue update;
    update[0] = "/master";
    update[1] = topic;
    update[2].setSize(0);
    return client.execute("publisherUpdate", update, answer);
  }

  ros::NodeHandle nh_;
  SimulatorTruth truth;

 private:
  ros::Subscriber truth_;
};

TEST_F(StatusLinesTest, SelfCheckFindsNothingWrongWithTheDemo) {
  drive();
  const auto [status, output] = selfCheck();
  EXPECT_EQ(0, status) << output;
  EXPECT_EQ(std::string::npos, output.find("FAIL")) << output;
  for (const char* words :
       {"OK    master: ", "OK    clock: simulated time goes on", "OK    arbiter: is up",
        "OK    transform base_link -> laser", "OK    scan: 3",
        "OK    command: ", "OK    network: lidar_driver ", "OK    truck: ACTIVE: driving as asked"}) {
    EXPECT_NE(std::string::npos, output.find(words)) << words << " is not in\n" << output;
  }
}

TEST_F(StatusLinesTest, StatusTellsInPlainLinesHowTheTruckDrives) {
  drive();
  const StatusProgram status;
  EXPECT_TRUE(spinUntil([&] {
    return status.says("ACTIVE, autonomous: driving as asked | lidar driver, network lidar_driver ");
  })) << status.output();
  EXPECT_FALSE(status.says("\033")) << "colours in a file";
}

// ros::Time throws where two are more than 68 years apart.
TEST_F(StatusLinesTest, AScanOfTheFarFutureEndsNeitherStatusNorSelfCheck) {
  const char* remapping = "scan:=scan_of_the_future";
  ros::Publisher publisher = nh_.advertise<sensor_msgs::LaserScan>("scan_of_the_future", 1, true);
  sensor_msgs::LaserScan scan;
  scan.header.stamp = ros::TIME_MAX;
  publisher.publish(scan);
  const StatusProgram status(remapping);
  ASSERT_TRUE(spinUntil([&] { return publisher.getNumSubscribers() > 0; }));
  spinUntil([] { return false; }, 0.5);
  EXPECT_TRUE(status.runs());
  const auto [code, output] = selfCheck(remapping);
  EXPECT_EQ(1, code) << output;
  EXPECT_NE(std::string::npos, output.find("FAIL  scan: ")) << output;
}

TEST_F(StatusLinesTest, ADeadLidarIsToldWithinASecondInTheArbitersWords) {
  drive();
  const StatusProgram status;
  ASSERT_TRUE(spinUntil([&] { return status.says("driving as asked"); })) << status.output();
  const ros::Time dead = ros::Time::now();
  ASSERT_TRUE(cut("/pilot_manager", "/scan"));
  ASSERT_TRUE(cut(kStatusNode, "/scan"));
  EXPECT_TRUE(spinUntil([&] { return status.says(": no lidar scan | "); })) << status.output();
  EXPECT_LT((ros::Time::now() - dead).toSec(), 1.0) << status.output();
  const auto [code, output] = selfCheck();
  EXPECT_EQ(1, code);
  EXPECT_NE(std::string::npos, output.find(": no lidar scan; remove the cause")) << output;
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "status_lines_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
