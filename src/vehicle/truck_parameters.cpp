#include "tunnel_pilot/vehicle/truck_parameters.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "tunnel_pilot/vehicle/hinge_compliance.h"

namespace tunnel_pilot::vehicle {
namespace {

TruckGeometry loadGeometry(config::Node node) {
  TruckGeometry g{};
  g.front_axle_to_hinge = node.number("front_axle_to_hinge", "m", 0.5, 10.0);
  g.rear_axle_to_hinge = node.number("rear_axle_to_hinge", "m", 0.5, 10.0);
  g.overall_width = node.number("overall_width", "m", 1.0, 8.0);
  g.track = node.number("track", "m", 0.5, g.overall_width);
  g.front_overhang = node.number("front_overhang", "m", 0.0, 6.0);
  g.rear_overhang = node.number("rear_overhang", "m", 0.0, 6.0);
  g.max_articulation = node.number("max_articulation", "rad", 0.1, 1.2);
  g.tyre_free_radius = node.number("tyre_free_radius", "m", 0.2, 2.5);
  g.tyre_rolling_radius = node.number("tyre_rolling_radius", "m", 0.2, g.tyre_free_radius);
  g.tyre_width = node.number("tyre_width", "m", 0.1, 1.5);
  g.lidar_x = node.number("lidar_x", "m", -5.0, 6.0);
  g.lidar_y = node.number("lidar_y", "m", -4.0, 4.0);
  g.lidar_z = node.number("lidar_z", "m", 0.1, 5.0);
  node.finish();
  return g;
}

TruckMasses loadMasses(config::Node node) {
  TruckMasses m{};
  m.front = node.number("front", "kg", 1e3, 3e5);
  m.rear = node.number("rear", "kg", 1e3, 3e5);
  m.front_inertia = node.number("front_inertia", "kg m^2", 1e3, 1e7);
  m.rear_inertia = node.number("rear_inertia", "kg m^2", 1e3, 1e7);
  m.front_cg_offset = node.number("front_cg_offset", "m", 0.0, 10.0);
  m.rear_cg_offset = node.number("rear_cg_offset", "m", 0.0, 10.0);
  m.cg_height = node.number("cg_height", "m", 0.2, 5.0);
  node.finish();
  return m;
}

HydraulicSteering loadSteering(config::Node node) {
  HydraulicSteering s{};
  s.dead_time = node.number("dead_time", "s", 0.0, 1.0);
  s.dead_band = node.number("dead_band", "rad", 0.0, 0.1);
  s.max_rate = node.number("max_rate", "rad/s", 0.01, 2.0);
  s.idle_rate = node.number("idle_rate", "rad/s", 0.01, s.max_rate);
  s.working_speed = node.number("working_speed", "m/s", 0.01, 20.0);
  s.lag = node.number("lag", "s", 0.01, 2.0);
  s.compliance_frequency = node.number("compliance_frequency", "Hz", 0.3, 5.0);
  s.compliance_damping = node.number("compliance_damping", "1", 0.02, 0.9);
  s.compliance_speed = node.number("compliance_speed", "m/s", 0.1, 20.0);
  node.finish();
  return s;
}

TyreParameters loadTyre(config::Node node) {
  TyreParameters t{};
  t.cornering_coefficient = node.number("cornering_coefficient", "1/rad", 1.0, 30.0);
  t.relaxation_length = node.number("relaxation_length", "m", 0.1, 3.0);
  t.friction = node.number("friction", "1", 0.05, 1.5);
  t.longitudinal_stiffness = node.number("longitudinal_stiffness", "N/m", 1e6, 3e7);
  t.contact_length = node.number("contact_length", "m", 0.05, 1.0);
  t.yaw_gain = node.number("yaw_gain", "1", 0.5, 1.5);
  node.finish();
  return t;
}

DriveAndBrakes loadDrive(config::Node node) {
  DriveAndBrakes d{};
  d.max_speed = node.number("max_speed", "m/s", 0.5, 30.0);
  d.drive_acceleration = node.number("drive_acceleration", "m/s^2", 0.05, 5.0);
  d.drive_lag = node.number("drive_lag", "s", 0.01, 3.0);
  d.brake_deceleration = node.number("brake_deceleration", "m/s^2", 0.5, 10.0);
  d.brake_lag = node.number("brake_lag", "s", 0.01, 3.0);
  d.brake_fade = node.number("brake_fade", "1", 0.0, 0.9);
  d.brake_fade_temperature = node.number("brake_fade_temperature", "K", 10.0, 2000.0);
  d.brake_heat_capacity = node.number("brake_heat_capacity", "J/K", 1e3, 1e8);
  d.brake_cooling_time = node.number("brake_cooling_time", "s", 1.0, 1e5);
  d.rolling_resistance = node.number("rolling_resistance", "1", 0.0, 0.2);
  node.finish();
  return d;
}

// The ranges keep every mode of the axle well inside what a 1 ms step can integrate.
AxleSuspension loadSuspension(config::Node node) {
  AxleSuspension a{};
  a.unsprung_mass = node.number("unsprung_mass", "kg", 500.0, 5e4);
  a.stiffness = node.number("stiffness", "N/m", 1e5, 3e7);
  a.damping = node.number("damping", "N s/m", 1e3, 3e5);
  a.tyre_stiffness = node.number("tyre_stiffness", "N/m", 1e5, 3e7);
  node.finish();
  return a;
}

// Both axles must carry more than their own unsprung mass, or the truck lies on its nose or tail.
void checkBalance(const config::Node& node, const TruckParameters& truck, Load load) {
  const AxleLoads axles = staticAxleLoads(truck, load);
  const std::string key = load == Load::kEmpty ? "empty" : "loaded";
  if (axles.front < truck.front_suspension.unsprung_mass * kGravity) {
    node.refuse(key,
                "leaves less than the unsprung mass on the front axle: masses or CG offsets are wrong");
  }
  if (axles.rear < truck.rear_suspension.unsprung_mass * kGravity) {
    node.refuse(key,
                "leaves less than the unsprung mass on the rear axle: masses or CG offsets are wrong");
  }
}

void checkCompliance(const config::Node& node, const TruckParameters& truck) {
  try {
    hingeCompliance(truck);
  } catch (const std::invalid_argument& e) {
    node.refuse("steering", std::string("cannot be: ") + e.what());
  }
}

}  // namespace

AxleLoads staticAxleLoads(const TruckParameters& truck, Load load) {
  const TruckMasses& m = truck.masses(load);
  const double l_f = truck.geometry.front_axle_to_hinge;
  const double l_r = truck.geometry.rear_axle_to_hinge;
  const double front =
      (m.front * (l_r + m.front_cg_offset) + m.rear * (l_r - m.rear_cg_offset)) / (l_f + l_r);
  return {front * kGravity, (m.front + m.rear - front) * kGravity};
}

TruckParameters loadTruck(config::Node node) {
  TruckParameters truck{};
  truck.name = node.text("name");
  truck.geometry = loadGeometry(node.child("geometry"));
  truck.empty = loadMasses(node.child("empty"));
  truck.loaded = loadMasses(node.child("loaded"));
  truck.steering = loadSteering(node.child("steering"));
  truck.tyre = loadTyre(node.child("tyre"));
  truck.drive = loadDrive(node.child("drive"));
  truck.front_suspension = loadSuspension(node.child("front_suspension"));
  truck.rear_suspension = loadSuspension(node.child("rear_suspension"));
  config::Node road = node.child("road");
  truck.road_roughness = road.number("roughness", "m^3", 0.0, 0.2);
  road.finish();
  node.finish();
  checkBalance(node, truck, Load::kEmpty);
  checkBalance(node, truck, Load::kLoaded);
  checkCompliance(node, truck);
  return truck;
}

TruckParameters loadTruck(const std::string& file) { return loadTruck(config::loadFile(file)); }

}  // namespace tunnel_pilot::vehicle
