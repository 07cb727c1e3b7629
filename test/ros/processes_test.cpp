// A process of the pilot dies or hangs while a real-time truck drives: the truck is told to stop, or
// finds by itself that nobody commands it, within the limit; and it drives again only by the operator's
// hand. The truck is the simulator's, run by this program in steady time; every stage is a process of
// its own, or a nodelet of one manager as in pilot.launch.
#include <gtest/gtest.h>
#include <nodelet/NodeletLoad.h>
#include <poll.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tunnel_pilot/TruckStatus.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/simulation/simulator.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kStopped = 0.05;  // [m/s]

Stamp steadyNow() { return std::chrono::steady_clock::now().time_since_epoch(); }

// The truck, its lidar and its controller, in steady time.
class RealTimeTruck {
 public:
  RealTimeTruck(ros::NodeHandle nh, const std::string& bus)
      : bus_(bus), scan_(nh.advertise<sensor_msgs::LaserScan>("scan", 5)) {
    const std::string source = TUNNEL_PILOT_SOURCE_DIR;
    const auto scenario = simulation::loadScenario(source + "/scenarios/default_drift.yaml");
    const auto setup = simulation::loadSetup(scenario);
    simulator_ = std::make_unique<simulation::Simulator>(
        setup.simulator, setup.truck_controller, setup.truck,
        simulation::makePlant(scenario.plant, setup.truck, 1), scenario.plant.load,
        world::loadWorld(source + "/worlds/default_drift.yaml", {1, false}), 1, bus_);
    simulator_->place(simulator_->startPose());
    thread_ = std::thread([this] { live(); });
  }
  ~RealTimeTruck() {
    ends_ = true;
    thread_.join();
  }

  void backToStart() {
    const std::lock_guard<std::mutex> lock(mutex_);
    simulator_->place(simulator_->startPose());
  }
  double speed() const { return speed_; }
  /// When the controller last found that nobody commands it.
  Stamp gaveUpAt() const { return gave_up_at_; }

 private:
  void live() {
    const Stamp zero = steadyNow();
    const Stamp stamps_from = toCore(ros::Time::now());
    while (!ends_) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        while (simulator_->now() < steadyNow() - zero) step(stamps_from);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  void step(Stamp stamps_from) {
    using State = simulation::TruckController::State;
    const auto& events = simulator_->step();
    speed_ = simulator_->state().speed;
    const bool failed = simulator_->controller().state() == State::kFailed;
    if (failed && !failed_) gave_up_at_ = steadyNow();
    failed_ = failed;
    if (events.scan == nullptr) return;
    geometry::Scan scan = *events.scan;
    scan.stamp += stamps_from;
    scan_.publish(toRos(scan, "laser"));
  }

  can::EmbeddedBus bus_;
  ros::Publisher scan_;
  std::mutex mutex_;
  std::unique_ptr<simulation::Simulator> simulator_;
  bool failed_ = false;
  std::atomic<double> speed_{0.0};
  std::atomic<Stamp> gave_up_at_{Stamp{}};
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

// Listens on the bus for the pilot's stop bit.
class StopWatch {
 public:
  explicit StopWatch(const std::string& bus) : bus_(bus), thread_([this] { listen(); }) {}
  ~StopWatch() {
    ends_ = true;
    thread_.join();
  }
  /// First frame with the stop bit since arm(); zero: none yet.
  Stamp stoppedAt() const { return stopped_at_; }
  void arm() { stopped_at_ = Stamp{}; }

 private:
  void listen() {
    while (!ends_) {
      pollfd readable{bus_.descriptor(), POLLIN, 0};
      poll(&readable, 1, 20);
      while (const auto frame = bus_.receive()) {
        const auto command = can::decode<can::TruckCommandFrame>(*frame);
        if (command && command->stop && stopped_at_.load() == Stamp{}) stopped_at_ = steadyNow();
      }
    }
  }

  can::EmbeddedBus bus_;
  std::atomic<Stamp> stopped_at_{Stamp{}};
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

const std::vector<std::string> kStages = {"scan_filter",    "wall_segmentation", "centerline",
                                          "preview_driver", "lidar_driver",      "arbiter"};

class RealTimeDrive : public ::testing::Test {
 protected:
  RealTimeDrive() : truck_(nh_, busName()), watch_(busName()) {
    status_subscriber_ = nh_.subscribe<TruckStatus>(
        "truck_status", 10, [this](const TruckStatus::ConstPtr& m) { status_ = *m; });
  }
  ~RealTimeDrive() override {
    while (!children_.empty()) end(children_.begin()->first, SIGKILL);
  }

  static std::string busName() { return ros::param::param<std::string>("/can_bridge/bus", ""); }

  void start(const std::string& name, std::vector<std::string> command) {
    command.push_back("__name:=" + name);
    std::vector<char*> arguments;
    for (std::string& word : command) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const pid_t child = fork();
    if (child == 0) {
      execvp(arguments.front(), arguments.data());
      _exit(127);
    }
    children_[name] = child;
  }
  void startNode(const std::string& stage) {
    start(stage, {std::string(TUNNEL_PILOT_NODE_FOLDER) + "/" + stage});
  }

  void end(const std::string& stage, int signal) {
    const auto child = children_.find(stage);
    if (child == children_.end()) return;
    kill(child->second, signal);
    waitpid(child->second, nullptr, 0);
    children_.erase(child);
  }

  static bool call(const std::string& service) {
    std_srvs::Trigger trigger;
    return ros::service::call(service, trigger) && trigger.response.success;
  }

  bool spinUntil(const std::function<bool()>& done, double seconds) {
    const Stamp end = steadyNow() + fromSeconds(seconds);
    while (steadyNow() < end && ros::ok()) {
      ros::spinOnce();
      if (done()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }

  bool driving() const { return status_.state == TruckStatus::STATE_ACTIVE && truck_.speed() > 1.0; }

  // From wherever the stop before has left it. A busy machine may make a process late, which stops, too:
  // then once more.
  void drive() {
    ASSERT_TRUE(spinUntil([this] { return truck_.speed() < kStopped; }, 20.0));
    truck_.backToStart();
    Stamp next{};
    ASSERT_TRUE(spinUntil(
        [&] {
          if (driving()) return true;
          if (steadyNow() < next) return false;
          next = steadyNow() + std::chrono::milliseconds(100);
          if (status_.state == TruckStatus::STATE_STOPPED) call("reset");
          if (status_.state == TruckStatus::STATE_STANDBY) call("engage");
          return false;
        },
        60.0))
        << "state " << static_cast<int>(status_.state) << ": " << status_.reason_text;
  }

  /// From the signal until the truck has a stop, or gives up [s].
  double stopAfter(const std::string& stage, int signal) {
    watch_.arm();
    const Stamp before = steadyNow();
    kill(children_.at(stage), signal);
    const auto told = [&] { return std::max(watch_.stoppedAt(), truck_.gaveUpAt()) > before; };
    spinUntil(told, 3.0);
    const Stamp gave_up = truck_.gaveUpAt();
    Stamp stop = watch_.stoppedAt();
    if (stop == Stamp{} || (gave_up > before && gave_up < stop)) stop = gave_up;
    return told() ? toSeconds(stop - before) : 1e9;
  }

  void expectNoReturn() {
    spinUntil([] { return false; }, 1.5);
    EXPECT_FALSE(driving());
  }

  void tell(const std::string& stage, const char* what, const std::vector<double>& latencies) {
    std::vector<double> sorted = latencies;
    std::sort(sorted.begin(), sorted.end());
    std::printf("  %-18s %-8s median %5.1f ms, worst %5.1f ms of %zu\n", stage.c_str(), what,
                1e3 * sorted[sorted.size() / 2], 1e3 * sorted.back(), sorted.size());
    std::fflush(stdout);
  }

  int times_ = ros::param::param("~times", 1);
  double limit_ = ros::param::param("~limit", 0.16);  // [s]
  ros::NodeHandle nh_;
  RealTimeTruck truck_;
  StopWatch watch_;
  TruckStatus status_;
  ros::Subscriber status_subscriber_;
  std::map<std::string, pid_t> children_;
};

class Processes : public RealTimeDrive {
 protected:
  Processes() {
    for (const std::string& stage : stages()) startNode(stage);
  }

  static std::vector<std::string> stages() {
    std::vector<std::string> all = kStages;
    all.emplace_back("can_bridge");
    return all;
  }
};

class NodeletManager : public RealTimeDrive {
 protected:
  NodeletManager() {
    startNode("can_bridge");
    startManager();
  }

  void startManager() {
    start(kManager, {"rosrun", "nodelet", "nodelet", "manager"});
    const std::string service = std::string(kManager) + "/load_nodelet";
    ASSERT_TRUE(spinUntil([&] { return ros::service::exists(service, false); }, 20.0));
    for (const std::string& stage : kStages) {
      nodelet::NodeletLoad load;
      load.request.name = "/" + stage;
      load.request.type = "tunnel_pilot/" + stage;
      ASSERT_TRUE(ros::service::call(service, load) && load.response.success) << stage;
    }
  }

  static constexpr const char* kManager = "pilot_manager";
};

TEST_F(Processes, EachThatIsKilledStopsTheTruck) {
  for (const std::string& stage : stages()) {
    std::vector<double> latencies;
    for (int i = 0; i < times_; ++i) {
      ASSERT_NO_FATAL_FAILURE(drive()) << "before " << stage;
      latencies.push_back(stopAfter(stage, SIGKILL));
      EXPECT_LE(latencies.back(), limit_) << stage;
      end(stage, SIGKILL);
      startNode(stage);
    }
    tell(stage, "killed", latencies);
  }
  expectNoReturn();
}

TEST_F(Processes, EachThatHangsStopsTheTruckAndItsReturnDoesNotDrive) {
  for (const std::string& stage : stages()) {
    std::vector<double> latencies;
    for (int i = 0; i < times_; ++i) {
      ASSERT_NO_FATAL_FAILURE(drive()) << "before " << stage;
      latencies.push_back(stopAfter(stage, SIGSTOP));
      EXPECT_LE(latencies.back(), limit_) << stage;
      spinUntil([] { return false; }, 0.2);
      kill(children_.at(stage), SIGCONT);
      expectNoReturn();
    }
    tell(stage, "hung", latencies);
  }
}

TEST_F(NodeletManager, KilledStopsTheTruck) {
  std::vector<double> latencies;
  for (int i = 0; i < times_; ++i) {
    ASSERT_NO_FATAL_FAILURE(drive());
    latencies.push_back(stopAfter(kManager, SIGKILL));
    EXPECT_LE(latencies.back(), limit_);
    end(kManager, SIGKILL);
    ASSERT_NO_FATAL_FAILURE(startManager());
  }
  tell(kManager, "killed", latencies);
  expectNoReturn();
}

TEST_F(NodeletManager, HungStopsTheTruckAndItsReturnDoesNotDrive) {
  std::vector<double> latencies;
  for (int i = 0; i < times_; ++i) {
    ASSERT_NO_FATAL_FAILURE(drive());
    latencies.push_back(stopAfter(kManager, SIGSTOP));
    EXPECT_LE(latencies.back(), limit_);
    spinUntil([] { return false; }, 0.2);
    kill(children_.at(kManager), SIGCONT);
    expectNoReturn();
  }
  tell(kManager, "hung", latencies);
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "processes");
  ros::NodeHandle keeps_ros_up;
  return RUN_ALL_TESTS();
}
