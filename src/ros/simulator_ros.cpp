#include "tunnel_pilot/ros/simulator_ros.h"

#include <ros/console.h>
#include <rosgraph_msgs/Clock.h>
#include <tunnel_pilot/SimulatorTruth.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"
#include "tunnel_pilot/simulation/episode.h"

namespace tunnel_pilot::shell {
namespace {

constexpr Stamp kClockPeriod = std::chrono::milliseconds(10);
constexpr Stamp kFramePeriod = std::chrono::milliseconds(20);
constexpr Stamp kObstaclePeriod = std::chrono::milliseconds(50);
constexpr double kLongestPoll = 0.02;    // [s] steady time, the rest of a longer one was not ours
constexpr double kPicturedHeight = 1.5;  // of the pictured walls [m]
constexpr double kObstacleHeight = 1.7;  // of the pictured obstacles [m]

// True when the step from `before` to `now` reached another multiple of the period.
bool isDue(Stamp before, Stamp now, Stamp period) { return before / period != now / period; }

// True when the bridge spoke (TP_COMMAND_INFO) before it knew the command whose measurement is `stamp`.
bool overtakes(const can::Frame& frame, Stamp stamp) {
  const auto info = can::decode<can::CommandInfoFrame>(frame);
  if (!info) return false;
  const auto expected = std::chrono::duration_cast<std::chrono::milliseconds>(stamp).count();
  return static_cast<std::int16_t>(info->measurement_stamp_ms - expected) < 0;  // modulo 65536
}

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

Marker truthMarker(const std::string& ns, int id, int type, float red, float green, float blue,
                   float alpha) {
  Marker m;
  m.header.frame_id = kMapFrame;
  m.ns = ns;
  m.id = id;
  m.type = type;
  m.pose.orientation.w = 1.0;
  m.scale.x = m.scale.y = m.scale.z = 1.0;
  m.color.r = red;
  m.color.g = green;
  m.color.b = blue;
  m.color.a = alpha;
  return m;
}

geometry_msgs::Point raised(const geometry::Point& point, double height) {
  geometry_msgs::Point p;
  p.x = point.x();
  p.y = point.y();
  p.z = height;
  return p;
}

// A triangle of one colour: the marker's own, darkened by `light` (0..1).
void addTriangle(const geometry_msgs::Point& a, const geometry_msgs::Point& b,
                 const geometry_msgs::Point& c, double light, Marker& triangles) {
  auto color = triangles.color;
  const auto factor = static_cast<float>(light);
  color.r *= factor;
  color.g *= factor;
  color.b *= factor;
  triangles.points.insert(triangles.points.end(), {a, b, c});
  triangles.colors.insert(triangles.colors.end(), 3, color);
}

// Upright faces on the chain, darker the more they look sideways.
void addFaces(const world::WallChain& chain, double height, Marker& triangles) {
  for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
    const auto along = chain[i + 1] - chain[i];
    const double light = 0.6 + 0.25 * std::abs(along.y()) / std::max(along.norm(), 1e-9);
    const auto a = raised(chain[i], 0.0), b = raised(chain[i + 1], 0.0);
    const auto c = raised(chain[i + 1], height), d = raised(chain[i], height);
    addTriangle(a, b, c, light, triangles);
    addTriangle(a, c, d, light, triangles);
  }
}

// A closed outline's lid, as a fan about its middle.
void addLid(const world::WallChain& chain, double height, Marker& triangles) {
  if (chain.empty()) return;
  geometry::Point sum = geometry::Point::Zero();
  for (const auto& point : chain) sum += point;
  const geometry_msgs::Point middle = raised(sum / static_cast<double>(chain.size()), height);
  for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
    addTriangle(raised(chain[i], height), raised(chain[i + 1], height), middle, 1.0, triangles);
  }
}

void addEdges(const world::WallChain& chain, double height, Marker& lines) {
  for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
    lines.points.push_back(raised(chain[i], height));
    lines.points.push_back(raised(chain[i + 1], height));
  }
}

SimulatorTruth toMessage(const simulation::Truth& truth, double lap_length) {
  SimulatorTruth message;
  message.header.stamp = toRos(truth.stamp);
  message.header.frame_id = kMapFrame;
  message.pose.x = truth.state.pose.x;
  message.pose.y = truth.state.pose.y;
  message.pose.theta = truth.state.pose.heading;
  message.articulation = truth.state.articulation;
  message.speed = truth.state.speed;
  message.lateral_speed = truth.state.lateral_speed;
  message.yaw_rate = truth.state.yaw_rate;
  message.on_design_line = truth.on_design_line;
  message.station = truth.station;
  message.lateral_offset = truth.lateral_offset;
  message.heading_error = truth.heading_error;
  message.curvature = truth.curvature;
  message.lap_length = lap_length;
  message.clearance = truth.clearance;
  message.contacts = truth.contacts;
  return message;
}

}  // namespace

void Pace::hold(Stamp now, double factor) {
  if (factor <= 0.0) {
    factor_ = -1.0;
    return;
  }
  const ros::SteadyTime steady = ros::SteadyTime::now();
  const double early = toSeconds(now - simulated_start_) / factor - (steady - steady_start_).toSec();
  if (factor != factor_ || early < -0.1 || early > 1.0) {  // a new factor, or time was lost: start here
    factor_ = factor;
    simulated_start_ = now;
    steady_start_ = steady;
  } else if (early > 0.0) {
    ros::WallDuration(early).sleep();
  }
}

SimulatorRos::SimulatorRos(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  nh.setCallbackQueue(&queue_);
  private_nh.setCallbackQueue(&queue_);
  configure(private_nh);
  advertise(nh, private_nh);
  publishWalls();
  publishObstacles();
}

void SimulatorRos::configure(const ros::NodeHandle& private_nh) {
  Parameters parameters(private_nh);
  const auto truck = takeTruck(parameters);
  config::Node own = parameters.take({"truck_controller_file", "world_file", "bus", "profile", "load",
                                      "seed", "reversed", "real_time_factor"});
  auto controller = simulation::loadTruckController(config::loadFile(own.text("truck_controller_file")));
  real_time_factor_ = own.number("real_time_factor", "1", 0.0, 1000.0);
  const auto seed = static_cast<std::uint64_t>(own.integer("seed", "1", 0, 1 << 30));
  const bool loaded = own.choice("load", {"empty", "loaded"}) == "loaded";
  world::WorldOptions options;
  options.seed = seed;
  options.reversed = own.boolean("reversed");
  auto world = world::loadWorld(own.text("world_file"), options);
  if (own.has("profile")) controller.can.kind = can::readProfileKind(own, "profile");
  auto wire = std::make_unique<can::EmbeddedBus>(own.text("bus"));
  bus_ =
      std::make_unique<BusTap>(can::withProfile(controller.can, std::move(wire)), can::kTpCommandInfoId);
  own.finish();

  const auto simulator = simulation::loadSimulator(parameters.rest());
  scan_period_ = 1.0 / simulator.lidar.rate;
  const auto load = loaded ? vehicle::Load::kLoaded : vehicle::Load::kEmpty;
  const simulation::PlantChoice plant{simulation::PlantModel::kDynamic, load, true, 0.0};
  simulator_ = std::make_unique<simulation::Simulator>(simulator, controller, truck,
                                                       simulation::makePlant(plant, truck, seed), load,
                                                       std::move(world), seed, *bus_);
  simulator_->place(simulator_->startPose());
}

void SimulatorRos::advertise(ros::NodeHandle& nh, ros::NodeHandle& private_nh) {
  clock_publisher_ = nh.advertise<rosgraph_msgs::Clock>("/clock", 10);
  scan_publisher_ = nh.advertise<sensor_msgs::LaserScan>("scan", 2);
  truth_publisher_ = private_nh.advertise<SimulatorTruth>("truth", 50);
  walls_publisher_ = private_nh.advertise<MarkerArray>("walls", 1, true);
  obstacles_publisher_ = private_nh.advertise<MarkerArray>("obstacles", 1, true);
  const auto hints = ros::TransportHints().tcpNoDelay();
  command_subscriber_ = nh.subscribe("command", 10, &SimulatorRos::onCommand, this, hints);
  odometry_subscriber_ = nh.subscribe("odom", 10, &SimulatorRos::onOdometry, this, hints);
  reset_service_ = private_nh.advertiseService("reset", &SimulatorRos::onReset, this);
  pause_service_ = private_nh.advertiseService("pause", &SimulatorRos::onPause, this);
  diagnostics_ = std::make_unique<Diagnostics>(nh, private_nh, "simulator",
                                               [this](auto& status) { fillStatus(status); });
}

void SimulatorRos::advance() {
  if (paused_) {
    queue_.callAvailable(ros::WallDuration(0.01));
    return;
  }
  const Stamp before = simulator_->now();
  const auto& events = simulator_->step();
  const Stamp now = simulator_->now();
  if (events.truth) publishTruth();
  if (events.contact) {
    ROS_ERROR("simulator: the %s body touched something", events.contact->front ? "front" : "rear");
  }
  const bool clock_due = isDue(before, now, kClockPeriod);
  if (clock_due || events.scan) publishClock();
  if (events.scan) {
    publishScan(*events.scan);
    awaitCommand(events.scan->stamp);
  }
  if (isDue(before, now, kFramePeriod)) awaitBridge();
  if (isDue(before, now, kObstaclePeriod) && !simulator_->world().obstacles.empty()) publishObstacles();
  if (!clock_due) return;
  const bool slow = real_time_factor_ > 0.0 && real_time_factor_ < 1.0;
  pace_.hold(now, inLockstep() || slow ? real_time_factor_ : 1.0);
  queue_.callAvailable();
}

// Lets a partner answer. Silent is who does not answer while this process runs: a machine that holds up
// all of its processes makes nobody silent. An answer that comes without having been waited for brings
// the lockstep back.
template <class Answered>
void SimulatorRos::await(Partner& partner, const ros::Subscriber& topic, Answered answered) {
  double silence = 0.0;
  ros::SteadyTime last = ros::SteadyTime::now();
  while (!answered()) {
    if (!partner.alive || !ros::ok()) return;
    const ros::SteadyTime steady = ros::SteadyTime::now();
    silence += std::min((steady - last).toSec(), kLongestPoll);
    last = steady;
    if (silence < kLongestSilence && topic.getNumPublishers() > 0) continue;
    partner.alive = false;
    ++partner.given_up;
    ROS_WARN("simulator: the %s is silent: time goes on without it", partner.name);
    diagnostics_->tell();
    return;
  }
  partner.alive = topic.getNumPublishers() > 0;  // otherwise it could not be seen to leave
}

void SimulatorRos::awaitCommand(Stamp stamp) {
  // Without lockstep, a driver's answer to the scan before is already a sign of life.
  const Stamp before = std::max(stamp - fromSeconds(1.5 * scan_period_), Stamp(1));
  await(pilot_, command_subscriber_, [&] {
    queue_.callAvailable(ros::WallDuration(pilot_.alive ? 0.002 : 0.0));
    return pilot_.alive ? command_stamp_ >= stamp : driver_stamp_ >= before;
  });
}

void SimulatorRos::awaitBridge() {
  await(bridge_, odometry_subscriber_, [&] {
    if (bus_->count() > bridge_frames_) return true;
    if (bridge_.alive) bus_->wait(2);
    return bus_->count() > bridge_frames_;
  });
  bridge_frames_ = bus_->count();
  // The bridge's copy of a command may come later than ours: until it does, in real time.
  if (inLockstep() && overtakes(bus_->newest(), expected_stamp_)) {
    ++late_commands_;
    ros::WallDuration(toSeconds(kFramePeriod)).sleep();
  }
  expected_stamp_ = driver_stamp_;
}

// Without a healthy driver commands stem from no scan: they come with time, which must not wait for
// them.
void SimulatorRos::onCommand(const TruckCommand& message) {
  command_stamp_ = toCore(message.header.stamp);
  if (message.source == TruckCommand::SOURCE_NONE || message.source == TruckCommand::SOURCE_HOLD) {
    pilot_.alive = false;
  } else if (message.source != TruckCommand::SOURCE_DEAD_RECKONING) {
    driver_stamp_ = command_stamp_;
  }
}

void SimulatorRos::publishClock() {
  rosgraph_msgs::Clock clock;
  clock.clock = toRos(simulator_->now());
  clock_publisher_.publish(clock);
}

void SimulatorRos::publishScan(const geometry::Scan& scan) {
  auto message = toRos(scan, "laser");
  message.scan_time = static_cast<float>(scan_period_);
  scan_publisher_.publish(message);
}

void SimulatorRos::publishTruth() {
  const auto& truth = simulator_->truth();
  truth_publisher_.publish(toMessage(truth, simulator_->world().design_line.length()));
  drivers::Motion motion;
  motion.stamp = truth.stamp;
  motion.pose = truth.state.pose;
  motion.speed = truth.state.speed;
  motion.yaw_rate = truth.state.yaw_rate;
  true_motion_.add(motion, motion.stamp);
}

void SimulatorRos::publishWalls() {
  auto faces = truthMarker("true_walls", 0, Marker::TRIANGLE_LIST, 0.75F, 0.75F, 0.8F, 0.22F);
  auto edges = truthMarker("true_walls", 1, Marker::LINE_LIST, 0.75F, 0.75F, 0.8F, 0.5F);
  edges.scale.x = 0.06;
  for (const auto& chain : simulator_->world().walls) {
    addFaces(chain, kPicturedHeight, faces);
    addEdges(chain, 0.0, edges);
    addEdges(chain, kPicturedHeight, edges);
  }
  MarkerArray markers;
  if (!edges.points.empty()) markers.markers = {faces, edges};
  walls_publisher_.publish(markers);
}

void SimulatorRos::publishObstacles() {
  MarkerArray markers;
  int id = 0;
  for (const auto& obstacle : simulator_->world().obstacles) {
    const auto outline = obstacle.chainAt(toSeconds(simulator_->now()));
    auto body = truthMarker("obstacles", id, Marker::TRIANGLE_LIST, 0.95F, 0.3F, 0.25F, 1.0F);
    addFaces(outline, kObstacleHeight, body);
    addLid(outline, kObstacleHeight, body);
    auto name = truthMarker("obstacle_names", id++, Marker::TEXT_VIEW_FACING, 1.0F, 0.75F, 0.7F, 1.0F);
    const auto pose = obstacle.poseAt(toSeconds(simulator_->now()));
    name.pose.position = raised(geometry::Point(pose.x, pose.y), kObstacleHeight + 0.6);
    name.scale.z = 0.7;
    name.text = obstacle.name;
    if (!body.points.empty()) markers.markers.push_back(body);
    if (!name.text.empty()) markers.markers.push_back(name);
  }
  obstacles_publisher_.publish(markers);
}

// What a localisation would tell: where odom lies in the map, by the true pose at the odometry's stamp.
void SimulatorRos::onOdometry(const nav_msgs::Odometry& message) {
  const auto true_pose = true_motion_.poseAt(toCore(message.header.stamp));
  const geometry::Pose odom = toCore(message.pose.pose);
  if (!true_pose || !std::isfinite(odom.x + odom.y + odom.heading)) return;
  const geometry::Pose odom_in_map = true_pose->compose(odom.relative(geometry::Pose()));
  const auto pose = toRos(odom_in_map);
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = message.header.stamp;
  transform.header.frame_id = kMapFrame;
  transform.child_frame_id = kOdomFrame;
  transform.transform.translation.x = pose.position.x;
  transform.transform.translation.y = pose.position.y;
  transform.transform.rotation = pose.orientation;
  transform_broadcaster_.sendTransform(transform);
}

bool SimulatorRos::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  simulator_->place(simulator_->startPose());
  true_motion_.clear();
  response.success = true;
  response.message = "the truck stands at its start";
  return true;
}

bool SimulatorRos::onPause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  paused_ = request.data;
  response.success = true;
  response.message = paused_ ? "time stands still" : "time goes on";
  return true;
}

void SimulatorRos::fillStatus(Diagnostics::Status& status) {
  const auto& truth = simulator_->truth();
  const auto silent = [](const Partner& partner) { return !partner.alive && partner.given_up > 0; };
  if (truth.contacts > 0) {
    status.summary(Diagnostics::Status::ERROR, "a body touched something");
  } else if (silent(pilot_) || silent(bridge_)) {
    const char* name = silent(bridge_) ? bridge_.name : pilot_.name;
    status.summary(Diagnostics::Status::WARN, std::string("in real time: the ") + name + " is silent");
  } else {
    status.summary(Diagnostics::Status::OK, paused_        ? "paused"
                                            : inLockstep() ? "in lockstep"
                                                           : "in real time");
  }
  status.add("time [s]", toSeconds(simulator_->now()));
  status.add("contacts", truth.contacts);
  status.add("commands late at the bridge", late_commands_);
  status.add("pilot given up", pilot_.given_up);
  status.add("bridge given up", bridge_.given_up);
}

}  // namespace tunnel_pilot::shell
