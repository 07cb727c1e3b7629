#pragma once

#include <cstdint>
#include <vector>

namespace tunnel_pilot::vehicle {

/// Vertical profile of a rough road after ISO 8608: one-sided displacement spectrum
///   G_d(n) = G_d(n0) (n / n0)^-2, n0 = 0.1 cycles/m,
/// class E: G_d(n0) from 2048e-6 to 8192e-6 m^3, geometric mean 4096e-6 m^3. A spectrum of slope -2 is a
/// random walk: its increments over a spacing D are independent with variance 2 pi^2 n0^2 G_d(n0) D. The
/// profile is a closed loop of period(), so that any way can be driven; its loop hides wavelengths
/// beyond a few hundred metres. Seeded; the same seed gives the same road.
class RoadProfile {
 public:
  /// `roughness` is G_d(n0) [m^3].
  RoadProfile(double roughness, std::uint64_t seed);

  /// Height [m] at way `s` [m], any real number.
  double elevation(double s) const;

  /// Height averaged over a footprint of `length` > 0 [m] around `s`, as a tyre feels it [m].
  double mean(double s, double length) const;

  /// Way after which the road repeats [m].
  double period() const;

 private:
  double integral(double s) const;

  std::vector<double> height_;  // at multiples of the spacing [m]
  std::vector<double>
      integral_;  // of height_ from 0 to there [m^2]; its last entry is 0: no mean height
};

}  // namespace tunnel_pilot::vehicle
