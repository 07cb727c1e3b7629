// ros_campaign: the simulator's truck in lockstep with the pilot's own nodes, against seeded faults on
// their topics, services, clock and processes. Writes the bus and the log of events for the independent
// monitor.
#include <dynamic_reconfigure/Reconfigure.h>
#include <nav_msgs/Odometry.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <poll.h>
#include <ros/callback_queue.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tunnel_pilot/Heartbeat.h>
#include <tunnel_pilot/LoadNetwork.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/TunnelState.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/can/log_writer.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/simulation/simulator.h"

namespace tunnel_pilot::shell {
namespace {

constexpr Stamp kClockPeriod = std::chrono::milliseconds(10);
constexpr Stamp kFramePeriod = std::chrono::milliseconds(20);
constexpr Stamp kStart = std::chrono::seconds(1000);  // of the simulated clock
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ros::SteadyTime steadyIn(double seconds) { return ros::SteadyTime::now() + ros::WallDuration(seconds); }

/// The truck's end of the embedded bus. Every frame goes into the log with the simulated time at which
/// it was sent or taken in. A thread fetches what comes: the kernel keeps eleven datagrams and no more,
/// and while the campaign waits for a service the bridge may say more than that.
class LoggedBus : public can::Bus {
 public:
  LoggedBus(const std::string& name, can::LogWriter& log)
      : wire_(name), log_(log), fetcher_([this] { fetch(); }) {}
  ~LoggedBus() override {
    ends_ = true;
    fetcher_.join();
  }

  void setTime(Stamp now) { now_ = now; }
  bool send(const can::Frame& frame) override {
    log_.frame(frame, now_);
    return wire_.send(frame);
  }
  std::optional<can::Frame> receive() override {
    pump();
    if (waiting_.empty()) return std::nullopt;
    const can::Frame frame = waiting_.front();
    waiting_.pop_front();
    return frame;
  }
  std::uint64_t confirmed() const override { return wire_.confirmed(); }
  can::BusState state() const override { return wire_.state(); }
  int descriptor() const override { return wire_.descriptor(); }

  /// Takes in what waits; TP_STATUS ends a set of the pilot's.
  void pump() {
    std::deque<can::Frame> frames;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      frames.swap(fetched_);
    }
    for (const can::Frame& frame : frames) {
      log_.frame(frame, now_);
      waiting_.push_back(frame);
      if (const auto command = can::decode<can::TruckCommandFrame>(frame)) stop_told_ = command->stop;
      if (const auto status = can::decode<can::BridgeStatusFrame>(frame)) {
        drives_ =
            status->state == TruckStatus::STATE_ACTIVE || status->state == TruckStatus::STATE_DEGRADED;
        last_set_ = now_ - now_ % kClockPeriod;  // by the bridge's clock
      }
    }
  }
  void awaitFrames(std::chrono::milliseconds longest) {
    std::unique_lock<std::mutex> lock(mutex_);
    arrival_.wait_for(lock, longest, [this] { return !fetched_.empty(); });
  }
  Stamp lastSet() const { return last_set_; }
  /// By the pilot's last frames it drives, and no stop is told.
  bool drivesOn() const { return drives_ && !stop_told_; }
  std::uint64_t dropped() const { return wire_.dropped(); }

 private:
  void fetch() {
    while (!ends_) {
      pollfd readable{wire_.descriptor(), POLLIN, 0};
      poll(&readable, 1, 20);
      const std::lock_guard<std::mutex> lock(mutex_);
      while (const auto frame = wire_.receive()) fetched_.push_back(*frame);
      if (!fetched_.empty()) arrival_.notify_all();
    }
  }

  can::EmbeddedBus wire_;
  can::LogWriter& log_;
  std::deque<can::Frame> waiting_;
  Stamp now_{}, last_set_{};
  bool stop_told_ = false, drives_ = false;
  std::mutex mutex_;  // of what was fetched
  std::condition_variable arrival_;
  std::deque<can::Frame> fetched_;
  std::atomic<bool> ends_{false};
  std::thread fetcher_;
};

/// can_bridge as a process of the campaign's own, which it kills and holds up.
class BridgeProcess {
 public:
  ~BridgeProcess() { kill(); }
  void start() {
    pid_ = fork();
    if (pid_ != 0) return;
    const std::string program = std::string(TUNNEL_PILOT_NODE_FOLDER) + "/can_bridge";
    execl(program.c_str(), program.c_str(), "__name:=can_bridge", nullptr);
    _exit(127);
  }
  void kill() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  void hold(bool on) { ::kill(pid_, on ? SIGSTOP : SIGCONT); }

 private:
  pid_t pid_ = -1;
};

/// What was injected, and what came of it.
struct Record {
  std::map<std::string, long> kinds, states, stops;
  long injections = 0, bursts = 0, engaged = 0, late_sets = 0, edges_lost = 0;
  std::string bad_frame;  ///< the one that the bad sender sends, as it stands in the log
};

class Campaign {
 public:
  Campaign(ros::NodeHandle nh, ros::NodeHandle own)
      : log_file_(own.param<std::string>("log", "/dev/null")),
        log_(log_file_),
        bus_(own.param<std::string>("bus", "rosc"), log_),
        random_(static_cast<std::uint64_t>(own.param("seed", 1)), simulation::Stream::kFaults),
        target_(own.param("injections", 1000)),
        bad_sender_(own.param("bad_sender", false)),
        end_(steadyIn(60.0 * own.param("minutes", 1e6))),
        report_(own.param<std::string>("report", "/dev/null")) {
    buildTruck();
    advertise(nh);
    plan();
    log_.event("start", now());
    log_.event("clock 0", now());
    bridge_.start();
  }

  void run() {
    const ros::SteadyTime began = ros::SteadyTime::now();
    while (ros::ok() && record_.injections < target_ && ros::SteadyTime::now() < end_) {
      advance();
      if (simulator_->now() % kClockPeriod != Stamp::zero()) continue;
      operate();
      misbehave();
    }
    calm();
    write((ros::SteadyTime::now() - began).toSec());
  }

 private:
  using State = TruckStatus;
  /// One way to misbehave: `per_tick` times a tick of 10 ms at most while the burst lasts.
  struct Fault {
    std::string name;
    int per_tick;
    std::function<void()> inject;
    double weight = 1.0;
  };

  // -------- the truck and its world

  void buildTruck() {
    const std::string source = TUNNEL_PILOT_SOURCE_DIR;
    const auto scenario = simulation::loadScenario(source + "/scenarios/default_drift.yaml");
    const auto setup = simulation::loadSetup(scenario);
    simulator_ = std::make_unique<simulation::Simulator>(
        setup.simulator, setup.truck_controller, setup.truck,
        simulation::makePlant(scenario.plant, setup.truck, 1), scenario.plant.load,
        world::loadWorld(source + "/worlds/default_drift.yaml", {1, false}), 1, bus_);
    simulator_->place(simulator_->startPose());
  }

  Stamp now() const { return kStart + simulator_->now(); }

  void advance() {
    bus_.setTime(now() + fromSeconds(simulator_->parameters().step));
    const auto& events = simulator_->step();
    const bool tick = simulator_->now() % kClockPeriod == Stamp::zero();
    if (tick) publishClock(now());  // and at no other time: the bridge's periods begin with its ticks
    if (events.scan != nullptr) {
      geometry::Scan scan = *events.scan;
      scan.stamp += kStart;
      deliver(toRos(scan, "laser"));
    }
    if (tick) awaitBridge();
  }

  void publishClock(Stamp time) {
    rosgraph_msgs::Clock clock;
    clock.clock = toRos(time);
    clock_.publish(clock);
  }

  // Time stands still until the bridge has said what is due, and has stopped when the arbiter has asked
  // it to, so that the machine's load changes nothing. Who has not come up yet is not waited for.
  void awaitBridge() {
    ros::getGlobalCallbackQueue()->callAvailable();
    bus_.pump();
    if (bus_.lastSet() == Stamp{}) {
      ros::WallDuration(0.002).sleep();
      return;
    }
    const ros::SteadyTime limit = steadyIn(1.0);
    while ((now() - bus_.lastSet() >= kFramePeriod || owesStop()) && ros::ok()) {
      bus_.awaitFrames(std::chrono::milliseconds(2));
      bus_.pump();
      ros::getGlobalCallbackQueue()->callAvailable();
      if (ros::SteadyTime::now() > limit) {
        ++record_.late_sets;
        ROS_WARN("in vain: the bridge's last set %.3f s ago%s, %s", toSeconds(now() - bus_.lastSet()),
                 stop_asked_ ? ", a stop asked for" : "", status_.reason_text.c_str());
        stop_asked_ = false;
        return;
      }
    }
  }

  bool owesStop() {
    if (!bus_.drivesOn()) stop_asked_ = false;
    return stop_asked_;
  }

  // The pilot's answer to a good scan. Who does not answer in time has less and less of it: 20 ms for
  // each scan.
  void awaitCommand(ros::Time stamp) {
    patience_ = std::min(patience_ + 0.02, 0.3);
    const ros::SteadyTime began = ros::SteadyTime::now();
    while (command_.header.stamp < stamp &&
           ros::SteadyTime::now() < began + ros::WallDuration(patience_)) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.002));
      bus_.pump();
    }
    const bool answered = command_.header.stamp >= stamp;
    patience_ = answered ? 0.3 : patience_ - (ros::SteadyTime::now() - began).toSec();
  }

  void onCommand(const ros::MessageEvent<TruckCommand const>& event) {
    if (event.getPublisherName() == ros::this_node::getName()) return;
    command_ = *event.getMessage();
    if (!command_.stop) return;
    log_.event("command_stop", now());
    stop_asked_ = true;
  }

  void onStatus(const TruckStatus& status) {
    if (status.state == State::STATE_STOPPING && status_.state != State::STATE_STOPPING) {
      ++record_.stops[status.reason_text];
    }
    if (status.state == State::STATE_ACTIVE && status_.state != State::STATE_ACTIVE) ++record_.engaged;
    status_ = status;
  }

  // -------- the operator, who means well

  void operate() {
    if (bursting() || ++operator_ticks_ % 10 != 0) return;
    if (status_.state == State::STATE_STOPPED) edge("reset", true);
    if (status_.state == State::STATE_STANDBY) edge("engage", true);
    // Somewhere it cannot go on from: it is towed back, which the pilot sees as the truck's fault.
    if (now() - burst_ended_ > std::chrono::seconds(8) && now() - towed_ > std::chrono::seconds(8)) {
      towed_ = now();
      if (status_.state != State::STATE_ACTIVE) simulator_->place(simulator_->startPose());
    }
  }

  // A stop counts from when it was asked for, the other edges from when they were accepted.
  bool edge(const std::string& name, bool counts_when_accepted) {
    if (!ros::service::exists(name, false)) {
      ++record_.edges_lost;
      return false;
    }
    if (!counts_when_accepted) log_.event(name, now());
    std_srvs::Trigger trigger;
    const bool answered = ros::service::call(name, trigger);
    bus_.pump();
    if (!answered || !trigger.response.success) return false;
    if (counts_when_accepted) log_.event(name, now());
    return true;
  }

  // -------- faults, in bursts

  bool bursting() const { return now() < burst_until_; }

  void misbehave() {
    if (bursting()) {
      for (Fault* fault : burst_) {
        if (fault->name == "clock jump") {  // counts itself
          fault->inject();
          continue;
        }
        const int times = 1 + below(fault->per_tick);
        for (int i = 0; i < times; ++i) count(*fault);
      }
      return;
    }
    if (burst_until_ != Stamp{} && !calm_) calm();
    // Once it drives, after a while; and at last where it does not come to drive.
    const bool drives = status_.state == State::STATE_ACTIVE || status_.state == State::STATE_DEGRADED;
    drove_since_ = drives ? (drove_since_ == Stamp{} ? now() : drove_since_) : Stamp{};
    const bool due = drives && now() - drove_since_ > drive_for_;
    if (due || now() - burst_ended_ > std::chrono::seconds(16)) begin();
  }

  void begin() {
    ++record_.bursts;
    calm_ = false;
    burst_until_ = now() + fromSeconds(0.02 + 0.8 * random_.uniform() * random_.uniform());
    drive_for_ = fromSeconds(1.5 * random_.uniform());
    burst_.clear();
    scan_fault_.clear();
    const int kinds = 1 + below(3);
    for (int i = 0; i < kinds; ++i) burst_.push_back(&pick());
    if (random_.uniform() < 0.3) scan_fault_ = scanFaults()[index(scanFaults().size())];
    if (random_.uniform() < 0.03) processFault();
    if (bad_sender_) sendBad();
  }

  Fault& pick() {
    double total = 0.0;
    for (const Fault& fault : faults_) total += fault.weight;
    double left = random_.uniform() * total;
    for (Fault& fault : faults_) {
      left -= fault.weight;
      if (left < 0.0) return fault;
    }
    return faults_.back();
  }

  void calm() {
    calm_ = true;
    burst_ended_ = now();
    scan_fault_.clear();
    if (manager_held_ > 0) kill(manager_held_, SIGCONT);
    manager_held_ = 0;
    if (!unloaded_.empty()) loadAgain();
  }

  void count(const Fault& fault) {
    tally(fault.name);
    fault.inject();
  }
  void tally(const std::string& name) {
    static const char* const kStates[] = {"INIT",     "STANDBY",  "ARMED",  "ACTIVE",
                                          "DEGRADED", "STOPPING", "STOPPED"};
    ++record_.injections;
    ++record_.kinds[name];
    ++record_.states[kStates[std::min<int>(status_.state, 6)]];
  }

  // -------- values

  double uniform() { return random_.uniform(); }
  int below(int count) { return std::min(static_cast<int>(uniform() * count), count - 1); }
  std::size_t index(std::size_t count) {
    return static_cast<std::size_t>(below(static_cast<int>(count)));
  }
  double odd() {
    static const double kOdd[] = {kNan,
                                  std::numeric_limits<double>::infinity(),
                                  -std::numeric_limits<double>::infinity(),
                                  1e300,
                                  -1e9,
                                  12.0,
                                  -7.0};
    return kOdd[below(7)];
  }
  ros::Time oddStamp() {
    static const double kOffsets[] = {-900.0, -5.0, -0.5, -0.2, 0.06, 0.3, 5.0, 1e5};
    return toRos(now() + fromSeconds(kOffsets[below(8)]));
  }
  ros::Time goodStamp() const { return toRos(now() - std::chrono::milliseconds(50)); }

  // -------- scans

  static const std::vector<std::string>& scanFaults() {
    static const std::vector<std::string> all = {
        "scan, beams not finite", "scan, wrong geometry", "scan, frozen",
        "scan, old stamp",        "scan, stamp ahead",    "scan, repeated",
        "scan, withheld",         "scan, another frame",  "scan, few of its beams"};
    return all;
  }

  void deliver(sensor_msgs::LaserScan scan) {
    const sensor_msgs::LaserScan good = scan;
    if (scan_fault_.empty() || last_scan_.ranges.empty()) {
      good_scan(scan);
      return;
    }
    tally(scan_fault_);
    if (scan_fault_ == "scan, withheld") return;
    if (scan_fault_ == "scan, repeated") {
      good_scan(scan);
      scan_.publish(scan);
      return;
    }
    spoil(scan_fault_, scan);
    scan_.publish(scan);
  }

  void good_scan(const sensor_msgs::LaserScan& scan) {
    last_scan_ = scan;
    const std::string age = " " + std::to_string(1e3 * (toRos(now()) - scan.header.stamp).toSec());
    for (const char* source : {"preview_driver", "lidar_driver"}) {
      log_.event(std::string("measurement ") + source + age, now());
    }
    scan_.publish(scan);
    awaitCommand(scan.header.stamp);
  }

  // Spoilt so that no measurement is left in it that may be driven on.
  void spoil(const std::string& how, sensor_msgs::LaserScan& scan) {
    if (how == "scan, beams not finite") {
      for (float& range : scan.ranges) range = uniform() < 0.95 ? static_cast<float>(odd()) : range;
    } else if (how == "scan, wrong geometry") {
      spoilGeometry(scan);
    } else if (how == "scan, frozen") {
      scan.ranges = last_scan_.ranges;
    } else if (how == "scan, old stamp") {
      scan.header.stamp -= ros::Duration(0.2 + 5.0 * uniform());
    } else if (how == "scan, stamp ahead") {
      scan.header.stamp += ros::Duration(0.15 + 5.0 * uniform());
    } else if (how == "scan, another frame") {
      scan.header.frame_id = below(2) == 0 ? "" : "base_link";
    } else {
      scan.ranges.resize(index(scan.ranges.size() / 2));
    }
  }

  void spoilGeometry(sensor_msgs::LaserScan& scan) {
    switch (below(6)) {
      case 0:
        scan.angle_increment = static_cast<float>(odd());
        break;
      case 1:
        scan.angle_min = static_cast<float>(odd());
        break;
      case 2:
        scan.range_max = below(2) == 0 ? -1.0F : static_cast<float>(kNan);
        break;
      case 3:
        scan.ranges.assign(100000, 3.0F);
        break;
      case 4:
        scan.ranges.clear();
        break;
      default:
        scan.angle_increment *= 0.5F;
        break;
    }
  }

  void scanBeside() {
    if (last_scan_.ranges.empty()) return;
    sensor_msgs::LaserScan scan = last_scan_;
    scan.header.stamp = goodStamp();
    const char* kinds[] = {"scan, beams not finite", "scan, wrong geometry", "scan, old stamp",
                           "scan, stamp ahead", "scan, another frame"};
    spoil(kinds[below(5)], scan);
    scan_.publish(scan);
  }

  // -------- everything else

  void advertise(ros::NodeHandle& nh) {
    clock_ = nh.advertise<rosgraph_msgs::Clock>("/clock", 100);
    scan_ = nh.advertise<sensor_msgs::LaserScan>("scan", 20);
    odom_ = nh.advertise<nav_msgs::Odometry>("odom", 100);
    joints_ = nh.advertise<sensor_msgs::JointState>("joint_states", 100);
    rogue_status_ = nh.advertise<TruckStatus>("truck_status", 100);
    tunnel_ = nh.advertise<TunnelState>("tunnel_state", 100);
    heartbeat_ = nh.advertise<Heartbeat>("heartbeat", 100);
    for (const char* driver : {"preview_driver", "lidar_driver", "teleoperation"}) {
      proposals_.push_back(nh.advertise<Proposal>(std::string(driver) + "/proposal", 100));
    }
    nh_ = nh;
    const auto hints = ros::TransportHints().tcpNoDelay();
    subscribers_.push_back(nh.subscribe("command", 50, &Campaign::onCommand, this, hints));
    subscribers_.push_back(nh.subscribe<TruckStatus>(
        "truck_status", 50,
        [this](const ros::MessageEvent<TruckStatus const>& event) {
          if (event.getPublisherName() != ros::this_node::getName()) onStatus(*event.getMessage());
        },
        ros::VoidConstPtr(), hints));
  }

  void plan() {
    faults_ = {{"scan beside the good ones", 3, [this] { scanBeside(); }},
               {"odom", 6, [this] { rogueOdometry(); }},
               {"joint_states", 6, [this] { rogueJoints(); }},
               {"proposal", 6, [this] { rogueProposal(); }},
               {"truck_status", 4, [this] { rogueStatus(); }},
               {"tunnel_state", 4, [this] { rogueTunnel(); }},
               {"heartbeat", 6, [this] { rogueHeartbeat(); }},
               {"command of a second publisher", 6, [this] { rogueCommand(); }, 0.5},
               {"call: engage, release, stop, reset", 1, [this] { anyEdge(); }, 0.7},
               {"call: load_network, a bad file", 1, [this] { badNetwork(); }, 0.5},
               {"call: arbiter/set_parameters", 1, [this] { oddTuning(); }, 0.5},
               {"call: arbiter/use", 1, [this] { use(); }, 0.5},
               {"clock jump", 1, [this] { jumpClock(); }, 0.3},
               {"simulator paused", 1, [] { ros::WallDuration(0.005).sleep(); }, 0.3}};
  }

  void rogueOdometry() {
    nav_msgs::Odometry message;
    message.header.frame_id = below(3) == 0 ? "map" : "odom";
    message.header.stamp = below(2) == 0 ? oddStamp() : goodStamp();
    message.pose.pose.orientation.w = below(3) == 0 ? odd() : 1.0;
    message.pose.pose.position.x = below(2) == 0 ? odd() : 0.0;
    message.twist.twist.linear.x = below(2) == 0 ? odd() : 3.0;
    message.twist.twist.angular.z = below(2) == 0 ? odd() : 0.0;
    odom_.publish(message);
  }

  void rogueJoints() {
    sensor_msgs::JointState message;
    message.header.stamp = below(2) == 0 ? oddStamp() : goodStamp();
    const std::size_t size = below(20) == 0 ? 20000 : index(4);
    message.name.assign(size, "articulation_joint");
    message.position.assign(below(3) == 0 ? index(4) : size, odd());
    message.velocity.assign(below(3) == 0 ? index(4) : size, odd());
    joints_.publish(message);
  }

  void rogueProposal() {
    Proposal message;
    message.header.stamp = oddStamp();
    message.header.frame_id = "base_link";
    message.valid = below(4) != 0;
    message.articulation_angle = odd();
    message.speed = below(2) == 0 ? odd() : 5.0;
    message.confidence = below(2) == 0 ? odd() : 1.0;
    if (below(3) == 0) message.header.stamp = goodStamp();  // then the angle alone is impossible
    if (below(20) == 0) message.outputs.assign(20000, static_cast<float>(kNan));
    proposals_[index(3)].publish(message);
  }

  void rogueStatus() {
    TruckStatus message = status_;
    message.header.stamp = below(2) == 0 ? oddStamp() : toRos(now());
    message.state = static_cast<std::uint8_t>(below(256));
    message.reason = static_cast<std::uint8_t>(below(256));
    message.feedback_age = odd();
    rogue_status_.publish(message);
  }

  void rogueTunnel() {
    TunnelState message;
    message.header.stamp = below(2) == 0 ? oddStamp() : goodStamp();
    message.valid = below(2) == 0;
    tunnel_.publish(message);
  }

  void rogueHeartbeat() {
    static const char* const kNames[] = {"/arbiter", "", "/nobody", "/can_bridge"};
    Heartbeat message;
    message.node = kNames[below(4)];
    if (below(10) == 0) message.node.assign(20000, 'x');
    message.sequence = static_cast<std::uint32_t>(below(1000000));
    heartbeat_.publish(message);
  }

  // Only now and then there: who has advertised a topic but is silent is no second publisher.
  void rogueCommand() {
    if (!rogue_command_) rogue_command_ = nh_.advertise<TruckCommand>("command", 100);
    TruckCommand message = command_;
    message.sequence = below(2) == 0 ? command_.sequence / 2 : command_.sequence + 1;
    message.header.stamp = below(2) == 0 ? oddStamp() : toRos(now());
    message.articulation_angle = below(2) == 0 ? odd() : 0.7 * (2.0 * uniform() - 1.0);
    message.speed = below(2) == 0 ? odd() : 9.0 * uniform();
    message.acceleration = below(2) == 0 ? odd() : 1.0;
    message.stop = below(4) == 0;
    message.source = static_cast<std::uint8_t>(below(256));
    // A lie about a driver's fresh measurement cannot be found: against it, the publisher is pinned.
    const bool names_driver = message.source == TruckCommand::SOURCE_LIDAR_DRIVER ||
                              message.source == TruckCommand::SOURCE_PREVIEW_DRIVER;
    if (names_driver) message.source = TruckCommand::SOURCE_TELEOPERATION;
    message.reason = static_cast<std::uint8_t>(below(256));
    rogue_command_.publish(message);
  }

  void anyEdge() {
    static const char* const kEdges[] = {"engage", "release", "stop", "reset"};
    const int which = below(4);
    edge(kEdges[which], which == 0 || which == 3);
  }

  void badNetwork() {
    static const char* const kFiles[] = {"/nowhere", "/dev/zero", "/etc/passwd", "", "/tmp", "relative"};
    LoadNetwork load;
    load.request.file = kFiles[below(6)];
    if (ros::service::exists("lidar_driver/load_network", false) && manager_held_ == 0) {
      ros::service::call("lidar_driver/load_network", load);
      if (load.response.success)
        throw std::runtime_error("a bad network was loaded: " + load.request.file);
    }
  }

  void oddTuning() {
    dynamic_reconfigure::Reconfigure call;
    dynamic_reconfigure::DoubleParameter value;
    value.name = below(3) == 0 ? "nothing.such" : "governor.max_speed";
    value.value = below(4) == 0 ? 3.0 : odd();
    call.request.config.doubles.push_back(value);
    if (ros::service::exists("arbiter/set_parameters", false) && manager_held_ == 0) {
      ros::service::call("arbiter/set_parameters", call);
    }
  }

  void use() {
    std_srvs::Trigger trigger;
    const std::string name =
        std::string("arbiter/use/") + (below(2) == 0 ? "lidar" : "preview") + "_driver";
    if (ros::service::exists(name, false) && manager_held_ == 0) ros::service::call(name, trigger);
  }

  // Once a burst: in simulated time the bridge has no other clock to count its frames by.
  void jumpClock() {
    if (jumped_ == burst_until_) return;
    jumped_ = burst_until_;
    tally("clock jump");
    static const double kOffsets[] = {-900.0, -3.0, -0.05, -0.011, 0.05, 0.9, 1.5, 500.0};
    publishClock(now() + fromSeconds(kOffsets[below(8)]));
    ros::WallDuration(0.002).sleep();
    bus_.pump();
  }

  // -------- processes

  void processFault() {
    switch (below(4)) {
      case 0:
        tally("process: bridge killed and started again");
        bridge_.kill();
        bus_.pump();
        log_.event("start", now());
        bridge_.start();
        restarting();
        return;
      case 1:
        tally("process: bridge held up");
        holdBridge();
        return;
      case 2:
        tally("process: the nodelets' manager held up");
        manager_held_ = manager();
        if (manager_held_ > 0) kill(manager_held_, SIGSTOP);
        return;
      default: {
        static const char* const kStages[] = {"scan_filter",    "wall_segmentation", "centerline",
                                              "preview_driver", "lidar_driver",      "arbiter"};
        tally("process: a nodelet unloaded and loaded again");
        unloaded_ = kStages[below(6)];
        nodelet::NodeletUnload unload;
        unload.request.name = "/" + unloaded_;
        ros::service::call("pilot_manager/unload_nodelet", unload);
      }
    }
  }

  // Meanwhile no clock is published: a process with a clock of its own finds it later when it goes on,
  // once, and does not live through what it missed. It knows the time, too, before anybody tells it
  // anything; here the arbiter, whom the same message tells, could be quicker with a stop than it is.
  void holdBridge() {
    const pid_t nodelets = manager();
    bridge_.hold(true);
    const Stamp until = now() + fromSeconds(0.02 + 0.4 * uniform());
    while (now() < until || now() % kClockPeriod != Stamp::zero()) {
      bus_.setTime(now() + fromSeconds(simulator_->parameters().step));
      simulator_->step();
    }
    if (nodelets > 0) kill(nodelets, SIGSTOP);
    bridge_.hold(false);
    publishClock(now());
    awaitBridge();
    if (nodelets > 0) kill(nodelets, SIGCONT);
  }

  // The truck is alone for a while, in simulated time, then the new bridge speaks and is waited for
  // again.
  void restarting() {
    status_ = TruckStatus();
    const ros::SteadyTime limit = steadyIn(20.0);
    const Stamp before = bus_.lastSet();
    while (ros::ok() && bus_.lastSet() == before && ros::SteadyTime::now() < limit) {
      bus_.setTime(now() + fromSeconds(simulator_->parameters().step));
      simulator_->step();
      if (simulator_->now() % kClockPeriod != Stamp::zero()) continue;
      publishClock(now());
      ros::WallDuration(0.01).sleep();
      ros::getGlobalCallbackQueue()->callAvailable();
    }
    burst_until_ = now();
  }

  void loadAgain() {
    nodelet::NodeletLoad load;
    load.request.name = "/" + unloaded_;
    load.request.type = "tunnel_pilot/" + unloaded_;
    ros::service::call("pilot_manager/load_nodelet", load);
    unloaded_.clear();
  }

  static pid_t manager() {
    XmlRpc::XmlRpcValue call, answer, uri;
    call[0] = ros::this_node::getName();
    call[1] = "/pilot_manager";
    std::string host;
    std::uint32_t port = 0;
    if (!ros::master::execute("lookupNode", call, answer, uri, false) ||
        !ros::network::splitURI(uri, host, port)) {
      return 0;
    }
    XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
    XmlRpc::XmlRpcValue caller;
    caller[0] = ros::this_node::getName();
    return client.execute("getPid", caller, answer) ? static_cast<int>(answer[2]) : 0;
  }

  // Steering with a wrong CRC, from somebody else on the bus, whom no log of events announces: the
  // monitor must find it.
  void sendBad() {
    if (!bad_wire_)
      bad_wire_ = std::make_unique<can::EmbeddedBus>(nh_.param<std::string>("can_bridge/bus", ""));
    can::TruckCommandFrame command{};
    command.steering_enable = true;
    command.articulation_angle = 0.5;
    const can::Frame frame = *can::encode(command);
    bad_wire_->send(frame);
    record_.bad_frame = can::toText(frame);
  }

  void write(double seconds) {
    std::ofstream out(report_);
    const auto map = [&out](const char* name, const std::map<std::string, long>& counts) {
      out << "\"" << name << "\": {";
      const char* comma = "";
      for (const auto& [key, count] : counts) {
        out << comma << "\"" << key << "\": " << count;
        comma = ", ";
      }
      out << "},\n";
    };
    out << "{\n";
    map("kinds", record_.kinds);
    map("states", record_.states);
    map("stops", record_.stops);
    out << "\"injections\": " << record_.injections << ", \"bursts\": " << record_.bursts
        << ", \"engaged\": " << record_.engaged << ", \"late_sets\": " << record_.late_sets
        << ", \"dropped\": " << bus_.dropped() << ", \"contacts\": " << simulator_->truth().contacts
        << ", \"bad_frame\": \"" << record_.bad_frame
        << "\",\n\"simulated_seconds\": " << toSeconds(simulator_->now()) << ", \"seconds\": " << seconds
        << "\n}\n";
  }

  std::ofstream log_file_;
  can::LogWriter log_;
  LoggedBus bus_;
  simulation::Random random_;
  long target_;
  bool bad_sender_;
  ros::SteadyTime end_;
  std::string report_;
  std::unique_ptr<simulation::Simulator> simulator_;
  BridgeProcess bridge_;
  std::unique_ptr<can::EmbeddedBus> bad_wire_;
  Record record_;

  ros::NodeHandle nh_;
  ros::Publisher clock_, scan_, odom_, joints_, rogue_status_, tunnel_, heartbeat_, rogue_command_;
  std::vector<ros::Publisher> proposals_;
  std::vector<ros::Subscriber> subscribers_;
  TruckCommand command_;
  TruckStatus status_;
  sensor_msgs::LaserScan last_scan_;
  double patience_ = 0.0;  // [s]

  std::vector<Fault> faults_;
  std::vector<Fault*> burst_;
  std::string scan_fault_, unloaded_;
  pid_t manager_held_ = 0;
  bool stop_asked_ = false;  ///< by the arbiter
  bool calm_ = true;
  unsigned operator_ticks_ = 0;
  Stamp burst_until_{}, jumped_{}, burst_ended_ = kStart, drove_since_{},
                                   drive_for_ = std::chrono::seconds(1), towed_ = kStart;
};

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  ros::init(argc, argv, "ros_campaign");
  try {
    tunnel_pilot::shell::Campaign campaign{ros::NodeHandle(), ros::NodeHandle("~")};
    campaign.run();
  } catch (const std::exception& error) {
    ROS_FATAL("ros_campaign: %s", error.what());
    return 1;
  }
  return 0;
}
