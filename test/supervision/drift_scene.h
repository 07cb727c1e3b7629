#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::supervision {

struct TestPoint {
  double x, y;
};

/// What perception would tell of a drift of constant width around `line`, seen from `truck` on it.
struct Scene {
  perception::Walls walls;
  perception::Tunnel tunnel;
  std::vector<TestPoint> points;
};

inline Scene sceneAt(const geometry::Path& line, const geometry::Pose& truck, double width, Stamp stamp,
                     double sight = 15.0) {
  Scene scene;
  const geometry::PathProjection foot = line.project(truck.position());
  scene.walls.stamp = scene.tunnel.state.stamp = stamp;
  scene.tunnel.state.valid = true;
  scene.tunnel.state.reason = perception::TunnelReason::kNone;
  scene.tunnel.state.lateral_offset = foot.lateral_offset;
  scene.tunnel.state.heading_error = geometry::wrapAngle(truck.heading - foot.heading);
  scene.tunnel.state.curvature = foot.curvature;
  scene.tunnel.state.width = width;
  scene.walls.left.found = scene.walls.right.found = true;
  std::vector<geometry::PathPoint> center;
  for (double ahead = -1.0; ahead <= sight; ahead += 0.5) {
    const geometry::PathPoint p = line.at(foot.s + ahead);
    const geometry::Point local = truck.inverseTransform({p.x, p.y});
    const double heading = geometry::wrapAngle(p.heading - truck.heading);
    center.push_back({ahead, local.x(), local.y(), heading, p.curvature});
    if (ahead < 1.5) continue;
    const geometry::Point left = 0.5 * width * geometry::Point(-std::sin(heading), std::cos(heading));
    scene.walls.left.curve.push_back(local + left);
    scene.walls.right.curve.push_back(local - left);
  }
  for (const auto* wall : {&scene.walls.right, &scene.walls.left}) {
    for (std::size_t i = 0; i + 1 < wall->curve.size(); ++i) {
      for (double t = 0.0; t < 1.0; t += 0.2) {
        const geometry::Point p = wall->curve[i] + t * (wall->curve[i + 1] - wall->curve[i]);
        scene.points.push_back({p.x(), p.y()});
      }
    }
  }
  scene.tunnel.centerline = geometry::Path(center);
  return scene;
}

/// A row of returns 0.1 m apart across the way, as a body of this width gives.
inline void addObstacle(Scene& scene, double x, double y, double width) {
  for (double across = -0.5 * width; across <= 0.5 * width + 1e-9; across += 0.1) {
    scene.points.push_back({x, y + across});
  }
}

}  // namespace tunnel_pilot::supervision
