#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/simulation/clearance_meter.h"
#include "tunnel_pilot/simulation/lidar_model.h"
#include "tunnel_pilot/simulation/line_tracker.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/simulation/sensors.h"
#include "tunnel_pilot/simulation/truck_controller.h"
#include "tunnel_pilot/vehicle/plant.h"
#include "tunnel_pilot/world/ray_caster.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::simulation {

/// All values of config/simulator.yaml.
struct SimulatorParameters {
  double step;         ///< fixed step of plant and truck controller [s]
  double truth_rate;   ///< ground truth, clearance and contacts [Hz]
  double sensor_rate;  ///< readings of the truck's own sensors [Hz]
  LidarParameters lidar;
  SensorParameters articulation;       ///< [rad]
  SensorParameters articulation_rate;  ///< [rad/s]
  SensorParameters speed;              ///< [m/s]
  SensorParameters gyro;               ///< [rad/s]
  SensorParameters accelerometer;      ///< [m/s^2]
};

/// Throws config::ConfigError.
SimulatorParameters loadSimulator(config::Node node);

/// Ground truth (the content of SimulatorTruth.msg).
struct Truth {
  Stamp stamp{};
  vehicle::PlantState state;
  bool on_design_line = false;  ///< false in a world without one: the next four mean nothing
  double station = 0.0;         ///< grows without wrapping [m]
  double lateral_offset = 0.0;  ///< left of the design line [m]
  double heading_error = 0.0;   ///< [rad]
  double curvature = 0.0;       ///< of the design line [1/m]
  double clearance = 0.0;       ///< of either body to a wall or an obstacle [m]
  std::uint32_t contacts = 0;   ///< so far
};

/// A body that touched something just now.
struct Contact {
  Stamp stamp{};
  bool front = false;  ///< front body, otherwise the rear one
};

/// The truck in its world: plant, its own controller behind a CAN bus, sensors and lidar. Advances by a
/// fixed step; every random draw comes from one seed, so the same calls give the same frames and scans.
/// The pilot's side of it is the bus and the delivered scans, nothing else. Bodies do not bounce: a
/// contact is told and counted, and the truck drives on through the wall.
class Simulator {
 public:
  /// `plant` is what moves; the truck's parameters give its geometry. The bus must outlive the
  /// simulator.
  Simulator(const SimulatorParameters& parameters, const TruckControllerParameters& controller,
            const vehicle::TruckParameters& truck, std::unique_ptr<vehicle::Plant> plant,
            vehicle::Load load, world::World world, std::uint64_t seed, can::Bus& bus);
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  /// Puts the truck somewhere, at rest but for `speed` [m/s]. Time goes on; scans under way are lost,
  /// and the truck obeys nobody until it is engaged anew.
  void place(const geometry::Pose& pose, double speed = 0.0);

  /// What one step brought.
  struct Events {
    const geometry::Scan* scan = nullptr;  ///< delivered now, valid until the next step
    bool truth = false;                    ///< truth() is new
    std::optional<Contact> contact;
  };
  const Events& step();

  Stamp now() const { return now_; }
  const Truth& truth() const { return truth_; }
  /// Truth at the first beam of the scan delivered last.
  const Truth& truthOfScan() const { return scan_truth_; }
  const vehicle::PlantState& state() const { return plant_->state(); }
  const world::World& world() const { return world_; }
  const SimulatorParameters& parameters() const { return parameters_; }
  const LidarModel& lidar() const { return lidar_; }
  /// World file's start pose, or where (station, offset, heading error) lie on the design line.
  geometry::Pose startPose() const { return world_.start; }
  geometry::Pose poseOnLine(double station, double lateral_offset, double heading_error) const;

  TruckController& controller() { return controller_; }
  const TruckController& controller() const { return controller_; }

  /// While set, the plant obeys this instead of the truck's controller (somebody else drives).
  void lead(std::optional<vehicle::PlantInput> input) { lead_ = input; }
  /// Articulation demand of the last step [rad].
  double articulationCommand() const { return input_.steering; }

  /// A dead lidar sends nothing from now on.
  void setLidarAlive(bool alive) { lidar_alive_ = alive; }

 private:
  struct Pending {
    Stamp due;
    geometry::Scan scan;
    Truth truth;
  };

  void readSensors();
  void runLidar();
  void deliverScan();
  void measureTruth();
  Truth truthAt(Stamp stamp);
  geometry::Pose poseAt(Stamp stamp) const;
  geometry::Pose sensorPose(const geometry::Pose& body) const;
  std::vector<world::WallChain> obstaclesAt(Stamp stamp) const;
  double clearanceOf(const std::vector<geometry::Point>& outline);

  SimulatorParameters parameters_;
  vehicle::TruckParameters truck_;
  std::unique_ptr<vehicle::Plant> plant_;
  world::World world_;
  TruckController controller_;
  world::RayCaster caster_;
  ClearanceMeter clearance_meter_;
  std::optional<LineTracker> line_;
  LidarModel lidar_;
  Sensor articulation_sensor_, articulation_rate_sensor_, speed_sensor_, gyro_, accelerometer_;
  SensedTruck sensed_;

  Stamp step_;
  Stamp truth_period_;
  Stamp sensor_period_;
  Stamp sweep_duration_;
  Stamp now_{};
  Stamp next_truth_{};
  Stamp next_sensors_{};
  geometry::Pose last_pose_;
  vehicle::PlantInput input_;
  std::optional<vehicle::PlantInput> lead_;

  bool lidar_alive_ = true;
  bool sweeping_ = false;
  std::int64_t sweeps_ = 0;  ///< begun so far
  Stamp next_sweep_{};
  Stamp sweep_stamp_{};
  geometry::Pose sweep_start_;
  Truth sweep_truth_;
  std::deque<Pending> pending_;
  geometry::Scan delivered_;

  Truth truth_;
  Truth scan_truth_;
  bool front_touches_ = false;
  bool rear_touches_ = false;
  Events events_;
};

}  // namespace tunnel_pilot::simulation
