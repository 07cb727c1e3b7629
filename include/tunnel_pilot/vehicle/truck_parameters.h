#pragma once

#include <string>

#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::vehicle {

/// Shape of a centre-articulated truck. Lengths are positive [m]; the reference point (base_link) lies on
/// the ground under the middle of the front axle.
struct TruckGeometry {
  double front_axle_to_hinge;  ///< l_f [m]
  double rear_axle_to_hinge;   ///< l_r [m]
  double track;                ///< between wheel centres of an axle [m]
  double overall_width;        ///< [m]
  double front_overhang;       ///< nose ahead of the front axle [m]
  double rear_overhang;        ///< tail behind the rear axle [m]
  double max_articulation;     ///< mechanical stop of |gamma| [rad]
  double tyre_free_radius;     ///< [m]
  double tyre_rolling_radius;  ///< [m]
  double lidar_x;              ///< lidar ahead of the front axle [m]
  double lidar_y;              ///< lidar left of the middle line [m]
  double lidar_z;              ///< lidar above ground [m]
};

/// One body pair's masses for a load state.
struct TruckMasses {
  double front;             ///< m_f [kg]
  double rear;              ///< m_r [kg]
  double front_inertia;     ///< I_f about its own CG [kg m^2]
  double rear_inertia;      ///< I_r about its own CG [kg m^2]
  double front_cg_offset;   ///< c_f, CG ahead of the hinge [m]
  double rear_cg_offset;    ///< c_r, CG behind the hinge [m]
  double cg_height;         ///< [m]
};

struct HydraulicSteering {
  double dead_time;            ///< [s]
  double dead_band;            ///< of the valve, on the articulation error [rad]
  double max_rate;             ///< [rad/s] at working engine speed
  double idle_rate;            ///< [rad/s] at idle
  double lag;                  ///< first order [s]
  double compliance_frequency; ///< hinge mode [Hz]
  double compliance_damping;   ///< damping ratio of the hinge mode [1]
};

struct TyreParameters {
  double cornering_coefficient;  ///< axle cornering stiffness over its load [1/rad]
  double relaxation_length;      ///< [m]
  double friction;               ///< mu [1]
};

struct DriveAndBrakes {
  double max_speed;           ///< [m/s]
  double drive_acceleration;  ///< on the flat, loaded [m/s^2]
  double brake_deceleration;  ///< on the flat, loaded [m/s^2]
  double brake_lag;           ///< [s]
  double rolling_resistance;  ///< resistance over weight [1]
};

enum class Load { kEmpty, kLoaded };

/// All that the truck models, the URDF, the envelope and the drivers know of one truck, from one YAML
/// file (config/truck.yaml).
struct TruckParameters {
  std::string name;
  TruckGeometry geometry;
  TruckMasses empty;
  TruckMasses loaded;
  HydraulicSteering steering;
  TyreParameters tyre;
  DriveAndBrakes drive;

  const TruckMasses& masses(Load load) const { return load == Load::kEmpty ? empty : loaded; }
};

/// Reads and checks a truck file. Throws config::ConfigError naming file, key, unit and range.
TruckParameters loadTruck(config::Node node);
TruckParameters loadTruck(const std::string& file);

}  // namespace tunnel_pilot::vehicle
