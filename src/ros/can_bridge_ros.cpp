#include "tunnel_pilot/ros/can_bridge_ros.h"

#include <ros/console.h>

#include <map>

#include "tunnel_pilot/ros/bus_choice.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kTickPeriod = 0.005;    // [s] steady time
constexpr std::uint32_t kCommands = 10;  // that may wait: a newer one must not push a stop out
constexpr Stamp kStatusPeriod = std::chrono::milliseconds(100);

Stamp steadyNow() { return std::chrono::steady_clock::now().time_since_epoch(); }

}  // namespace

CanBridgeRos::CanBridgeRos(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  Parameters parameters(private_nh);
  const auto truck = takeTruck(parameters);
  publishers_ = PublisherWatch(takePublisher(parameters, nh));
  if (const auto path = takeOptional(parameters, "operator_socket")) {
    operator_socket_ = std::make_unique<bridge::OperatorSocket>(*path);
  }
  bus_ = takeBus(parameters, ros::Time::isSimTime());
  const auto bridge_parameters = bridge::loadBridge(parameters.rest());
  bridge_ = std::make_unique<bridge::CanBridge>(bridge_parameters, truck.geometry, *bus_);
  watchNodes(nh, bridge_parameters);

  joint_publisher_ = nh.advertise<sensor_msgs::JointState>("joint_states", 5);
  odometry_publisher_ = nh.advertise<nav_msgs::Odometry>("odom", 5);
  status_publisher_ = nh.advertise<TruckStatus>("truck_status", 5);
  diagnostics_ = std::make_unique<Diagnostics>(nh, private_nh, "can_bridge",
                                               [this](auto& status) { fillStatus(status); });
  advertiseEdge(nh, "release", &bridge::CanBridge::release);
  advertiseEdge(nh, "stop", &bridge::CanBridge::stop);
  if (!operator_socket_) {  // otherwise what leads to driving is done there alone
    advertiseEdge(nh, "engage", &bridge::CanBridge::engage);
    advertiseEdge(nh, "reset", &bridge::CanBridge::reset);
  }
  const auto hints = ros::TransportHints().tcpNoDelay();
  command_subscriber_ = nh.subscribe("command", kCommands, &CanBridgeRos::onCommand, this, hints);
  if (ros::Time::isSimTime()) {
    clock_subscriber_ = nh.subscribe<rosgraph_msgs::Clock>(
        "/clock", 10, [this](const rosgraph_msgs::Clock::ConstPtr& m) { tick(toCore(m->clock)); },
        ros::VoidConstPtr(), hints);
  } else {
    timer_ = nh.createWallTimer(ros::WallDuration(kTickPeriod),
                                [this](const ros::WallTimerEvent&) { tick(now()); });
  }
}

void CanBridgeRos::advertiseEdge(ros::NodeHandle& nh, const std::string& name, Edge edge) {
  const auto serve = [this, name, edge](Trigger::Request&, Trigger::Response& response) {
    const auto answer = serveEdge(name, edge);
    response.success = answer.accepted;
    response.message = answer.reason;
    return true;
  };
  services_.push_back(nh.advertiseService<Trigger::Request, Trigger::Response>(
      name, boost::function<bool(Trigger::Request&, Trigger::Response&)>(serve)));
}

bridge::CanBridge::Answer CanBridgeRos::serveEdge(const std::string& name, Edge edge) {
  auto answer = (bridge_.get()->*edge)(current());
  ROS_INFO("can_bridge: %s %s %s", name.c_str(),
           answer.accepted ? "accepted" : "refused:", answer.reason.c_str());
  return answer;
}

void CanBridgeRos::hearOperator() {
  if (!operator_socket_) return;
  using Local = bridge::OperatorSocket::Edge;
  static const std::map<Local, Edge> edges = {{Local::kEngage, &bridge::CanBridge::engage},
                                              {Local::kRelease, &bridge::CanBridge::release},
                                              {Local::kStop, &bridge::CanBridge::stop},
                                              {Local::kReset, &bridge::CanBridge::reset}};
  operator_socket_->poll(steadyNow(), [this](Local edge, unsigned user) {
    const auto answer = serveEdge(toString(edge) + " by user " + std::to_string(user), edges.at(edge));
    return answer.accepted ? std::string() : answer.reason;
  });
}

void CanBridgeRos::onCommand(const CommandEvent& event) {
  const TruckCommand& message = *event.getConstMessage();
  const std::string why = publishers_.whyRefused(event.getPublisherName(), ros::SteadyTime::now());
  if (!why.empty()) {
    ROS_ERROR_THROTTLE(1.0, "can_bridge: command rejected: %s", why.c_str());
    bridge_->rejectCommand(toCore(message), why, current());
    return;
  }
  bridge_->setCommand(toCore(message), current());
}

void CanBridgeRos::watchNodes(ros::NodeHandle& nh, const bridge::BridgeParameters& parameters) {
  std::vector<std::string> nodes;
  for (const std::string& node : parameters.heartbeats) nodes.push_back(nh.resolveName(node));
  heartbeats_ = std::make_unique<bridge::HeartbeatWatch>(nodes, parameters.heartbeat_timeout);
  if (nodes.empty()) return;
  heartbeat_subscriber_ = nh.subscribe<tunnel_pilot::Heartbeat>(
      "heartbeat", 100,
      [this](const tunnel_pilot::Heartbeat::ConstPtr& m) { heartbeats_->heard(m->node, steadyNow()); },
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

void CanBridgeRos::watchProcesses() {
  const std::optional<std::string> silent = heartbeats_->silent(steadyNow());
  bridge_->setSilentProcess(silent);
  if (silent == silent_) return;
  silent_ = silent;
  if (silent) {
    ROS_ERROR("can_bridge: %s is silent", silent->c_str());
  } else {
    ROS_INFO("can_bridge: all processes give signs of life");
  }
}

Stamp CanBridgeRos::current() const { return ros::Time::isSimTime() ? last_tick_ : now(); }

void CanBridgeRos::tick(Stamp now) {
  if (clock_.jumped(toRos(now), ros::SteadyTime::now(), ros::Time::isSimTime())) {
    ROS_ERROR("can_bridge: the clock jumped");
    bridge_->clockJumped(now);
    published_status_ = Stamp{};
  }
  last_tick_ = now;
  watchProcesses();
  bridge_->tick(now);
  hearOperator();
  if (bridge_->motion().stamp != published_motion_) {
    publishMotion();
    publishStatus(now);
  } else if (now - published_status_ >= kStatusPeriod) {
    publishStatus(now);
  }
  tellTrouble();
  const auto& status = bridge_->status();
  if (status.transitions == told_transitions_) return;
  told_transitions_ = status.transitions;
  ROS_INFO("can_bridge: %s: %s", toString(status.state).c_str(), toString(status.reason).c_str());
  diagnostics_->tell();
}

void CanBridgeRos::tellTrouble() {
  const std::string trouble = bus_->trouble();
  if (trouble == told_trouble_) return;
  told_trouble_ = trouble;
  if (trouble.empty()) {
    ROS_INFO("can_bridge: the bus works");
  } else {
    ROS_ERROR("can_bridge: %s", trouble.c_str());
  }
  diagnostics_->tell();
}

void CanBridgeRos::publishMotion() {
  const auto& motion = bridge_->motion();
  published_motion_ = motion.stamp;
  joint_publisher_.publish(toJointState(motion));
  const auto odometry = toRos(bridge_->odometry());
  odometry_publisher_.publish(odometry);
  geometry_msgs::TransformStamped transform;
  transform.header = odometry.header;
  transform.child_frame_id = odometry.child_frame_id;
  transform.transform.translation.x = motion.pose.x;
  transform.transform.translation.y = motion.pose.y;
  transform.transform.rotation = odometry.pose.pose.orientation;
  transform_broadcaster_.sendTransform(transform);
}

void CanBridgeRos::publishStatus(Stamp now) {
  published_status_ = now;
  status_publisher_.publish(toRos(bridge_->status(), now));
}

void CanBridgeRos::fillStatus(Diagnostics::Status& status) const {
  const auto& s = bridge_->status();
  const std::string words = toString(s.state) + ": " + toString(s.reason);
  const bool stop = bridge::isStop(s.state);
  const bool driving = s.state == bridge::SafetyState::kActive;
  status.summary(stop      ? Diagnostics::Status::ERROR
                 : driving ? Diagnostics::Status::OK
                           : Diagnostics::Status::WARN,
                 words);
  status.add("feedback age [s]", s.feedback_age);
  status.add("command age [s]", s.command_age);
  status.add("tracking error [rad]", s.tracking_error);
  status.add("fault bits", s.faults);
  status.add("frames received", s.frames_received);
  status.add("frames rejected", s.frames_rejected);
  status.add("frames sent", s.frames_sent);
  status.add("frames confirmed", bus_->confirmed());
  status.add("frames in flight", bus_->inFlight());
  status.add("trouble with the bus", bus_->trouble());
  status.add("silent process", silent_.value_or(""));
  status.add("commands rejected", s.commands_rejected);
  status.add("last command rejection", s.command_rejection);
}

}  // namespace tunnel_pilot::shell
