#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::world {

/// Stationary Gaussian process along a wall, autocorrelation exp(-(d / correlation_length)^2).
struct Roughness {
  double sigma = 0.0;               ///< standard deviation [m]
  double correlation_length = 1.0;  ///< [m]
};

/// Another distance between the walls over part of the line; both walls move alike.
struct Widening {
  double from = 0.0;   ///< arc length [m]
  double to = 0.0;     ///< arc length [m]
  double width = 0.0;  ///< between the tapers [m]
  double taper = 0.0;  ///< length of the change at either end, inside [from, to] [m]
};

/// A rectangular recess square to the line: a refuge or bay when shallow, a side drift when deep.
struct Opening {
  bool left = true;
  double at = 0.0;     ///< arc length of its middle [m]
  double width = 0.0;  ///< along the line [m]
  double depth = 0.0;  ///< from the wall to its face [m]
};

/// All that the walls of a tunnel are made from.
struct TunnelPlan {
  std::vector<geometry::PathPiece> pieces;
  bool closed = false;
  double width = 0.0;         ///< [m]
  double wall_spacing = 0.0;  ///< length of a wall segment [m]
  double separation = 0.0;    ///< least rock between separate parts of the tunnel [m]
  Roughness roughness;
  std::uint64_t seed = 0;
  std::vector<Widening> widenings;
  std::vector<Opening> openings;
};

/// The plan's walls, or why it has none: `conflict` is empty when they are sound.
struct TunnelWalls {
  std::vector<WallChain> chains;
  std::string conflict;
};
TunnelWalls buildWalls(const TunnelPlan& plan);

/// Distance between the walls at arc length `s` [m]: the plan's width and its widenings.
double widthAt(const TunnelPlan& plan, double s);

/// Random numbers that are the same with every standard library.
class Draws {
 public:
  /// `stream` keeps the uses of one seed apart.
  Draws(std::uint64_t seed, std::uint64_t stream);
  double uniform(double min, double max);
  double gaussian();

 private:
  std::mt19937_64 engine_;
};

/// Draws of a process with `roughness` at the arc lengths `s` [m] of a line of length `length` [m],
/// periodic when `closed`.
std::vector<double> roughnessAlong(const std::vector<double>& s, double length, bool closed,
                                   const Roughness& roughness, Draws& draws);

}  // namespace tunnel_pilot::world
