#pragma once

#include <cstdint>

#include "tunnel_pilot/drivers/preview_driver.h"
#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/simulation/simulator.h"

namespace tunnel_pilot::learning {

/// How a human drives.
struct HumanHabit {
  double cut = 0.42;       ///< his line lies this far inside of tight bends [m]
  double turn_in = 3.0;    ///< he goes there so far before the bend [m]
  double weave = 0.5;      ///< he wanders, at most so far [m]
  double most = 0.65;      ///< both together never take him farther from the middle: the walls [m]
  double speed_min = 2.4;  ///< of the speed that he holds, one for each drive [m/s]
  double speed_max = 3.1;
};

/// The line that he likes to drive: the tunnel's design line, moved to the inside of bends in proportion
/// to their curvature (at most by the cut, from radii of 25 m on), and by his weave, two slow waves of
/// random length and phase.
geometry::Path humanLine(const geometry::Path& design_line, const HumanHabit& habit, std::uint64_t seed);

/// A simulated human at the wheel, who cuts bends as the one of paper 000 did. He sees the tunnel as it
/// is, for he has eyes, and follows his own line (humanLine) with the skill of PreviewDriver.
class HumanDriver {
 public:
  /// The line must outlive the driver.
  HumanDriver(const geometry::Path& line, const drivers::PreviewDriverParameters& parameters,
              const vehicle::TruckGeometry& truck);

  /// What he demands [rad], looking up from the truck where it is.
  double steer(const simulation::Truth& truth, const drivers::Motion& motion, Stamp now);

 private:
  const geometry::Path* line_;
  drivers::PreviewDriver driver_;
  double station_ = -1.0;  ///< on his line; negative before the first look [m]
  double demand_ = 0.0;    ///< [rad]
};

}  // namespace tunnel_pilot::learning
