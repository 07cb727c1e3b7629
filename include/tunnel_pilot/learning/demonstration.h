#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/steering_estimator.h"
#include "tunnel_pilot/drivers/yaw_observer.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::learning {

struct DemonstrationParameters {
  double seen_after;   ///< a scan's stamp, until a driver has it before him [s]
  double acts_after;   ///< a command given, until the truck begins to answer it [s]
  double label_after;  ///< a scan's stamp, until the articulation shows what was demanded for it [s]
  double lag;          ///< of the articulation behind its command, first order [s]
  double least_speed;  ///< slower, nothing is taught, nor in reverse [m/s]
  double max_rate;     ///< that the articulation is believed to reach [rad/s]
  drivers::YawObserverParameters yaw;
};

/// What the driver believes of the truck tells the delays: seen_after = `scan_delay`, acts_after =
/// transport delay and dead time, label_after all of them and the lag.
DemonstrationParameters demonstrationParameters(const drivers::SteeringEstimatorParameters& steering,
                                                double scan_delay);

/// A moment of somebody's drive.
struct Lesson {
  Example example;  ///< labelled with his articulation
  /// To be added to the label, to steer to the centre of the tunnel instead of where he drove [rad];
  /// none where the tunnel was not measured long enough.
  std::optional<float> correction;
  float offset = 0.0F;  ///< left of the middle when his demand began to act; with a correction only [m]
};

/// Turns a drive of anybody, recorded or simulated, into lessons, from measurements alone. A driver's
/// label is his articulation after the truck's delays: what he demanded when he saw the scan.
///
/// The correction. He who cuts bends teaches that: mirroring the examples takes away what is biased to
/// the left or to the right, but an inside cut looks the same in a mirror. His offset e from the middle
/// of the tunnel is measured, though, at each scan, and his course error chi beside it is its slope,
/// sin(chi) = e' (' is per metre driven), which no slip and no error of a measured heading falsifies.
/// Had he driven along the middle, his front axle's way would have had less curvature by
///   chi' + e kappa^2    (a way inside of a bend is tighter by e kappa^2),
/// and his articulation, by the exact curvature inversion (vehicle::articulationSlope) made linear, less
/// by
///   g,  with  l_r g' = (l_f + l_r) (chi' + e kappa^2) - g.
/// label - g is what he would have demanded in the middle, on the same ground with the same truck. To it
/// comes what leads from where he was when his demand began to act back to the middle: the state
/// (e, eta = chi - l_r g / (l_f + l_r), g) obeys, with lambda = speed lag, for small errors
///   e' = eta + l_r g / (l_f + l_r),  eta' = g / (l_f + l_r),  lambda g' = u - g,
/// and u = -k_e e - k_eta eta - k_g g with a triple pole at -1 / kReturn gives
///   k_e = (l_f + l_r) lambda / kReturn^3,  k_eta = 3 (l_f + l_r) lambda / kReturn^2 - l_r k_e,
///   k_g = 3 lambda / kReturn - 1.
/// The driver's own feedback about his own line is in his articulation and in g alike and goes out with
/// g: subtracting a share of e alone would leave it in, and with it a part of his offset.
class Demonstration {
 public:
  static constexpr double kReturn = 2.5;  ///< [m]

  Demonstration(const DemonstrationParameters& parameters, const vehicle::TruckGeometry& truck);

  /// Motions and scans in the order of their stamps; older ones than the last are ignored. Whoever sees
  /// a clock jump calls reset().
  void addMotion(const drivers::Motion& motion);
  /// `scan` is the filter's network scan; `offset` [m] left of the tunnel's middle where it was
  /// measured.
  void addScan(const geometry::Scan& scan, const std::optional<double>& offset, std::uint32_t tunnel);

  /// Forgets everything but the lessons.
  void reset();

  /// The lessons complete since the last call.
  std::vector<Lesson> take();

 private:
  struct Moment {
    drivers::Motion motion;
    drivers::YawResponse yaw;
  };
  struct Place {  ///< measured
    Stamp stamp{};
    double offset = 0.0;
  };
  struct Deviation {  ///< from the middle of the tunnel
    Stamp stamp{};
    double offset = 0.0;        ///< e [m]
    double course = 0.0;        ///< chi [rad]
    double articulation = 0.0;  ///< g [rad]
    double way = 0.0;           ///< driven since it is measured without a gap [m]
  };
  struct Pending {
    Stamp stamp{};
    Example example;
  };

  std::optional<Moment> momentAt(Stamp stamp) const;
  std::optional<Deviation> deviationAt(Stamp stamp) const;
  void measureDeviations();
  std::optional<Deviation> fitted(std::size_t middle) const;
  void finishPending();
  std::optional<Lesson> lessonOf(Pending& pending) const;
  void correct(Stamp scan, Lesson& lesson) const;
  void forgetOld();

  DemonstrationParameters parameters_;
  vehicle::TruckGeometry truck_;
  drivers::YawObserver yaw_;
  std::deque<Moment> motions_;
  std::deque<Place> places_;    ///< of the scans
  std::size_t next_place_ = 0;  ///< the first one without a deviation
  std::deque<Deviation> deviations_;
  std::deque<Pending> pending_;
  std::vector<Lesson> lessons_;
};

}  // namespace tunnel_pilot::learning
