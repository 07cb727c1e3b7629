#include "tunnel_pilot/learning/drive_collector.h"

#include <cmath>

namespace tunnel_pilot::learning {

DriveCollector::DriveCollector(const simulation::Setup& setup, std::uint32_t tunnel)
    : teacher_(setup.pilot.preview_driver, setup.truck.geometry),
      delay_(fromSeconds(setup.pilot.preview_driver.truck.steering.transport_delay + setup.pilot.preview_driver.truck.steering.dead_time)),
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
  example.tunnel = tunnel_;
  pending_.push_back({simulator.now() + delay_, std::move(example)});
}

void DriveCollector::afterTruth(const simulation::Simulator& simulator) {
  const simulation::Truth& truth = simulator.truth();
  while (!pending_.empty() && pending_.front().due <= truth.stamp) {
    const TruckBesideLine truck{truth.station,
                                truth.lateral_offset,
                                truth.heading_error,
                                truth.state.articulation,
                                truth.state.articulation_rate,
                                truth.state.speed};
    // The truth is up to a period late: back to the very moment.
    const Example& seen = pending_.front().example;
    const drivers::YawResponse believed{static_cast<double>(seen.yaw_gain),
                                        static_cast<double>(seen.yaw_disturbance)};
    const TruckBesideLine then = teacher_.movedOn(simulator.world().design_line, truck, believed,
                                                  toSeconds(pending_.front().due - truth.stamp));
    Example example = std::move(pending_.front().example);
    pending_.pop_front();
    example.label = static_cast<float>(teacher_.command(simulator.world().design_line, then, believed));
    if (std::isfinite(example.label)) examples_.push_back(std::move(example));
  }
}

}  // namespace tunnel_pilot::learning
