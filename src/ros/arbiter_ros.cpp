#include "tunnel_pilot/ros/arbiter_ros.h"

#include <ros/console.h>
#include <tunnel_pilot/ScanRejection.h>

#include <boost/make_shared.hpp>
#include <utility>

#include "tunnel_pilot/ros/parameters.h"
#include "tunnel_pilot/supervision/arbiter_tuning.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kDecisionPeriod = 0.02;  // [s]

supervision::Arbiter makeArbiter(const ros::NodeHandle& private_nh) {
  Parameters parameters(private_nh);
  const auto truck = takeTruck(parameters);
  return {supervision::loadArbiter(parameters.rest()), truck};
}

}  // namespace

ArbiterRos::ArbiterRos(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : arbiter_(makeArbiter(private_nh)),
      command_publisher_(nh.advertise<TruckCommand>("command", 1)),
      state_publisher_(nh.advertise<ArbiterState>("arbiter_state", 1)),
      tuning_(
          private_nh, supervision::tuningOf(arbiter_), [this] { return arbiter_.mayLoosen(now()); },
          [this](const LiveTuning::Values& values) { arbiter_.tune(values); }),
      diagnostics_(nh, private_nh, "arbiter", [this](auto& status) { fillStatus(status); }) {
  last_.command.stop = true;
  last_.command.reason = supervision::Reason::kStartUp;
  subscribe(nh);
  stop_service_ = private_nh.advertiseService("stop", &ArbiterRos::onStop, this);
  reset_service_ = private_nh.advertiseService("reset", &ArbiterRos::onReset, this);
  offerDriver(private_nh, supervision::Source::kLidarDriver);
  offerDriver(private_nh, supervision::Source::kPreviewDriver);
  if (ros::Time::isSimTime()) {
    timer_ =
        nh.createTimer(ros::Duration(kDecisionPeriod), [this](const ros::TimerEvent&) { decide(); });
  } else {
    wall_timer_ = nh.createWallTimer(ros::WallDuration(kDecisionPeriod),
                                     [this](const ros::WallTimerEvent&) { decide(); });
  }
}

template <class Message, class Callback>
void ArbiterRos::listen(ros::NodeHandle& nh, const std::string& topic, Callback callback) {
  const boost::function<void(const boost::shared_ptr<const Message>&)> call =
      [this, topic, callback](const boost::shared_ptr<const Message>& message) {
        unheard_.erase(topic);
        nowAfter(message->header.stamp);
        checkClock();
        callback(*message);
      };
  subscribers_.push_back(
      nh.subscribe<Message>(topic, 2, call, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
}

void ArbiterRos::subscribe(ros::NodeHandle& nh) {
  using supervision::Source;
  unheard_ = {"points", "walls", "tunnel_state", "centerline", "odom", "joint_states"};
  if (arbiter_.parameters().needs_truck_state) unheard_.insert("truck_status");
  for (const auto& [topic, source] : {std::pair("lidar_driver/proposal", Source::kLidarDriver),
                                      std::pair("preview_driver/proposal", Source::kPreviewDriver),
                                      std::pair("teleoperation/proposal", Source::kTeleoperation)}) {
    listen<Proposal>(nh, topic, [this, from = source](auto& m) { onProposal(from, m); });
  }
  listen<Walls>(nh, "walls", [this](auto& m) { arbiter_.setWalls(toCore(m), now()); });
  listen<sensor_msgs::PointCloud2>(nh, "points", [this](auto& m) { onPoints(m); });
  listen<ScanRejection>(nh, "scan_rejected", [this](auto& m) {
    arbiter_.setRejection({static_cast<bool>(m.frozen)}, now());
  });
  listen<TunnelState>(nh, "tunnel_state", [this](auto& m) {
    tunnel_.setState(toCore(m));
    updateTunnel();
  });
  listen<nav_msgs::Path>(nh, "centerline", [this](auto& m) {
    tunnel_.setCenterline(toCore(m.header.stamp), toCore(m));
    updateTunnel();
  });
  listen<nav_msgs::Odometry>(nh, "odom", [this](auto& m) {
    motion_.setOdometry(m);
    updateMotion();
  });
  listen<sensor_msgs::JointState>(nh, "joint_states", [this](auto& m) {
    motion_.setJointState(m);
    updateMotion();
  });
  listen<TruckStatus>(nh, "truck_status", [this](auto& m) { arbiter_.setTruckState(toCore(m), now()); });
}

void ArbiterRos::offerDriver(ros::NodeHandle& private_nh, supervision::Source driver) {
  const auto serve = [this, driver](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    response.success = arbiter_.selectDriver(driver);
    response.message = response.success ? toString(driver) + " steers while it is healthy"
                                        : "refused: arbiter.yaml has no " + toString(driver);
    ROS_INFO("arbiter: %s", response.message.c_str());
    return true;
  };
  driver_services_.push_back(
      private_nh.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
          "use/" + toString(driver),
          boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)>(serve)));
}

void ArbiterRos::checkClock() {
  if (!clock_.jumped()) return;
  ROS_ERROR("arbiter: the clock jumped");
  arbiter_.clockJumped();
  motion_.reset();
  tunnel_.reset();
}

void ArbiterRos::onProposal(supervision::Source source, const Proposal& message) {
  arbiter_.setProposal(source, toCore(message), now());
  decide();
}

void ArbiterRos::onPoints(const sensor_msgs::PointCloud2& message) {
  const auto cloud = message.header.frame_id == kBaseFrame ? toCore(message) : nullptr;
  if (!cloud) {
    ROS_ERROR_THROTTLE(1.0,
                       "arbiter: a cloud that is not in base_link or has no x, y, z is passed over");
    return;
  }
  arbiter_.setPoints(*cloud, toCore(message.header.stamp), now());
}

bool ArbiterRos::onStop(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  arbiter_.requestStop(now());
  decide();
  response.success = true;
  response.message = "stopping";
  return true;
}

bool ArbiterRos::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  response.success = arbiter_.reset(now());
  response.message =
      response.success ? "reset" : "refused: the truck moves, or " + toString(last_.command.reason);
  return true;
}

void ArbiterRos::updateMotion() {
  const auto motion = motion_.motion();
  if (!motion) return;
  if (arbiter_.setMotion(*motion, now())) return;
  ++motion_refused_;
  ROS_ERROR_THROTTLE(
      1.0, "arbiter: odom or joint_states holds %s",
      drivers::isUsable(*motion) ? "a stamp from the future" : "a number that is none or beyond 1e6");
}

void ArbiterRos::updateTunnel() {
  if (const auto tunnel = tunnel_.take()) arbiter_.setTunnel(*tunnel, now());
}

void ArbiterRos::decide() {
  checkClock();
  last_ = arbiter_.decide(now());
  command_publisher_.publish(boost::make_shared<TruckCommand>(toRos(last_.command)));
  state_publisher_.publish(boost::make_shared<ArbiterState>(toArbiterState(last_)));
  if (last_.command.reason == supervision::Reason::kStartUp && !unheard_.empty()) {
    ROS_WARN_THROTTLE(5.0, "arbiter: waiting for the first message on: %s", unheardTopics().c_str());
  }
  if (last_.command.reason == told_) return;
  told_ = last_.command.reason;
  ROS_INFO("arbiter: %s", toString(last_.command.reason).c_str());
  diagnostics_.tell();
}

std::string ArbiterRos::unheardTopics() const {
  std::string list;
  for (const std::string& topic : unheard_) list += (list.empty() ? "" : ", ") + topic;
  return list;
}

void ArbiterRos::fillStatus(Diagnostics::Status& status) const {
  const auto& command = last_.command;
  const bool healthy = command.reason == supervision::Reason::kNone;
  status.summary(healthy        ? Diagnostics::Status::OK
                 : command.stop ? Diagnostics::Status::ERROR
                                : Diagnostics::Status::WARN,
                 toString(command.reason));
  status.add("source", toString(command.source));
  status.add("speed [m/s]", command.speed);
  status.add("stop", command.stop);
  status.add("sequence", command.sequence);
  status.add("motion refused", motion_refused_);
  status.add("odometry jumps", arbiter_.odometryJumps());
  if (!tuning_.refusal().empty()) status.add("tuning refused", tuning_.refusal());
  if (!unheard_.empty()) status.add("nothing heard yet on", unheardTopics());
}

}  // namespace tunnel_pilot::shell
