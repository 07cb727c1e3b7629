#include "tunnel_pilot/learning/drive_collector.h"

#include <cmath>

namespace tunnel_pilot::learning {

DriveCollector::DriveCollector(const simulation::Setup& setup, std::uint32_t tunnel)
    : teacher_(setup.pilot.preview_driver, setup.truck.geometry),
      delay_(fromSeconds(setup.pilot.preview_driver.transport_delay + setup.pilot.preview_driver.dead_time)),
      tunnel_(tunnel) {}

void DriveCollector::afterScan(const simulation::Simulator& simulator, const simulation::Pilot& pilot) {
  const auto& filtered = pilot.perception().filtered();
  const drivers::Motion& motion = pilot.bridge().motion();
  if (!filtered.accepted) return;
  Example example;
  example.ranges = filtered.network_scan.ranges;
  example.articulation = static_cast<float>(motion.articulation);
  example.articulation_rate = static_cast<float>(motion.articulation_rate);
  example.speed = static_cast<float>(motion.speed);
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
    const TruckBesideLine then = teacher_.movedOn(simulator.world().design_line, truck,
                                                  toSeconds(pending_.front().due - truth.stamp));
    Example example = std::move(pending_.front().example);
    pending_.pop_front();
    example.label = static_cast<float>(teacher_.command(simulator.world().design_line, then));
    if (std::isfinite(example.label)) examples_.push_back(std::move(example));
  }
}

}  // namespace tunnel_pilot::learning
