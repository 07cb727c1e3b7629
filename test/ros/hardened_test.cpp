// The hardened bridge: driving begins by the local socket alone, foreign commands stop the truck, and
// messages are exchanged on loopback alone.
#include <gtest/gtest.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>
#include <string>

namespace tunnel_pilot::shell {
namespace {

constexpr int kAccepted = 0;

class Hardened : public ::testing::Test {
 protected:
  Hardened() {
    subscriber_ = nh_.subscribe<TruckStatus>("truck_status", 10,
                                             [this](const TruckStatus::ConstPtr& m) { status_ = *m; });
  }

  bool spinUntil(const std::function<bool()>& done, double seconds = 40.0) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(seconds);
    while (ros::SteadyTime::now() < end) {
      ros::spinOnce();
      if (done()) return true;
      ros::WallDuration(0.01).sleep();
    }
    return false;
  }

  static int operate(const std::string& edge) {
    const std::string command = std::string(TUNNEL_PILOT_NODE_FOLDER) + "/operate " + edge +
                                " --socket " + ros::param::param<std::string>("~socket", "");
    return std::system(command.c_str());
  }

  bool is(std::uint8_t state) const { return status_.state == state; }

  // From whatever state to driving, by the socket.
  void drive() {
    ASSERT_TRUE(spinUntil([&] {
      if (is(TruckStatus::STATE_STOPPED)) operate("reset");
      if (is(TruckStatus::STATE_STANDBY)) operate("engage");
      return is(TruckStatus::STATE_ACTIVE);
    })) << status_.reason_text;
  }

  ros::NodeHandle nh_;
  ros::Subscriber subscriber_;
  TruckStatus status_;
};

TEST_F(Hardened, EngageAndResetAreNoServices) {
  ASSERT_TRUE(ros::service::waitForService("stop", ros::Duration(-1)));
  EXPECT_TRUE(ros::service::exists("release", false));
  EXPECT_FALSE(ros::service::exists("engage", false));
  EXPECT_FALSE(ros::service::exists("reset", false));
}

TEST_F(Hardened, TheSocketEngagesAndAnybodyMayStop) {
  drive();
  std_srvs::Trigger stop;
  ASSERT_TRUE(ros::service::call("stop", stop));
  EXPECT_TRUE(stop.response.success);
  EXPECT_TRUE(spinUntil([&] { return is(TruckStatus::STATE_STOPPED); }));
  EXPECT_NE(operate("engage"), kAccepted) << "a stop is left by a reset first";
  EXPECT_TRUE(spinUntil([&] { return operate("reset") == kAccepted; }));
}

TEST_F(Hardened, ACommandOfAnotherNodeStopsTheTruck) {
  drive();
  ros::Publisher rogue = nh_.advertise<TruckCommand>("command", 1);
  TruckCommand command;
  command.speed = 3.0;
  command.mode = TruckCommand::MODE_AUTONOMOUS;
  EXPECT_TRUE(spinUntil([&] {
    command.header.stamp = ros::Time::now();
    ++command.sequence;
    rogue.publish(command);
    return is(TruckStatus::STATE_STOPPING) || is(TruckStatus::STATE_STOPPED);
  }));
}

// Where a process listens, as the kernel tells it: addresses, hexadecimal, of all ports but one.
std::set<std::string> listeningAddresses(int pid, std::uint32_t other_port) {
  std::set<std::string> inodes, addresses;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/fd")) {
    std::error_code error;
    const std::string target = std::filesystem::read_symlink(entry.path(), error).string();
    if (target.rfind("socket:[", 0) == 0) inodes.insert(target.substr(8, target.size() - 9));
  }
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream lines(table);
    std::string line;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
      std::istringstream words(line);
      std::string number, local, remote, state, word, inode;
      words >> number >> local >> remote >> state;
      for (int i = 0; i < 5; ++i) words >> word;
      words >> inode;
      const std::size_t colon = local.find(':');
      const bool other = std::stoul(local.substr(colon + 1), nullptr, 16) == other_port;
      if (state == "0A" && inodes.count(inode) != 0 && !other) addresses.insert(local.substr(0, colon));
    }
  }
  return addresses;
}

// All but its XML-RPC port, which roscpp opens to everybody whatever it is told (docs/security.md).
TEST_F(Hardened, TheBridgeTakesMessagesOnLoopbackAlone) {
  XmlRpc::XmlRpcValue call, answer, uri;
  call[0] = ros::this_node::getName();
  call[1] = "/can_bridge";
  ASSERT_TRUE(ros::master::execute("lookupNode", call, answer, uri, false));
  std::string host;
  std::uint32_t port = 0;
  ASSERT_TRUE(ros::network::splitURI(uri, host, port));
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
  XmlRpc::XmlRpcValue caller;
  caller[0] = ros::this_node::getName();
  ASSERT_TRUE(client.execute("getPid", caller, answer));
  const std::set<std::string> addresses = listeningAddresses(static_cast<int>(answer[2]), port);
  EXPECT_EQ(addresses, std::set<std::string>{"0100007F"});
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "hardened");
  ros::NodeHandle keeps_ros_up;
  return RUN_ALL_TESTS();
}
