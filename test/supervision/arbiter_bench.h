#pragma once

#include "drift_scene.h"

namespace tunnel_pilot::supervision {

/// An arbiter with a make-believe truck on a straight, so that single inputs can be withheld or spoilt.
struct ArbiterBench {
  static std::string config(const std::string& file) {
    return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + file;
  }

  explicit ArbiterBench(bool needs_truck_state = true) {
    parameters = loadArbiter(config::loadFile(config("arbiter.yaml")));
    parameters.needs_truck_state = needs_truck_state;
    truck = vehicle::loadTruck(config("truck.yaml"));
    arbiter = std::make_unique<Arbiter>(parameters, truck);
    motion.speed = 3.0;
  }

  drivers::Proposal proposal(double articulation = 0.0, double asked_speed = 3.0) const {
    drivers::Proposal p;
    p.stamp = now - latency;
    p.valid = true;
    p.articulation_angle = articulation;
    p.speed = asked_speed;
    p.confidence = 1.0;
    return p;
  }

  // Every input that is not withheld, 20 ms later; the truck goes on straight ahead.
  void inputs() {
    now += std::chrono::milliseconds(20);
    if (give_motion) {
      motion.stamp = now;
      motion.pose.x += motion.speed * 0.02;
      arbiter->setMotion(motion, now);
    }
    if (give_state) arbiter->setTruckState(state, now);
    if (give_scan) {
      scene = sceneAt(line, {20.0, 0.0, 0.0}, 5.0, now - latency, 25.0);
      if (obstacle) addObstacle(scene, *obstacle, 0.0, 0.8);
      if (narrow) {
        for (auto& p : scene.walls.left.curve) p.y() -= p.x() > *narrow ? 0.9 : 0.0;
      }
      for (auto& p : scene.walls.left.curve) p.y() -= narrower;
      scene.tunnel.state.valid = tunnel_valid;
      if (!tunnel_valid) scene.tunnel.centerline = geometry::Path();
      arbiter->setPoints(scene.points, scene.walls.stamp, now);
      arbiter->setWalls(scene.walls, now);
      arbiter->setTunnel(scene.tunnel, now);
    }
    if (give_proposal) {
      drivers::Proposal p = proposal(wanted, speed);
      p.valid = proposal_valid;
      arbiter->setProposal(Source::kPreviewDriver, p, now);
    }
  }

  const Decision& cycle() {
    inputs();
    return arbiter->decide(now);
  }

  const Decision& cycles(int n) {
    for (int i = 1; i < n; ++i) cycle();
    return cycle();
  }

  // Healthy and engaged since a while, at 3 m/s.
  void drive() {
    cycles(5);
    state = {true, false, Reason::kNone};
    cycles(10);
  }

  ArbiterParameters parameters;
  vehicle::TruckParameters truck;
  std::unique_ptr<Arbiter> arbiter;
  geometry::Path line = geometry::buildPath({{100.0, 0.0, 0.0}}, {}, 0.5);
  Scene scene;
  drivers::Motion motion;
  TruckState state;
  Stamp now = std::chrono::seconds(100);
  Stamp latency = std::chrono::milliseconds(40);  // of the scan
  bool give_motion = true, give_state = true, give_scan = true, give_proposal = true;
  bool tunnel_valid = true, proposal_valid = true;
  double wanted = 0.0;
  double speed = 3.0;
  std::optional<double> obstacle;
  std::optional<double> narrow;  // the left wall stands nearer from here on
  double narrower = 0.0;         // the whole of it does, by this [m]
};

}  // namespace tunnel_pilot::supervision
