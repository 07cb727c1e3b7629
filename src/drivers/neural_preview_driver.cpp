#include "tunnel_pilot/drivers/neural_preview_driver.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_cursor.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr int kPreviewSteps = 12;

const neural::NetworkFile& given(const std::shared_ptr<const neural::NetworkFile>& network) {
  if (network == nullptr) throw config::ConfigError("the preview driver was given no network");
  return *network;
}

}  // namespace

double roadPreview(const geometry::Path& path, double s, double distance) {
  PathCursor cursor(path, s);
  const double direction = cursor.headingAt(s);
  const double step = distance / kPreviewSteps;
  double slope = 0.0;
  double position = 0.0;
  double sum = 0.0;
  double norm = 0.0;
  for (int i = 1; i <= kPreviewSteps; ++i) {
    const double next_slope = cursor.headingAt(s + i * step) - direction;
    position += 0.5 * (slope + next_slope) * step;
    slope = next_slope;
    const double share = static_cast<double>(i) / kPreviewSteps;
    const double weight = (i == kPreviewSteps ? 0.5 : 1.0) * share * share;
    sum += weight * position;
    norm += weight * share * share;
  }
  return sum / norm;  // on an arc this is its position at T_p, as the integral is
}

NeuralPreviewDriver::NeuralPreviewDriver(const PreviewDriverParameters& parameters,
                                         const vehicle::TruckGeometry& geometry)
    : parameters_(parameters),
      predictor_(parameters.truck, geometry),
      network_(given(parameters.network), parameters.network_law.adaptation) {}

void NeuralPreviewDriver::reset() {
  predictor_.reset();
  network_.reset();
}

Proposal NeuralPreviewDriver::propose(const perception::Tunnel& tunnel, const Motion& motion,
                                      Stamp now) {
  Proposal proposal;
  proposal.stamp = tunnel.state.stamp;
  const std::optional<PathState> start = predictor_.predict(tunnel, motion, now);
  if (!start) return proposal;

  const double elapsed = predictor_.elapsed(now);
  const double speed = std::max(motion.speed, parameters_.planning_speed);
  const double pace = std::max(speed, parameters_.network_law.least_pace);
  const double slower = kNetworkSpeed / pace;
  const double wanted = slower * slower * network_.run(inputsAt(*start, tunnel.centerline, pace));
  network_.learn(-start->offset, elapsed / parameters_.preview_time);
  const double corrected = start->articulation + parameters_.network_law.correction_time *
                                                     turnTowards(wanted, start->articulation, speed);
  if (!std::isfinite(corrected)) return proposal;
  const double most =
      parameters_.truck.steering.max_rate * elapsed;  // nothing is planned with a slower one

  proposal.valid = true;
  proposal.articulation_angle =
      predictor_.give(std::clamp(corrected, start->command - most, start->command + most), *start, now);
  proposal.speed = parameters_.speed;
  proposal.confidence = confidence(tunnel.state);
  const geometry::PathPoint ahead =
      tunnel.centerline.at(predictor_.footPoint() + pace * parameters_.preview_time);
  proposal.preview_point = geometry::Point(ahead.x, ahead.y);
  return proposal;
}

PreviewInputs NeuralPreviewDriver::inputsAt(const PathState& place, const geometry::Path& path,
                                            double speed) const {
  const TruckResponse& truck = predictor_.truck();
  const YawResponse learned = predictor_.learned();
  const double arm = truck.geometry.front_axle_to_hinge * std::cos(place.articulation) +
                     truck.geometry.rear_axle_to_hinge;
  const double turning = learned.gain * std::sin(place.articulation) / arm + learned.disturbance;
  const double slip = -truck.slip_compliance * speed * speed * turning +
                      (learned.gain - 1.0) * std::tan(0.5 * place.articulation);
  PreviewInputs inputs{};
  inputs.road_preview = roadPreview(path, place.s, speed * parameters_.preview_time);
  inputs.lateral_acceleration = speed * speed * turning;
  inputs.lateral_speed = speed * std::sin(place.heading_error + slip);
  inputs.lateral_position = place.offset;
  return inputs;
}

double NeuralPreviewDriver::turnTowards(double wanted, double articulation, double speed) const {
  const TruckResponse& truck = predictor_.truck();
  const YawResponse learned = predictor_.learned();
  const double front = truck.geometry.front_axle_to_hinge;
  const double rear = truck.geometry.rear_axle_to_hinge;
  const double arm = front * std::cos(articulation) + rear;
  const double rate =
      speed *
      ((wanted / (front + rear) - learned.disturbance) * arm - learned.gain * std::sin(articulation)) /
      rear;
  const double most = parameters_.truck.steering.max_rate;
  return std::clamp(rate, -most, most);
}

}  // namespace tunnel_pilot::drivers
