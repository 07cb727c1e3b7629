#include "tunnel_pilot/simulation/simulator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::simulation {

using geometry::Pose;

SimulatorParameters loadSimulator(config::Node node) {
  SimulatorParameters parameters;
  parameters.step = node.number("step", "s", 1e-4, 0.01);
  parameters.truth_rate = node.number("truth_rate", "Hz", 1.0, 1.0 / parameters.step);
  parameters.sensor_rate = node.number("sensor_rate", "Hz", 1.0, 1.0 / parameters.step);
  parameters.lidar = loadLidar(node.child("lidar"));
  parameters.articulation = loadSensor(node.child("articulation_sensor"), "rad");
  parameters.articulation_rate = loadSensor(node.child("articulation_rate_sensor"), "rad/s");
  parameters.speed = loadSensor(node.child("speed_sensor"), "m/s");
  parameters.gyro = loadSensor(node.child("gyro"), "rad/s");
  parameters.accelerometer = loadSensor(node.child("accelerometer"), "m/s^2");
  node.finish();
  return parameters;
}

Simulator::Simulator(const SimulatorParameters& parameters, const TruckControllerParameters& controller,
                     const vehicle::TruckParameters& truck, std::unique_ptr<vehicle::Plant> plant,
                     vehicle::Load load, world::World world, std::uint64_t seed, can::Bus& bus)
    : parameters_(parameters),
      truck_(truck),
      plant_(std::move(plant)),
      world_(std::move(world)),
      controller_(controller, bus),
      caster_(world_.walls, LidarModel::beams(parameters.lidar)),
      clearance_meter_(world_.walls),
      lidar_(parameters.lidar, seed),
      articulation_sensor_(parameters.articulation, seed, Stream::kArticulation),
      articulation_rate_sensor_(parameters.articulation_rate, seed, Stream::kArticulationRate),
      speed_sensor_(parameters.speed, seed, Stream::kSpeed),
      gyro_(parameters.gyro, seed, Stream::kGyro),
      accelerometer_(parameters.accelerometer, seed, Stream::kAccelerometer),
      step_(fromSeconds(parameters.step)),
      truth_period_(fromSeconds(1.0 / parameters.truth_rate)),
      sensor_period_(fromSeconds(1.0 / parameters.sensor_rate)),
      sweep_duration_(fromSeconds(lidar_.sweepDuration())) {
  if (!world_.design_line.empty()) line_.emplace(world_.design_line);
  if (load == vehicle::Load::kLoaded) {
    sensed_.payload = truck.loaded.front + truck.loaded.rear - truck.empty.front - truck.empty.rear;
  }
  place(world_.start);
}

void Simulator::place(const Pose& pose, double speed) {
  plant_->reset(pose, 0.0, speed);
  controller_.restart();
  last_pose_ = pose;
  pending_.clear();
  sweeping_ = false;
  front_touches_ = rear_touches_ = false;
  if (line_) line_->reset();
  readSensors();
  measureTruth();
}

Pose Simulator::poseOnLine(double station, double lateral_offset, double heading_error) const {
  const geometry::PathPoint foot = world_.design_line.at(station);
  return Pose{foot.x, foot.y, foot.heading}.compose({0.0, lateral_offset, heading_error});
}

const Simulator::Events& Simulator::step() {
  events_ = {};
  last_pose_ = plant_->state().pose;
  const vehicle::PlantInput wanted = controller_.step(sensed_, now_);
  input_ = lead_ ? *lead_ : wanted;
  plant_->step(input_, {}, parameters_.step);
  now_ += step_;
  if (now_ >= next_sensors_) readSensors();
  runLidar();
  deliverScan();
  if (now_ >= next_truth_) measureTruth();
  return events_;
}

void Simulator::readSensors() {
  const vehicle::PlantState& state = plant_->state();
  const double dt = toSeconds(sensor_period_);
  sensed_.articulation = articulation_sensor_.measure(state.articulation, dt);
  sensed_.articulation_rate = articulation_rate_sensor_.measure(state.articulation_rate, dt);
  sensed_.speed = speed_sensor_.measure(state.speed, dt);
  // The hinge's velocity seen along the rear body.
  const double hinge_y = state.lateral_speed - truck_.geometry.front_axle_to_hinge * state.yaw_rate;
  sensed_.rear_axle_speed = speed_sensor_.scale() * (state.speed * std::cos(state.articulation) -
                                                     hinge_y * std::sin(state.articulation));
  sensed_.yaw_rate = gyro_.measure(state.yaw_rate, dt);
  sensed_.acceleration = accelerometer_.measure(state.acceleration, dt);
  next_sensors_ = now_ + sensor_period_;
}

Pose Simulator::sensorPose(const Pose& body) const {
  return body.compose({truck_.geometry.lidar_x, truck_.geometry.lidar_y, 0.0});
}

// Pose within the last step.
Pose Simulator::poseAt(Stamp stamp) const {
  const Pose& pose = plant_->state().pose;
  const double share = 1.0 + toSeconds(stamp - now_) / parameters_.step;
  return {last_pose_.x + share * (pose.x - last_pose_.x), last_pose_.y + share * (pose.y - last_pose_.y),
          last_pose_.heading + share * geometry::wrapAngle(pose.heading - last_pose_.heading)};
}

void Simulator::runLidar() {
  if (!sweeping_) {
    const Stamp next = next_sweep_;
    if (next > now_) return;
    next_sweep_ = fromSeconds(static_cast<double>(++sweeps_) / parameters_.lidar.rate);
    if (next < now_ - step_) return;  // a sweep that would have begun before the truck was placed
    sweeping_ = true;
    sweep_stamp_ = next;
    sweep_start_ = poseAt(next);
    sweep_truth_ = truthAt(next);
  }
  const Stamp end = sweep_stamp_ + sweep_duration_;
  if (end > now_) return;
  sweeping_ = false;
  if (!world_.obstacles.empty()) caster_.setMovingChains(obstaclesAt(sweep_stamp_));
  const geometry::Scan& scan =
      lidar_.sweep(caster_, sensorPose(sweep_start_), sensorPose(poseAt(end)), truck_.geometry.lidar_z,
                   plant_->state().pitch, sweep_stamp_);
  if (lidar_alive_) {
    pending_.push_back({sweep_stamp_ + fromSeconds(parameters_.lidar.latency), scan, sweep_truth_});
  }
}

void Simulator::deliverScan() {
  if (pending_.empty() || pending_.front().due > now_) return;
  std::swap(delivered_, pending_.front().scan);
  scan_truth_ = pending_.front().truth;
  pending_.pop_front();
  events_.scan = &delivered_;
}

// The truth about the pose within the last step; clearance and contacts are those measured last.
Truth Simulator::truthAt(Stamp stamp) {
  Truth truth = truth_;
  truth.stamp = stamp;
  truth.state = plant_->state();
  truth.state.pose = poseAt(stamp);
  if (!line_) return truth;
  const geometry::PathProjection foot = line_->update(truth.state.pose.position());
  truth.on_design_line = true;
  truth.station = foot.s;
  truth.lateral_offset = foot.lateral_offset;
  truth.heading_error = geometry::wrapAngle(truth.state.pose.heading - foot.heading);
  truth.curvature = foot.curvature;
  return truth;
}

void Simulator::measureTruth() {
  truth_ = truthAt(now_);
  const Pose& pose = truth_.state.pose;
  const double front = clearanceOf(vehicle::frontOutline(truck_.geometry, pose));
  const double rear =
      clearanceOf(vehicle::rearOutline(truck_.geometry, pose, truth_.state.articulation));
  truth_.clearance = std::min(front, rear);
  const bool front_contact = front <= 0.0 && !front_touches_;
  const bool rear_contact = rear <= 0.0 && !rear_touches_;
  front_touches_ = front <= 0.0;
  rear_touches_ = rear <= 0.0;
  truth_.contacts += (front_contact ? 1u : 0u) + (rear_contact ? 1u : 0u);
  if (front_contact || rear_contact) events_.contact = Contact{now_, front_contact};
  events_.truth = true;
  next_truth_ = now_ + truth_period_;
}

std::vector<world::WallChain> Simulator::obstaclesAt(Stamp stamp) const {
  std::vector<world::WallChain> chains;
  for (const world::Obstacle& obstacle : world_.obstacles) {
    chains.push_back(obstacle.chainAt(toSeconds(stamp)));
  }
  return chains;
}

double Simulator::clearanceOf(const std::vector<geometry::Point>& outline) {
  const double walls = clearance_meter_.clearance(outline);
  if (world_.obstacles.empty()) return walls;
  return std::min(walls, world::clearance(outline, obstaclesAt(now_)));
}

}  // namespace tunnel_pilot::simulation
