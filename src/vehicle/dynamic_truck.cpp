#include "tunnel_pilot/vehicle/dynamic_truck.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::vehicle {
namespace {

constexpr double kMaxSubstep = 0.001;    // [s]
constexpr double kStopStiffness = 20.0;  // of the mechanical stop, times k_s [1]
constexpr double kStopDamping = 5.0;     // times c_s [1]

// Wraps an angle that has left (-pi, pi] by less than a turn.
double wrapOnce(double angle) {
  if (angle > M_PI) return angle - 2.0 * M_PI;
  if (angle <= -M_PI) return angle + 2.0 * M_PI;
  return angle;
}

}  // namespace

DynamicTruck::DynamicTruck(const TruckParameters& parameters, const DynamicTruckOptions& options)
    : parameters_(parameters),
      masses_(parameters.masses(options.load)),
      compliance_(hingeCompliance(parameters)),
      actuator_(parameters.steering, parameters.geometry.max_articulation),
      drive_train_(parameters, options.load),
      front_tyre_(parameters.tyre, staticAxleLoads(parameters, options.load).front),
      rear_tyre_(parameters.tyre, staticAxleLoads(parameters, options.load).rear),
      front_axle_(parameters.front_suspension, staticAxleLoads(parameters, options.load).front),
      rear_axle_(parameters.rear_suspension, staticAxleLoads(parameters, options.load).rear),
      brake_temperature_(options.brake_temperature) {
  inertia_.mass = masses_.front + masses_.rear;
  inertia_.front_moment = masses_.front * masses_.front_cg_offset;
  inertia_.rear_moment = masses_.rear * masses_.rear_cg_offset;
  const double m = inertia_.mass;
  const double b_f = inertia_.front_moment;
  const double b_r = inertia_.rear_moment;
  inertia_.front = masses_.front_inertia + b_f * masses_.front_cg_offset - b_f * b_f / m;
  inertia_.rear = masses_.rear_inertia + b_r * masses_.rear_cg_offset - b_r * b_r / m;
  if (options.rough_road) {
    road_ = std::make_shared<const RoadProfile>(parameters.road_roughness, options.road_seed);
  }
  DynamicTruck::reset({}, 0.0, 0.0);
}

void DynamicTruck::reset(const geometry::Pose& pose, double articulation, double speed) {
  const TruckGeometry& g = parameters_.geometry;
  gamma_ = std::clamp(articulation, -g.max_articulation, g.max_articulation);
  heading_ = geometry::wrapAngle(pose.heading);
  front_rate_ = rear_rate_ = yawRate(g, speed, gamma_, 0.0);
  hinge_ = pose.transform({-g.front_axle_to_hinge, 0.0});
  const geometry::Pose turned{0.0, 0.0, heading_};
  hinge_velocity_ = turned.transform({speed, -g.front_axle_to_hinge * front_rate_});
  way_ = 0.0;
  front_force_ = rear_force_ = {0.0, 0.0};
  actuator_.reset(gamma_);
  drive_train_.reset(brake_temperature_);
  front_tyre_.reset();
  rear_tyre_.reset();
  const double length = parameters_.tyre.contact_length;
  front_axle_.reset(road_ ? road_->mean(0.0, length) : 0.0);
  rear_axle_.reset(road_ ? road_->mean(-g.front_axle_to_hinge - g.rear_axle_to_hinge, length) : 0.0);
  motion_ = motion();
  accelerations_ = {0.0, 0.0, 0.0, 0.0};
  report();
}

void DynamicTruck::step(const PlantInput& input, const PlantSurroundings& surroundings, double dt) {
  checkStep(input, surroundings, dt);
  const int substeps = static_cast<int>(std::ceil(dt / kMaxSubstep - 1e-9));
  for (int i = 0; i < substeps; ++i) substep(input, surroundings, dt / substeps);
  report();
}

void DynamicTruck::substep(const PlantInput& input, const PlantSurroundings& surroundings, double dt) {
  actuator_.step(input.steering, motion_.front_x, dt);
  drive_train_.step(input.acceleration, motion_.front_x, dt);
  shake(dt);
  pushTyres(surroundings, dt);
  integrate(solve(surroundings.grade), dt);
}

DynamicTruck::Motion DynamicTruck::motion() const {
  const TruckGeometry& g = parameters_.geometry;
  Motion m;
  m.sin_heading = std::sin(heading_);
  m.cos_heading = std::cos(heading_);
  m.sin_gamma = std::sin(gamma_);
  m.cos_gamma = std::cos(gamma_);
  const double x = m.cos_heading * hinge_velocity_.x() + m.sin_heading * hinge_velocity_.y();
  const double y = -m.sin_heading * hinge_velocity_.x() + m.cos_heading * hinge_velocity_.y();
  m.front_x = x;
  m.front_y = y + g.front_axle_to_hinge * front_rate_;
  m.rear_x = x * m.cos_gamma - y * m.sin_gamma;
  m.rear_y = x * m.sin_gamma + y * m.cos_gamma - g.rear_axle_to_hinge * rear_rate_;
  return m;
}

// Road under both axles; the wheels' forces on the ground act below the centre of gravity and shift
// load.
void DynamicTruck::shake(double dt) {
  const TruckGeometry& g = parameters_.geometry;
  const double wheelbase = g.front_axle_to_hinge + g.rear_axle_to_hinge;
  way_ += motion_.front_x * dt;
  const double length = parameters_.tyre.contact_length;
  const double front_road = road_ ? road_->mean(way_, length) : 0.0;
  const double rear_road = road_ ? road_->mean(way_ - wheelbase, length) : 0.0;
  const double transfer = -(front_force_.x + rear_force_.x) * masses_.cg_height / wheelbase;
  front_axle_.step(front_road, transfer, dt);
  rear_axle_.step(rear_road, -transfer, dt);
}

void DynamicTruck::pushTyres(const PlantSurroundings& surroundings, double dt) {
  const double total = front_axle_.load() + rear_axle_.load();
  const double rolling = parameters_.drive.rolling_resistance;
  // Axles that steer by +-delta give the yaw rate g v sin(gamma) / (l_f cos(gamma) + l_r) at gain g.
  const double delta = (parameters_.tyre.yaw_gain - 1.0) * motion_.sin_gamma / (1.0 + motion_.cos_gamma);
  const auto push = [&](AxleTyre& tyre, double load, double x, double y, double steer) -> AxleForce {
    const double share = total > 0.0 ? load / total : 0.5;
    const AxleTyre::Force force = tyre.step(
        x + steer * y, y - steer * x, load, surroundings.friction_scale,
        share * drive_train_.brakeForce() + rolling * load, share * drive_train_.driveForce(), dt);
    return {force.along - steer * force.across, force.across + steer * force.along};
  };
  front_force_ = push(front_tyre_, front_axle_.load(), motion_.front_x, motion_.front_y, delta);
  rear_force_ = push(rear_tyre_, rear_axle_.load(), motion_.rear_x, motion_.rear_y, -delta);
}

double DynamicTruck::hingeTorque() const {
  const double gamma_rate = front_rate_ - rear_rate_;
  double torque = compliance_.stiffness * (actuator_.angle() - gamma_) +
                  compliance_.damping * (actuator_.rate() - gamma_rate);
  const double beyond = std::abs(gamma_) - parameters_.geometry.max_articulation;
  if (beyond > 0.0) {
    torque -= std::copysign(kStopStiffness * compliance_.stiffness * beyond, gamma_) +
              kStopDamping * compliance_.damping * gamma_rate;
  }
  return torque;
}

// M q'' = Q in axes that coincide with the front body's (theta_f = 0, theta_r = -gamma); the hinge's
// acceleration is eliminated, which leaves two equations for the bodies' angular accelerations.
DynamicTruck::Accelerations DynamicTruck::solve(double grade) const {
  const double m = inertia_.mass;
  const double b_f = inertia_.front_moment;
  const double b_r = inertia_.rear_moment;
  const double s = motion_.sin_gamma;
  const double c = motion_.cos_gamma;
  const double downhill = -kGravity * std::sin(grade);  // gravity along the front body [m/s^2]
  const double front_spin = b_f * front_rate_ * front_rate_;
  const double rear_spin = b_r * rear_rate_ * rear_rate_;
  const double torque = hingeTorque();

  const double q_x =
      front_force_.x + rear_force_.x * c + rear_force_.y * s + m * downhill + front_spin - rear_spin * c;
  const double q_y = front_force_.y - rear_force_.x * s + rear_force_.y * c + rear_spin * s;
  const double q_f = parameters_.geometry.front_axle_to_hinge * front_force_.y + torque;
  const double q_r =
      -parameters_.geometry.rear_axle_to_hinge * rear_force_.y - torque - b_r * s * downhill;

  const double m_ff = inertia_.front;
  const double m_rr = inertia_.rear;
  const double m_fr = b_f * b_r * c / m;
  const double p_f = q_f - b_f * q_y / m;
  const double p_r = q_r + b_r * (s * q_x + c * q_y) / m;
  const double inverse = 1.0 / (m_ff * m_rr - m_fr * m_fr);
  Accelerations a;
  a.front = (m_rr * p_f - m_fr * p_r) * inverse;
  a.rear = (m_ff * p_r - m_fr * p_f) * inverse;
  a.x = (q_x + b_r * s * a.rear) / m;
  a.y = (q_y - b_f * a.front + b_r * c * a.rear) / m;
  return a;
}

void DynamicTruck::integrate(const Accelerations& a, double dt) {
  hinge_velocity_ += dt * geometry::Point(motion_.cos_heading * a.x - motion_.sin_heading * a.y,
                                          motion_.sin_heading * a.x + motion_.cos_heading * a.y);
  front_rate_ += dt * a.front;
  rear_rate_ += dt * a.rear;
  hinge_ += dt * hinge_velocity_;
  heading_ = wrapOnce(heading_ + dt * front_rate_);
  gamma_ += dt * (front_rate_ - rear_rate_);
  motion_ = motion();
  accelerations_ = a;
}

void DynamicTruck::report() {
  const TruckGeometry& g = parameters_.geometry;
  const Motion& now = motion_;
  const Accelerations& a = accelerations_;
  state_.pose = {hinge_.x() + g.front_axle_to_hinge * now.cos_heading,
                 hinge_.y() + g.front_axle_to_hinge * now.sin_heading, heading_};
  state_.articulation = gamma_;
  state_.articulation_rate = front_rate_ - rear_rate_;
  state_.speed = now.front_x;
  state_.lateral_speed = now.front_y;
  state_.yaw_rate = front_rate_;
  state_.acceleration = a.x - g.front_axle_to_hinge * front_rate_ * front_rate_;
  state_.lateral_acceleration = a.y + g.front_axle_to_hinge * a.front;
  state_.pitch = (rear_axle_.bodyHeight() - front_axle_.bodyHeight()) /
                 (g.front_axle_to_hinge + g.rear_axle_to_hinge);
  details_.actuator_articulation = actuator_.angle();
  details_.front_load = front_axle_.load();
  details_.rear_load = rear_axle_.load();
  details_.front_slip_speed = now.front_y;
  details_.rear_slip_speed = now.rear_y;
  details_.brake_temperature = drive_train_.brakeTemperature();
}

double DynamicTruck::energy() const {
  const Motion& now = motion_;
  const TruckGeometry& g = parameters_.geometry;
  // Centres of gravity, from the axles' speeds along and across each body.
  const double front_y = now.front_y + (masses_.front_cg_offset - g.front_axle_to_hinge) * front_rate_;
  const double rear_y = now.rear_y + (g.rear_axle_to_hinge - masses_.rear_cg_offset) * rear_rate_;
  const double kinetic = 0.5 * masses_.front * (now.front_x * now.front_x + front_y * front_y) +
                         0.5 * masses_.rear * (now.rear_x * now.rear_x + rear_y * rear_y) +
                         0.5 * masses_.front_inertia * front_rate_ * front_rate_ +
                         0.5 * masses_.rear_inertia * rear_rate_ * rear_rate_;
  const double wound = actuator_.angle() - gamma_;
  return kinetic + 0.5 * compliance_.stiffness * wound * wound + front_tyre_.storedEnergy() +
         rear_tyre_.storedEnergy();
}

}  // namespace tunnel_pilot::vehicle
