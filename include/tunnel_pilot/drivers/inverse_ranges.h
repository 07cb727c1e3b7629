#pragma once

#include <vector>

namespace tunnel_pilot::drivers {

/// Fills `inverse` with 1/r of each beam [1/m]. Beams without a return (not finite, or not positive) are
/// bridged: between two returns 1/r runs linearly, as along a wall; before the first and behind the last
/// it stays. False when there is no return at all. Allocates nothing when `inverse` has the size of
/// `ranges`.
bool invertRanges(const std::vector<float>& ranges, std::vector<float>& inverse);

}  // namespace tunnel_pilot::drivers
