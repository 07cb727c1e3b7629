#pragma once

#include <string>

#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::vehicle {

/// Shape of a centre-articulated truck. Lengths are positive [m]; the reference point (base_link) lies
/// on the ground under the middle of the front axle.
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
  double tyre_width;           ///< [m]
  double lidar_x;              ///< lidar ahead of the front axle [m]
  double lidar_y;              ///< lidar left of the middle line [m]
  double lidar_z;              ///< lidar above ground [m]
};

/// One body pair's masses for a load state.
struct TruckMasses {
  double front;            ///< m_f [kg]
  double rear;             ///< m_r [kg]
  double front_inertia;    ///< I_f about its own CG [kg m^2]
  double rear_inertia;     ///< I_r about its own CG [kg m^2]
  double front_cg_offset;  ///< c_f, CG ahead of the hinge [m]
  double rear_cg_offset;   ///< c_r, CG behind the hinge [m]
  double cg_height;        ///< [m]
};

struct HydraulicSteering {
  double dead_time;             ///< [s]
  double dead_band;             ///< full width of the valve's band, lost on a reversal (ISA 51.1) [rad]
  double max_rate;              ///< flow limit at working engine speed [rad/s]
  double idle_rate;             ///< flow limit at idle [rad/s]
  double working_speed;         ///< from here on the engine runs at working speed; at 0 it idles [m/s]
  double lag;                   ///< first order [s]
  double compliance_frequency;  ///< snaking (hinge) mode of the loaded truck [Hz]
  double compliance_damping;    ///< damping ratio of that mode [1]
  double compliance_speed;      ///< speed at which the mode has these values [m/s]
};

struct TyreParameters {
  double cornering_coefficient;   ///< axle cornering stiffness over its load [1/rad]
  double relaxation_length;       ///< [m]
  double friction;                ///< mu [1]
  double longitudinal_stiffness;  ///< of an axle wound up at standstill [N/m]
  double contact_length;          ///< footprint over which the road's roughness is averaged [m]
  double yaw_gain;  ///< yaw rate over the no-slip yaw rate at creeping speed; 1: axles do not steer [1]
};

struct DriveAndBrakes {
  double max_speed;               ///< [m/s]
  double drive_acceleration;      ///< highest on the flat, loaded [m/s^2]
  double drive_lag;               ///< first order [s]
  double brake_deceleration;      ///< highest on the flat, loaded, brakes cold [m/s^2]
  double brake_lag;               ///< first order [s]
  double brake_fade;              ///< share of the brake force lost when hot [1]
  double brake_fade_temperature;  ///< above surroundings, at which the fade is complete [K]
  double brake_heat_capacity;     ///< all brakes together [J/K]
  double brake_cooling_time;      ///< [s]
  double rolling_resistance;      ///< resistance over weight [1]
};

/// Springs of a whole axle: road - tyre - unsprung mass - suspension - sprung mass (a quarter-truck).
struct AxleSuspension {
  double unsprung_mass;   ///< [kg]
  double stiffness;       ///< [N/m]
  double damping;         ///< [N s/m]
  double tyre_stiffness;  ///< [N/m]
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
  AxleSuspension front_suspension;
  AxleSuspension rear_suspension;
  double road_roughness;  ///< ISO 8608 G_d at 0.1 cycles a metre [m^3]

  const TruckMasses& masses(Load load) const { return load == Load::kEmpty ? empty : loaded; }
};

constexpr double kGravity = 9.81;  ///< [m/s^2]

/// Weight that rests on each axle of the straight, standing truck [N].
struct AxleLoads {
  double front;
  double rear;
};
AxleLoads staticAxleLoads(const TruckParameters& truck, Load load);

/// Reads and checks a truck file. Throws config::ConfigError naming file, key, unit and range.
TruckParameters loadTruck(config::Node node);
TruckParameters loadTruck(const std::string& file);

}  // namespace tunnel_pilot::vehicle
