#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

namespace tunnel_pilot::vehicle {

/// An articulation at a time.
struct TimedAngle {
  double time;   ///< [s]
  double angle;  ///< [rad]
};

/// An uninterrupted stretch of driving: each command holds until the next one.
struct SteeringRecord {
  std::vector<TimedAngle> commanded;
  std::vector<TimedAngle> measured;
};

/// A number found in a record, or why the record cannot tell it.
struct Estimate {
  double value = 0.0;
  double deviation = 0.0;  ///< standard deviation, in the value's unit
  std::string refusal;     ///< empty: the value may be used
  bool known() const { return refusal.empty(); }
};

/// How a truck's steering answers its command.
struct SteeringFit {
  Estimate dead_time;            ///< from a command to its effect, all that lies between included [s]
  Estimate rate;                 ///< the fastest that the hydraulics turn the articulation [rad/s]
  Estimate lag;                  ///< first order [s]
  double dead_band = 0.0;        ///< full width, lost on a reversal [rad]
  double bias = 0.0;             ///< of the measured articulation against the command [rad]
  double hinge_frequency = 0.0;  ///< at which the bodies swing about the cylinders' angle [Hz]
  double hinge_damping = 0.0;    ///< ratio of that [1]
  double residual = 0.0;         ///< RMS of measurement less model [rad]
  double fastest = 0.0;          ///< that the articulation turned in this record [rad/s]
  std::size_t left = 0;          ///< steps of the command to the left: 2 deg within 0.25 s
  std::size_t right = 0;         ///< ... to the right
  std::size_t samples = 0;       ///< measurements that were explained
};

/// A record cannot tell how the steering answers; what() says why.
class CannotTell : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Which movements a fit explains.
enum class TurnDirection { kBoth, kLeft, kRight };

/// Finds the parameters of the steering's answer to commands u:
///   w = clamp(r, u(t - dead_time) +- dead_band / 2),  r' = clamp((w - r) / dt, +-rate),
///   a' = (r - a) / lag,  g'' = omega^2 (a - g) + 2 zeta omega (a' - g'),  measured = g + bias
/// (HydraulicActuator, the hinge's compliance as one mode; SteeringResponse in bridge/ without it) by
/// least squares over the simulated answer: grids, then Levenberg-Marquardt (Marquardt 1963) from each
/// of them. Without the hinge's mode its swing would be taken for dead time. All records explain one set
/// of parameters; the first 1.5 s of each only start the model. Deviations come from the sandwich
/// estimator with clusters of 2 s (Liang & Zeger 1986): what the model leaves over is no white noise. A
/// parameter whose deviation is too large to be of use (dead time 10 ms, rate 5 %, lag 6 %) is
/// refused; so is a rate without which the record is explained as well, or
/// one that is not clearly below what the command asked for.
class SteeringIdentification {
 public:
  /// Takes a stretch. Times must grow. Throws std::invalid_argument for numbers that are not finite,
  /// times that do not grow, angles beyond 90 deg; a stretch of less than 3 s is left out.
  void add(const SteeringRecord& record);

  /// Throws CannotTell with the reason when the record cannot tell how the steering answers: too
  /// short, too few steps, an articulation that does not follow or turns the wrong way. kLeft and kRight
  /// explain only what follows the command's steps to that side, with the bias and dead band of both.
  SteeringFit fit(TurnDirection direction = TurnDirection::kBoth) const;

  double duration() const { return duration_; }  ///< of what was taken [s]

 private:
  std::vector<SteeringRecord> records_;
  double duration_ = 0.0;
};

/// The rate at which the hydraulics turn the articulation, to either side [rad/s].
struct SweepRates {
  Estimate left;
  Estimate right;
};

/// Measures the rate without the pilot, from an operator's sweeps with the wheel held over: the slope of
/// the middle half of every sweep of 30 deg and more. Less than two sweeps to a side, or sweeps that
/// differ by more than a tenth, are refused. Throws std::invalid_argument as
/// SteeringIdentification::add.
SweepRates sweepRates(const std::vector<TimedAngle>& measured);

}  // namespace tunnel_pilot::vehicle
