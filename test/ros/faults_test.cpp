// What breaks while the truck drives: every fault ends in a stop that says why, and nothing but an
// operator's edge ends the stop.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tunnel_pilot/SimulatorTruth.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <csignal>
#include <functional>
#include <string>

#include "tunnel_pilot/supervision/command.h"

namespace tunnel_pilot::shell {
namespace {

using supervision::Reason;

constexpr double kStandstill = 0.02;  // [m/s]

class FaultsTest : public ::testing::Test {
 protected:
  FaultsTest() {
    truth_ = nh_.subscribe<SimulatorTruth>("simulator/truth", 50,
                                           [this](const SimulatorTruth::ConstPtr& m) { truth = *m; });
    status_ = nh_.subscribe<TruckStatus>("truck_status", 50,
                                         [this](const TruckStatus::ConstPtr& m) { status = *m; });
    diagnostics_ = nh_.subscribe("/diagnostics", 50, &FaultsTest::onDiagnostics, this);
    startBridge();
    engage();
  }
  ~FaultsTest() override {
    endBridge(SIGINT);
    // The next test begins with a truck that stands at its start.
    spinUntil([&] { return std::abs(truth.speed) < kStandstill; });
    call("simulator/reset");
  }

  void startBridge() {
    bridge_ = fork();
    if (bridge_ != 0) return;
    const std::string program = std::string(TUNNEL_PILOT_NODE_FOLDER) + "/can_bridge";
    execl(program.c_str(), program.c_str(), "__name:=can_bridge", nullptr);
    _exit(127);
  }

  void endBridge(int signal) {
    if (bridge_ <= 0) return;
    kill(bridge_, signal);
    waitpid(bridge_, nullptr, 0);
    bridge_ = -1;
  }

  // As a machine does that has other things to do.
  void holdUp(pid_t process, double seconds) {
    kill(process, SIGSTOP);
    spinUntil([] { return false; }, seconds);
    kill(process, SIGCONT);
  }

  void expectToDriveThroughHoldUps(pid_t process) {
    ASSERT_GT(process, 0);
    for (const double seconds : {0.06, 0.2, 1.0, 0.2, 1.5}) {
      holdUp(process, seconds);
      spinUntil([] { return false; }, 0.2);
      ASSERT_EQ(static_cast<int>(TruckStatus::STATE_ACTIVE), status.state) << status.reason_text;
    }
    EXPECT_GT(truth.speed, 1.0);
  }

  pid_t bridge() const { return bridge_; }

  static pid_t processOf(const std::string& node) {
    XmlRpc::XmlRpcValue call, answer, uri;
    call[0] = ros::this_node::getName();
    call[1] = node;
    std::string host;
    std::uint32_t port = 0;
    if (!ros::master::execute("lookupNode", call, answer, uri, false) ||
        !ros::network::splitURI(uri, host, port)) {
      return -1;
    }
    XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
    XmlRpc::XmlRpcValue caller;
    caller[0] = ros::this_node::getName();
    return client.execute("getPid", caller, answer) ? static_cast<int>(answer[2]) : -1;
  }

  bool spinUntil(const std::function<bool()>& done, double seconds = 20.0) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(seconds);
    while (ros::SteadyTime::now() < end) {
      if (done()) return true;
      ros::spinOnce();
      ros::WallDuration(0.002).sleep();
    }
    return false;
  }

  std_srvs::Trigger::Response call(const std::string& service) {
    std_srvs::Trigger trigger;
    ros::service::waitForService(service, ros::Duration(-1));
    EXPECT_TRUE(ros::service::call(service, trigger)) << service;
    return trigger.response;
  }

  // Engages and waits until the truck drives. An arbiter that has not yet got over what the test before
  // did lets the arming time out: then once more.
  void engage() {
    ASSERT_TRUE(spinUntil([&] {
      ros::WallDuration(0.02).sleep();
      const bool waits =
          status.state == TruckStatus::STATE_INIT || status.state == TruckStatus::STATE_STANDBY;
      if (waits) call("engage");
      return truth.speed > 1.5;
    })) << status.reason_text;
  }

  void expectStop(Reason reason) {
    ASSERT_TRUE(spinUntil([&] { return status.state == TruckStatus::STATE_STOPPED; }))
        << static_cast<int>(status.state) << " " << status.reason_text;
    EXPECT_EQ(static_cast<int>(reason), status.reason) << status.reason_text;
    EXPECT_LT(std::abs(truth.speed), 0.2);
    EXPECT_EQ(0u, truth.contacts);
  }

  ros::NodeHandle nh_;
  SimulatorTruth truth;
  TruckStatus status;
  std::string simulator_says;  // on /diagnostics

 private:
  void onDiagnostics(const diagnostic_msgs::DiagnosticArray& message) {
    for (const auto& told : message.status) {
      if (told.name.find("simulator") != std::string::npos) simulator_says = told.message;
    }
  }

  pid_t bridge_ = -1;
  ros::Subscriber truth_, status_, diagnostics_;
};

TEST_F(FaultsTest, KilledBridgeStopsTheTruckByTheTrucksOwnTimeout) {
  endBridge(SIGKILL);
  EXPECT_TRUE(spinUntil([&] { return std::abs(truth.speed) < kStandstill; }));
  EXPECT_EQ(0u, truth.contacts);
  EXPECT_EQ("in real time: the bridge is silent", simulator_says);
  startBridge();  // a bridge that comes back does not drive on by itself
  ASSERT_TRUE(spinUntil([&] { return status.state == TruckStatus::STATE_STANDBY; }));
  EXPECT_LT(std::abs(truth.speed), kStandstill);
}

TEST_F(FaultsTest, ABridgeHeldUpByABusyMachineDoesNotStopTheTruck) {
  expectToDriveThroughHoldUps(bridge());
}

TEST_F(FaultsTest, APilotHeldUpByABusyMachineDoesNotStopTheTruck) {
  expectToDriveThroughHoldUps(processOf("/pilot_manager"));
}

TEST_F(FaultsTest, SilentScanFilterStopsTheTruck) {
  nodelet::NodeletUnload unload;
  unload.request.name = "/scan_filter";
  ASSERT_TRUE(ros::service::call("pilot_manager/unload_nodelet", unload));
  const bool stopped = spinUntil([&] { return status.state == TruckStatus::STATE_STOPPED; });
  nodelet::NodeletLoad load;
  load.request.name = "/scan_filter";
  load.request.type = "tunnel_pilot/scan_filter";
  ASSERT_TRUE(ros::service::call("pilot_manager/load_nodelet", load));
  EXPECT_TRUE(stopped);
  EXPECT_LT(std::abs(truth.speed), 0.2);
  EXPECT_FALSE(status.reason_text.empty());
}

TEST_F(FaultsTest, ClockThatJumpsBackStopsTheTruck) {
  ros::Publisher clock = nh_.advertise<rosgraph_msgs::Clock>("/clock", 10);
  ASSERT_TRUE(spinUntil([&] { return clock.getNumSubscribers() > 3; }));
  rosgraph_msgs::Clock message;
  // Again and again: the first may go before the bridge has connected.
  ASSERT_TRUE(spinUntil([&] {
    message.clock = truth.header.stamp - ros::Duration(1.0);
    clock.publish(message);
    return status.state == TruckStatus::STATE_STOPPING || status.state == TruckStatus::STATE_STOPPED;
  }));
  // Which of the watches is first to notice, and so names the reason, is chance.
  ASSERT_TRUE(spinUntil([&] { return status.state == TruckStatus::STATE_STOPPED; }));
  EXPECT_NE(static_cast<int>(Reason::kNone), status.reason);
  EXPECT_LT(std::abs(truth.speed), 0.2);
}

TEST_F(FaultsTest, OperatorsStopIsLatchedUntilReset) {
  EXPECT_TRUE(call("stop").success);
  expectStop(Reason::kOperatorStop);
  const auto refused = call("engage");
  EXPECT_FALSE(refused.success);
  EXPECT_FALSE(refused.message.empty());
  EXPECT_TRUE(spinUntil([&] { return call("reset").success; }));
  engage();
}

TEST_F(FaultsTest, CommandsFromASecondPublisherThatAreNotFiniteDoNotReachTheTruck) {
  ros::Publisher rogue = nh_.advertise<TruckCommand>("command", 10);
  ASSERT_TRUE(spinUntil([&] { return rogue.getNumSubscribers() > 0; }));
  TruckCommand command;
  command.header.stamp = ros::Time::now();
  command.sequence = 4'000'000'000u;
  command.articulation_angle = std::numeric_limits<double>::quiet_NaN();
  command.speed = 5.0;
  for (int i = 0; i < 50; ++i) {
    rogue.publish(command);
    spinUntil([] { return false; }, 0.005);
    EXPECT_TRUE(std::isfinite(truth.articulation));
    EXPECT_LT(std::abs(truth.speed), 3.2);
  }
  EXPECT_EQ(0u, truth.contacts);
}

// Finite, in range and numbered higher than the arbiter's, which would then be refused themselves.
TEST_F(FaultsTest, ASecondPublisherOfCommandsIsNotObeyedAndStops) {
  ros::Publisher rogue = nh_.advertise<TruckCommand>("command", 10);
  ASSERT_TRUE(spinUntil([&] { return rogue.getNumSubscribers() > 0; }));
  TruckCommand command;
  command.sequence = 4'000'000'000u;
  command.articulation_angle = 0.3;
  command.speed = 5.0;
  command.acceleration = 1.0;
  EXPECT_TRUE(spinUntil([&] {
    command.header.stamp = truth.header.stamp;
    rogue.publish(command);
    return status.state == TruckStatus::STATE_STOPPED;
  })) << status.reason_text;
  EXPECT_EQ(0u, truth.contacts);
}

TEST_F(FaultsTest, PausedSimulatorStandsStillAndGoesOnWithoutAStop) {
  std_srvs::SetBool pause;
  pause.request.data = true;
  ASSERT_TRUE(ros::service::call("simulator/pause", pause));
  spinUntil([] { return false; }, 0.1);  // what was under way
  const ros::Time time = truth.header.stamp;
  spinUntil([] { return false; }, 0.5);
  EXPECT_EQ(time, truth.header.stamp);
  pause.request.data = false;
  ASSERT_TRUE(ros::service::call("simulator/pause", pause));
  ASSERT_TRUE(spinUntil([&] { return truth.header.stamp > time + ros::Duration(1.0); }));
  EXPECT_GT(truth.speed, 1.0);
}

TEST_F(FaultsTest, ResetPutsTheTruckBackToItsStart) {
  ASSERT_TRUE(spinUntil([&] { return truth.station > 18.0; }));
  EXPECT_TRUE(call("stop").success);
  expectStop(Reason::kOperatorStop);
  EXPECT_TRUE(call("simulator/reset").success);
  EXPECT_TRUE(spinUntil([&] { return std::abs(truth.station - 14.0) < 0.5; })) << truth.station;
}

TEST_F(FaultsTest, AResetOnTheMoveNeedsTheOperatorBeforeTheTruckDrivesAgain) {
  ASSERT_TRUE(spinUntil([&] { return truth.station > 18.0; }));
  EXPECT_TRUE(call("simulator/reset").success);
  expectStop(Reason::kTruckFault);
  EXPECT_NEAR(truth.station, 14.0, 0.5);
  EXPECT_TRUE(spinUntil([&] { return call("reset").success; }));
  engage();
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "faults_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
