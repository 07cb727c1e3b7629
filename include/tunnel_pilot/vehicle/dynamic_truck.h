#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "tunnel_pilot/vehicle/axle_tyre.h"
#include "tunnel_pilot/vehicle/drive_train.h"
#include "tunnel_pilot/vehicle/hinge_compliance.h"
#include "tunnel_pilot/vehicle/hydraulic_actuator.h"
#include "tunnel_pilot/vehicle/plant.h"
#include "tunnel_pilot/vehicle/quarter_truck.h"
#include "tunnel_pilot/vehicle/road_profile.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

struct DynamicTruckOptions {
  Load load = Load::kLoaded;
  std::uint64_t road_seed = 0;
  bool rough_road = true;          ///< false: a plane
  double brake_temperature = 0.0;  ///< above surroundings, at reset [K]
};

/// What a truck's own sensors do not tell, for tests and plots.
struct DynamicTruckDetails {
  double actuator_articulation = 0.0;  ///< gamma_a of the cylinders [rad]
  double front_load = 0.0;             ///< F_z [N]
  double rear_load = 0.0;              ///< F_z [N]
  double front_slip_speed = 0.0;       ///< across the front axle's wheels, leftwards [m/s]
  double rear_slip_speed = 0.0;        ///< [m/s]
  double brake_temperature = 0.0;      ///< above surroundings [K]
};

/// Two rigid bodies joined by the hinge, in the plane: q = (X, Y of the hinge, theta_f, theta_r).
///   M q'' = Q,  M symmetric with
///   M11 = M22 = m, M13 = -m_f c_f sin(theta_f), M14 = m_r c_r sin(theta_r),
///   M23 = m_f c_f cos(theta_f), M24 = -m_r c_r cos(theta_r),
///   M33 = I_f + m_f c_f^2, M44 = I_r + m_r c_r^2, M34 = 0
/// Q: tyre forces (AxleTyre), centripetal terms, gravity on a grade, and the hinge torque
///   T_s = k_s (gamma_a - gamma) + c_s (gamma_a' - gamma') on theta_f, its opposite on theta_r,
/// behind the hydraulics (HydraulicActuator, HingeCompliance) and against a stiff stop at
/// max_articulation. A rough road shakes both axles (RoadProfile, QuarterTruck), which makes the axle
/// loads ripple and the front body pitch; drive, brakes and grade shift load between the axles.
/// DriveTrain drives and brakes. Integrated in steps of at most 1 ms (semi-implicit Euler), without
/// allocation. Deterministic. Lengths [m], angles [rad], forces [N]. Derivation, sources and what was
/// chosen: docs/plant.md.
class DynamicTruck : public Plant {
 public:
  /// Throws std::invalid_argument when the snaking mode cannot be had (see hingeCompliance).
  DynamicTruck(const TruckParameters& parameters, const DynamicTruckOptions& options);

  void reset(const geometry::Pose& pose, double articulation, double speed) override;
  void step(const PlantInput& input, const PlantSurroundings& surroundings, double dt) override;
  const PlantState& state() const override { return state_; }

  const DynamicTruckDetails& details() const { return details_; }

  /// Kinetic energy of the plane motion and what springs of hinge and tyres hold [J].
  double energy() const;

 private:
  // Speeds at the axles and the trigonometry of the present configuration, x along each body.
  struct Motion {
    double sin_heading, cos_heading;  // of the front body
    double sin_gamma, cos_gamma;
    double front_x, front_y;  // of the front axle, in the front body's frame [m/s]
    double rear_x, rear_y;    // of the rear axle, in the rear body's frame [m/s]
  };
  // What the equations of motion need of the masses; moments about the hinge.
  struct Inertia {
    double mass;                       // of both bodies [kg]
    double front_moment, rear_moment;  // m_f c_f, m_r c_r [kg m]
    double front, rear;                // the hinge's acceleration eliminated [kg m^2]
  };
  // Resultant of one axle's tyres, in its body's frame [N].
  struct AxleForce {
    double x, y;
  };
  // Accelerations: of the hinge in the front body's frame [m/s^2], of both bodies [rad/s^2].
  struct Accelerations {
    double x, y, front, rear;
  };

  void substep(const PlantInput& input, const PlantSurroundings& surroundings, double dt);
  Motion motion() const;
  void shake(double dt);
  void pushTyres(const PlantSurroundings& surroundings, double dt);
  double hingeTorque() const;
  Accelerations solve(double grade) const;
  void integrate(const Accelerations& accelerations, double dt);
  void report();

  TruckParameters parameters_;
  TruckMasses masses_;
  Inertia inertia_;
  HingeCompliance compliance_;
  HydraulicActuator actuator_;
  DriveTrain drive_train_;
  AxleTyre front_tyre_;
  AxleTyre rear_tyre_;
  QuarterTruck front_axle_;
  QuarterTruck rear_axle_;
  std::shared_ptr<const RoadProfile> road_;  // none: a plane
  double brake_temperature_;

  geometry::Point hinge_{0.0, 0.0};           // map frame [m]
  geometry::Point hinge_velocity_{0.0, 0.0};  // map frame [m/s]
  double heading_ = 0.0;                      // theta_f, wrapped [rad]
  double gamma_ = 0.0;                        // theta_f - theta_r [rad]
  double front_rate_ = 0.0;                   // [rad/s]
  double rear_rate_ = 0.0;                    // [rad/s]
  double way_ = 0.0;                          // driven by the front axle [m]
  AxleForce front_force_{0.0, 0.0};
  AxleForce rear_force_{0.0, 0.0};
  Motion motion_;                // of the above
  Accelerations accelerations_;  // of the last step
  PlantState state_;
  DynamicTruckDetails details_;
};

}  // namespace tunnel_pilot::vehicle
