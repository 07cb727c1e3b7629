#include "tunnel_pilot/learning/drive_collector.h"

#include <cmath>

namespace tunnel_pilot::learning {
namespace {

TruckBesideLine between(const TruckBesideLine& a, const TruckBesideLine& b, double share) {
  const auto mix = [share](double from, double to) { return from + share * (to - from); };
  return {mix(a.station, b.station),
          mix(a.offset, b.offset),
          mix(a.heading_error, b.heading_error),
          mix(a.articulation, b.articulation),
          mix(a.articulation_rate, b.articulation_rate),
          mix(a.speed, b.speed)};
}

}  // namespace

DriveCollector::DriveCollector(const simulation::Setup& setup, const TeacherParameters& teacher,
                               std::uint32_t tunnel)
    : teacher_(teacher, setup.pilot.preview_driver, setup.truck.geometry),
      delay_(fromSeconds(setup.pilot.preview_driver.truck.steering.transport_delay +
                         setup.pilot.preview_driver.truck.steering.dead_time)),
      tunnel_(tunnel) {}

void DriveCollector::afterScan(const simulation::Simulator& simulator, const simulation::Pilot& pilot) {
  const auto& filtered = pilot.perception().filtered();
  if (!filtered.accepted || !pilot.lidarDriver()) return;
  const drivers::TruckInputs& truck = pilot.lidarDriver()->truckInputs();
  Example example;
  example.ranges = filtered.network_scan.ranges;
  example.articulation = static_cast<float>(truck.articulation);
  example.articulation_ahead = static_cast<float>(truck.articulation_ahead);
  example.speed = static_cast<float>(truck.speed);
  example.yaw_gain = static_cast<float>(truck.yaw_gain);
  example.yaw_disturbance = static_cast<float>(truck.yaw_disturbance);
  example.steering_rate = static_cast<float>(truck.steering_rate);
  example.tunnel = tunnel_;
  pending_.push_back({simulator.now() + delay_, std::move(example)});
}

void DriveCollector::afterTruth(const simulation::Simulator& simulator) {
  const simulation::Truth& truth = simulator.truth();
  const TruckBesideLine now{truth.station,
                            truth.lateral_offset,
                            truth.heading_error,
                            truth.state.articulation,
                            truth.state.articulation_rate,
                            truth.state.speed};
  while (!pending_.empty() && pending_.front().due <= truth.stamp) {
    Pending pending = std::move(pending_.front());
    pending_.pop_front();
    if (!last_ || pending.due < last_stamp_) continue;
    Example& example = pending.example;
    const drivers::YawResponse believed{static_cast<double>(example.yaw_gain),
                                        static_cast<double>(example.yaw_disturbance)};
    teacher_.setMaxRate(static_cast<double>(example.steering_rate));
    const double share = toSeconds(pending.due - last_stamp_) / toSeconds(truth.stamp - last_stamp_);
    example.label = static_cast<float>(
        teacher_.command(simulator.world().design_line, between(*last_, now, share), believed));
    if (std::isfinite(example.label)) examples_.push_back(std::move(example));
  }
  last_ = now;
  last_stamp_ = truth.stamp;
}

}  // namespace tunnel_pilot::learning
