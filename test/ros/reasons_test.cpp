// Each reason why the truck does what it does, but for the reserved one, is provoked while it drives,
// and is told within a second of ROS time, in the same words, on the HUD, in the line of `status`, on
// /diagnostics and in the log of the node that found it. How soon is printed at the end.
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <ros/callback_queue.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tunnel_pilot/SimulatorTruth.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <csignal>
#include <limits>
#include <set>

#include "reasons_channels.h"
#include "reasons_faults.h"

namespace tunnel_pilot::shell {
namespace {

using supervision::Reason;

constexpr double kLimit = 1.0;      // for every channel [s] ROS time
constexpr double kUnderway = 0.3;   // [m/s]
constexpr double kDrivesFor = 0.1;  // until the truck is taken as driving [s] ROS time
constexpr int kAttempts = 4;
constexpr double kTrackLength = 24.0;  // of the straight that is used, from the start [m]

/// The bridge, a process that the test may kill.
class Bridge {
 public:
  ~Bridge() { end(SIGINT); }
  void startUnlessRunning() {
    if (process_ > 0) return;
    process_ = fork();
    if (process_ != 0) return;
    const std::string program = std::string(TUNNEL_PILOT_NODE_FOLDER) + "/can_bridge";
    execl(program.c_str(), program.c_str(), "__name:=can_bridge", nullptr);
    _exit(127);
  }
  void end(int signal) {
    if (process_ <= 0) return;
    kill(process_, signal);
    waitpid(process_, nullptr, 0);
    process_ = -1;
  }

 private:
  pid_t process_ = -1;
};

/// All that lasts from one reason to the next.
struct Rig {
  Rig()
      : wire(ros::param::param<std::string>("~bus", "")),
        truth_subscriber(nh.subscribe<SimulatorTruth>(
            "simulator/truth", 50, [this](const SimulatorTruth::ConstPtr& m) { truth = *m; })),
        clock(nh.advertise<rosgraph_msgs::Clock>("/clock", 10)) {}

  void clear() {
    wire.set(WireFault::kNone);
    lidar.set(View::kClear);
  }

  ros::NodeHandle nh;
  SpoiltWire wire;
  SpoiltLidar lidar;
  Understudy understudy;
  Channels channels;
  Bridge bridge;
  std::set<std::string> unloaded;  // stages
  SimulatorTruth truth;
  ros::Subscriber truth_subscriber;
  ros::Publisher clock;
};

class Reasons : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { rig_ = new Rig; }
  static void TearDownTestSuite() {
    rig_->channels.printWorst();
    delete rig_;
  }

  ~Reasons() override {
    rig().clear();
    rig().understudy.play(Part::kNone);
  }

  static Rig& rig() { return *rig_; }
  static const TruckStatus& status() { return rig().channels.truck(); }

  static bool spinUntil(const std::function<bool()>& done, double seconds = 20.0) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(seconds);
    while (ros::SteadyTime::now() < end && ros::ok()) {
      ros::spinOnce();
      rig().channels.look();
      if (done()) return true;
      ros::WallDuration(0.002).sleep();
    }
    return false;
  }

  static std_srvs::Trigger::Response call(const std::string& service) {
    std_srvs::Trigger trigger;
    ros::service::call(service, trigger);
    return trigger.response;
  }

  static void loadUnlessLoaded(const std::string& stage) {
    if (rig().unloaded.count(stage) == 0) return;
    nodelet::NodeletLoad load;
    load.request.name = "/" + stage;
    load.request.type = "tunnel_pilot/" + stage;
    ASSERT_TRUE(ros::service::call("pilot_manager/load_nodelet", load) && load.response.success);
    rig().unloaded.erase(stage);
  }
  static bool unload(const std::string& stage) {
    nodelet::NodeletUnload unload;
    unload.request.name = "/" + stage;
    rig().unloaded.insert(stage);
    return ros::service::call("pilot_manager/unload_nodelet", unload) && unload.response.success;
  }

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

  // What an operator does until the truck drives, from whatever the reason before has left.
  static void operate() {
    switch (status().state) {
      case TruckStatus::STATE_STOPPED:
        if (rig().truth.station > 14.0 + kTrackLength) call("simulator/reset");
        call("reset");
        break;
      case TruckStatus::STATE_STANDBY:
        call("engage");
        break;
      case TruckStatus::STATE_DEGRADED:
      case TruckStatus::STATE_ACTIVE:
        if (rig().truth.station > 14.0 + kTrackLength) call("stop");
        break;
      default:
        break;
    }
  }

  static void drive(double speed = kUnderway) {
    ros::SteadyTime next;
    std::optional<ros::Time> drives_since;
    const auto drives = [&] {
      return rig().truth.speed > speed && status().state == TruckStatus::STATE_ACTIVE &&
             rig().channels.arbiterIsContent() && rig().truth.station < 14.0 + kTrackLength;
    };
    ASSERT_TRUE(spinUntil(
        [&] {
          if (drives()) {
            if (!drives_since) drives_since = ros::Time::now();
            return (ros::Time::now() - *drives_since).toSec() > kDrivesFor;
          }
          drives_since.reset();
          if (ros::SteadyTime::now() < next) return false;
          next = ros::SteadyTime::now() + ros::WallDuration(0.1);
          operate();
          return false;
        },
        40.0))
        << "state " << static_cast<int>(status().state) << ": " << status().reason_text << ", "
        << rig().truth.speed << " m/s at " << rig().truth.station << " m";
  }

  /// What makes a reason, and who finds it.
  struct Cause {
    std::vector<std::string> finders;
    std::function<void()> provoke;
    std::function<void()> prepare = [] {};  ///< before the truck drives
    double speed = kUnderway;               ///< to drive at [m/s]
    std::function<void()> end = [] {};
  };

  // From the first message that gives the reason until each channel has told it.
  // `just_started`: who listens to the log is not yet connected to such a process; its terminal has it.
  static void expectChannelsTell(Reason reason, bool just_started = false) {
    Channels& channels = rig().channels;
    spinUntil([&] { return channels.allTold() || channels.sinceItStands() > 2.0 * kLimit; }, 10.0);
    for (const auto& [channel, delay] : channels.takeDelays()) {
      if (just_started && channel == "log") continue;
      EXPECT_LE(delay, kLimit) << channel << " has not told in time: " << toString(reason) << "\n"
                               << channels.lately();
    }
    EXPECT_EQ(0u, rig().truth.contacts);
  }

  // On a machine that holds processes up, the truck may stop for that before the cause is found; then
  // the cause comes again.
  static void expectTold(Reason reason, const Cause& cause) {
    bool told = false;
    for (int attempt = 0; attempt < kAttempts && !told; ++attempt) {
      ASSERT_NO_FATAL_FAILURE(cause.prepare());
      ASSERT_NO_FATAL_FAILURE(drive(cause.speed));
      rig().channels.listenFor(reason, cause.finders);
      ASSERT_NO_FATAL_FAILURE(cause.provoke());
      const auto stands = [&] { return rig().channels.stands(); };
      spinUntil([&] { return stands() || status().state == TruckStatus::STATE_STOPPED; }, 10.0);
      told = stands();
      if (told) expectChannelsTell(reason);
      cause.end();
      rig().clear();
    }
    ASSERT_TRUE(told) << "never given: " << toString(reason) << "; the truck's is "
                      << status().reason_text;
  }

  static void expectToldByArbiter(Reason reason, const std::function<void()>& provoke) {
    expectTold(reason, {{"arbiter"}, provoke});
  }
  static void expectToldByBridge(Reason reason, const std::function<void()>& provoke) {
    expectTold(reason, {{"can_bridge"}, provoke});
  }

  static void expectToldOfPart(Reason reason, Part at_first, Part then) {
    expectTold(
        reason,
        {{"arbiter"}, [&] { rig().understudy.play(then); }, [&] { rig().understudy.play(at_first); }});
  }

  // Before the truck drives, or by driving itself.
  static void expectToldAtOnce(Reason reason, const std::function<void()>& provoke,
                               bool just_started = false) {
    rig().channels.listenFor(reason, {"can_bridge"});
    ASSERT_NO_FATAL_FAILURE(provoke());
    ASSERT_TRUE(spinUntil([&] { return rig().channels.stands(); }))
        << "never given: " << toString(reason) << "; the truck's is " << status().reason_text;
    expectChannelsTell(reason, just_started);
  }

 private:
  static Rig* rig_;
};

Rig* Reasons::rig_ = nullptr;

// ---- the way up

TEST_F(Reasons, StartingUpWhileTheTruckIsNotHeard) {
  rig().wire.set(WireFault::kSilent);
  ASSERT_TRUE(spinUntil([] { return rig().channels.hearsArbiter(); }));
  expectToldAtOnce(
      Reason::kStartUp, [] { rig().bridge.startUnlessRunning(); }, true);
}

TEST_F(Reasons, NotEngagedOnceAllIsHealthy) {
  expectToldAtOnce(Reason::kNotEngaged, [] { rig().wire.set(WireFault::kNone); });
}

TEST_F(Reasons, DrivingAsAsked) {
  expectToldAtOnce(Reason::kNone, [] { drive(); });
}

// ---- the operator

TEST_F(Reasons, StoppedByTheOperator) {
  expectToldByBridge(Reason::kOperatorStop, [] { call("stop"); });
}

TEST_F(Reasons, ReleasedByTheOperator) {
  expectToldByBridge(Reason::kOperatorRelease, [] { call("release"); });
}

// ---- the lidar and what it sees

TEST_F(Reasons, NoValidTunnel) {
  expectToldByArbiter(Reason::kTunnelInvalid, [] { rig().lidar.set(View::kOpen); });
}

TEST_F(Reasons, NoLidarScan) {
  expectToldByArbiter(Reason::kScanStale, [] { rig().lidar.set(View::kDead); });
}

TEST_F(Reasons, LidarScansAreRejected) {
  expectToldByArbiter(Reason::kScanRejected, [] { rig().lidar.set(View::kBlind); });
}

TEST_F(Reasons, TheLidarRepeatsTheSameScan) {
  expectToldByArbiter(Reason::kScanFrozen, [] { rig().lidar.set(View::kFrozen); });
}

TEST_F(Reasons, ObstacleWithinTheStoppingDistance) {
  expectTold(Reason::kObstacle, {{"arbiter"}, [] { rig().lidar.set(View::kBox); }, [] {}, 1.5});
}

// ---- the truck and its bus

TEST_F(Reasons, TheSteeringDoesNotFollowItsCommand) {
  expectTold(Reason::kTrackingError,
             {{"arbiter", "can_bridge"}, [] { rig().wire.set(WireFault::kHingeElsewhere); }});
}

TEST_F(Reasons, NoFreshFramesFromTheTruck) {
  expectToldByBridge(Reason::kFeedbackStale, [] { rig().wire.set(WireFault::kSilent); });
}

TEST_F(Reasons, FramesFromTheTruckAreCorrupt) {
  expectToldByBridge(Reason::kFeedbackCorrupt, [] { rig().wire.set(WireFault::kCorrupt); });
}

TEST_F(Reasons, CanBusFault) {
  expectToldByBridge(Reason::kBusFault, [] { rig().wire.set(WireFault::kForeignSender); });
}

TEST_F(Reasons, TheTruckReportsAFault) {
  expectToldByBridge(Reason::kTruckFault, [] { rig().wire.set(WireFault::kTruckFault); });
}

TEST_F(Reasons, TheOperatorTookOver) {
  expectToldByBridge(Reason::kOperatorOverride, [] { rig().wire.set(WireFault::kOverride); });
}

// ---- clock and processes

TEST_F(Reasons, TheClockJumped) {
  ASSERT_TRUE(spinUntil([] { return rig().clock.getNumSubscribers() > 2; }));
  const auto pause = [](bool pauses) {
    std_srvs::SetBool request;
    request.request.data = pauses;
    ASSERT_TRUE(ros::service::call("simulator/pause", request));
  };
  // The simulator's clock stands; ours goes on a second earlier.
  rosgraph_msgs::Clock message;
  ros::WallTimer goes_on = rig().nh.createWallTimer(
      ros::WallDuration(0.01),
      [&](const ros::WallTimerEvent&) {
        message.clock += ros::Duration(0.01);
        rig().clock.publish(message);
      },
      false, false);
  Cause cause{{"can_bridge"}, [&] {
                pause(true);
                spinUntil([] { return false; }, 0.2);  // what was under way
                message.clock = ros::Time::now() - ros::Duration(1.0);
                goes_on.start();
              }};
  cause.end = [&] {
    goes_on.stop();
    pause(false);
  };
  expectTold(Reason::kClockJump, cause);
}

TEST_F(Reasons, NoFreshCommand) {
  const pid_t manager = processOf("/pilot_manager");
  ASSERT_GT(manager, 0);
  Cause cause{{"can_bridge"}, [&] { kill(manager, SIGSTOP); }};
  cause.end = [&] { kill(manager, SIGCONT); };
  expectTold(Reason::kCommandStale, cause);
}

// ---- the drivers. What the real ones do not do when asked is put in their place at the arbiter's
// input.

TEST_F(Reasons, LowConfidenceOfTheDriver) {
  ASSERT_TRUE(unload("lidar_driver"));
  expectToldOfPart(Reason::kLowConfidence, Part::kNone, Part::kUnsureLidarDriver);
}

TEST_F(Reasons, TheDriversDisagree) {
  expectToldOfPart(Reason::kDriversDisagree, Part::kLidarDriver, Part::kOtherLidarDriver);
}

TEST_F(Reasons, TheDriversProposalIsTooOld) {
  expectTold(Reason::kSourceStale, {{"arbiter"},
                                    [] { ASSERT_TRUE(unload("preview_driver")); },
                                    [] { loadUnlessLoaded("preview_driver"); }});
}

TEST_F(Reasons, NoHealthyDriver) {
  expectToldOfPart(Reason::kNoSource, Part::kBothDrivers, Part::kUnableDrivers);
}

TEST_F(Reasons, TheDriversProposalIsNotAPossibleCommand) {
  expectToldOfPart(Reason::kProposalInvalid, Part::kPreviewDriver, Part::kImpossiblePreviewDriver);
}

TEST_F(Reasons, LimitsHitAgainAndAgain) {
  expectToldOfPart(Reason::kLimitsHit, Part::kPreviewDriver, Part::kWildPreviewDriver);
}

// ---- processes that die

TEST_F(Reasons, NoMotionFeedbackOfADeadBridge) {
  rig().understudy.play(Part::kPreviewDriver);
  expectTold(
      Reason::kMotionStale,
      {{"arbiter"}, [] { rig().bridge.end(SIGKILL); }, [] { rig().bridge.startUnlessRunning(); }});
}

TEST_F(Reasons, AProcessOfThePilotIsSilent) {
  rig().bridge.end(SIGKILL);
  ros::param::set("can_bridge/heartbeats", std::vector<std::string>{"lidar_driver"});
  ros::param::set("can_bridge/heartbeat_timeout", 0.5);  // of steady time: this machine may be busy
  expectTold(Reason::kProcessSilent, {{"can_bridge"},
                                      [] { ASSERT_TRUE(unload("lidar_driver")); },
                                      [] {
                                        loadUnlessLoaded("preview_driver");
                                        loadUnlessLoaded("lidar_driver");
                                        rig().bridge.startUnlessRunning();
                                      }});
}

// Last, for a truck under way is not let off again. The walls are the real ones; the margin becomes
// wider than what is left beside the truck.
TEST_F(Reasons, TooLittleClearanceToAWall) {
  loadUnlessLoaded("lidar_driver");
  expectToldByArbiter(Reason::kClearance, [] {
    dynamic_reconfigure::Reconfigure tuning;
    tuning.request.config.doubles.resize(1);
    tuning.request.config.doubles[0].name = "envelope.margin";
    tuning.request.config.doubles[0].value = 1.4;  // [m]
    ASSERT_TRUE(ros::service::call("arbiter/set_parameters", tuning));
  });
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "reasons_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
