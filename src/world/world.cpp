#include "tunnel_pilot/world/world.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "design_line.h"
#include "occupancy_map.h"
#include "random_tunnel.h"
#include "tunnel.h"

namespace tunnel_pilot::world {
namespace {

using config::Node;
using geometry::Path;
using geometry::PathPoint;
using geometry::Point;
using geometry::Pose;

constexpr double kLineSpacing = 0.25;      // of the design line's samples [m]
constexpr double kTunnelSeparation = 0.5;  // least rock between parts of a tunnel laid out by hand [m]
constexpr double kMaxCoordinate = 1e5;     // [m]
constexpr double kMaxArcLength = 1e5;      // [m]

Pose readPose(Node node) {
  const Pose pose{node.number("x", "m", -kMaxCoordinate, kMaxCoordinate),
                  node.number("y", "m", -kMaxCoordinate, kMaxCoordinate),
                  node.number("heading", "rad", -2.0 * M_PI, 2.0 * M_PI)};
  node.finish();
  return pose;
}

// A place given by arc length, offset to the left and heading from the line's direction.
Pose readBeside(Node node, const Path& line) {
  const PathPoint p = line.at(node.number("s", "m", 0.0, line.length()));
  const double offset = node.number("offset", "m", -100.0, 100.0);
  const double heading = node.number("heading", "rad", -2.0 * M_PI, 2.0 * M_PI);
  node.finish();
  return Pose{p.x, p.y, p.heading}.compose({0.0, offset, heading});
}

Obstacle readObstacle(Node node, const Path& line) {
  Obstacle obstacle;
  obstacle.name = node.text("name");
  const std::vector<double> outline = node.numbers("outline", "m", -100.0, 100.0, 6, 128);
  if (outline.size() % 2 != 0) node.refuse("outline", "[m] must be pairs x, y");
  for (std::size_t i = 0; i < outline.size(); i += 2) {
    obstacle.outline.emplace_back(outline[i], outline[i + 1]);
  }
  if (node.has("pose")) {
    obstacle.start = readPose(node.child("pose"));
  } else if (!node.has("beside")) {
    node.refuse("pose",
                "is missing: an obstacle has a pose {x, y, heading} or stands beside {s, offset, "
                "heading} of the design line");
  } else if (line.empty()) {
    node.refuse("beside", "needs a world with a design line");
  } else {
    obstacle.start = readBeside(node.child("beside"), line);
  }
  obstacle.speed = node.number("speed", "m/s", 0.0, 50.0);
  obstacle.travel = node.number("travel", "m", 0.0, kMaxArcLength);
  node.finish();
  return obstacle;
}

// A world without the key has no obstacles.
std::vector<Obstacle> readObstacles(Node& node, const Path& line) {
  std::vector<Obstacle> obstacles;
  if (!node.has("obstacles")) return obstacles;
  for (const Node& entry : node.children("obstacles")) obstacles.push_back(readObstacle(entry, line));
  return obstacles;
}

Widening readWidening(Node node, double length) {
  Widening w;
  w.from = node.number("from", "m", 0.0, length);
  w.to = node.number("to", "m", 0.0, length);
  w.width = node.number("width", "m", 1.0, 50.0);
  w.taper = node.number("taper", "m", 0.1, 100.0);
  if (w.to - w.from < 2.0 * w.taper) node.refuse("to", "[m] must be at least from + 2 taper");
  node.finish();
  return w;
}

Opening readOpening(Node node, double length) {
  Opening o;
  o.left = node.choice("side", {"left", "right"}) == "left";
  o.width = node.number("width", "m", 0.5, 50.0);
  o.at = node.number("at", "m", 0.5 * o.width, length - 0.5 * o.width);
  o.depth = node.number("depth", "m", 0.1, 200.0);
  node.finish();
  return o;
}

// Both keys may be absent: then the tunnel has its nominal width and closed walls throughout.
void readDetails(Node& node, TunnelPlan& plan) {
  double length = 0.0;
  for (const geometry::PathPiece& piece : plan.pieces) length += piece.length;
  if (node.has("widenings")) {
    for (const Node& entry : node.children("widenings")) {
      plan.widenings.push_back(readWidening(entry, length));
      for (std::size_t i = 0; i + 1 < plan.widenings.size(); ++i) {
        if (plan.widenings[i].from < plan.widenings.back().to &&
            plan.widenings.back().from < plan.widenings[i].to) {
          node.refuse("widenings", "must not overlap");
        }
      }
    }
  }
  if (!node.has("openings")) return;
  for (const Node& entry : node.children("openings")) {
    plan.openings.push_back(readOpening(entry, length));
    const Opening& last = plan.openings.back();
    for (std::size_t i = 0; i + 1 < plan.openings.size(); ++i) {
      const Opening& o = plan.openings[i];
      if (o.left == last.left && std::abs(o.at - last.at) < 0.5 * (o.width + last.width) + 0.5) {
        node.refuse("openings", "on one side must be at least 0.5 m apart");
      }
    }
  }
}

// What laid out and random tunnels have in common.
void readCommon(Node& node, const WorldOptions& options, TunnelPlan& plan) {
  const std::int64_t seed = node.integer("seed", "1", 0, 1000000000);
  plan.seed = options.seed ? *options.seed : static_cast<std::uint64_t>(seed);
  plan.width = node.number("width", "m", 1.0, 50.0);
  plan.wall_spacing = node.number("wall_spacing", "m", 0.05, 5.0);
  Node roughness = node.child("roughness");
  plan.roughness.sigma = roughness.number("sigma", "m", 0.0, 0.5);
  plan.roughness.correlation_length = roughness.number("correlation_length", "m", 0.1, 100.0);
  roughness.finish();
}

Path reversedLine(const Path& line) {
  std::vector<PathPoint> points(line.points().rbegin(), line.points().rend());
  const double length = line.points().back().s;
  for (PathPoint& p : points) {
    p = {length - p.s, p.x, p.y, geometry::wrapAngle(p.heading + M_PI), -p.curvature};
  }
  return Path(std::move(points), line.closed());
}

World loadTunnel(Node& node, const WorldOptions& options, bool random) {
  TunnelPlan plan;
  TunnelWalls walls;
  readCommon(node, options, plan);
  if (random) {
    walls = drawRandomTunnel(node, plan);
  } else {
    plan.closed = node.boolean("closed");
    plan.pieces = readDesignLine(node, plan.closed);
    plan.separation = kTunnelSeparation;
    readDetails(node, plan);
    walls = buildWalls(plan);
  }
  if (!walls.conflict.empty()) node.refuse("design_line", walls.conflict);
  World world;
  world.walls = std::move(walls.chains);
  world.width = plan.width;
  world.design_line = geometry::buildPath(plan.pieces, {}, kLineSpacing, plan.closed);
  world.obstacles = readObstacles(node, world.design_line);
  for (const PathPoint& p : world.design_line.points()) world.widths.push_back(widthAt(plan, p.s));
  if (options.reversed) {
    world.design_line = reversedLine(world.design_line);
    std::reverse(world.widths.begin(), world.widths.end());
  }
  const PathPoint p =
      world.design_line.at(node.number("start_at", "m", 0.0, world.design_line.length()));
  world.start = {p.x, p.y, geometry::wrapAngle(p.heading)};
  return world;
}

// A line through points: headings and curvatures from their neighbours.
Path lineThrough(const std::vector<Point>& points, bool closed) {
  const std::size_t n = points.size();
  std::vector<PathPoint> line(n);
  const auto neighbour = [&](std::size_t i, bool after) -> const Point& {
    if (after) return i + 1 < n ? points[i + 1] : (closed ? points[1] : points[i]);
    return i > 0 ? points[i - 1] : (closed ? points[n - 2] : points[i]);
  };
  for (std::size_t i = 0; i < n; ++i) {
    const Point tangent = neighbour(i, true) - neighbour(i, false);
    const double s = i > 0 ? line[i - 1].s + (points[i] - points[i - 1]).norm() : 0.0;
    line[i] = {s, points[i].x(), points[i].y(), std::atan2(tangent.y(), tangent.x()), 0.0};
  }
  for (std::size_t i = 0; i < n; ++i) {
    const Point before = points[i] - neighbour(i, false);
    const Point after = neighbour(i, true) - points[i];
    if (before.norm() == 0.0 || after.norm() == 0.0) continue;
    const double turn = std::atan2(before.x() * after.y() - before.y() * after.x(), before.dot(after));
    line[i].curvature = 2.0 * turn / (before.norm() + after.norm());
  }
  return Path(std::move(line), closed);
}

Path readLinePoints(Node node) {
  const std::vector<double> xy = node.numbers("points", "m", -kMaxCoordinate, kMaxCoordinate, 4, 100000);
  const bool closed = node.boolean("closed");
  node.finish();
  if (xy.size() % 2 != 0) node.refuse("points", "[m] must be pairs x, y");
  std::vector<Point> points;
  for (std::size_t i = 0; i < xy.size(); i += 2) points.emplace_back(xy[i], xy[i + 1]);
  if (closed) points.push_back(points.front());
  for (std::size_t i = 1; i < points.size(); ++i) {
    if ((points[i] - points[i - 1]).norm() < 0.01) {
      node.refuse("points",
                  "[m] must be at least 0.01 m apart; a closed line does not repeat its first");
    }
  }
  return lineThrough(points, closed);
}

World loadMap(Node& node, const std::string& file, const WorldOptions& options) {
  World world;
  world.walls =
      loadOccupancyMap((std::filesystem::path(file).parent_path() / node.text("map")).string());
  world.width = node.number("width", "m", 0.0, 50.0);
  world.start = readPose(node.child("start"));
  if (node.has("design_line")) world.design_line = readLinePoints(node.child("design_line"));
  world.obstacles = readObstacles(node, world.design_line);
  if (options.reversed) {
    if (!world.design_line.empty()) world.design_line = reversedLine(world.design_line);
    world.start.heading = geometry::wrapAngle(world.start.heading + M_PI);
  }
  return world;
}

}  // namespace

Pose Obstacle::poseAt(double time) const {
  double distance = speed * std::max(time, 0.0);
  if (travel > 0.0) {
    distance = std::fmod(distance, 2.0 * travel);
    distance = std::min(distance, 2.0 * travel - distance);
  }
  return start.compose({distance, 0.0, 0.0});
}

WallChain Obstacle::chainAt(double time) const {
  const Pose pose = poseAt(time);
  WallChain chain;
  chain.reserve(outline.size() + 1);
  for (const Point& p : outline) chain.push_back(pose.transform(p));
  if (!chain.empty()) chain.push_back(chain.front());
  return chain;
}

double World::widthAt(double s) const {
  if (widths.empty()) return width;
  const auto& points = design_line.points();
  const double station = design_line.at(s).s;
  const auto after = std::upper_bound(points.begin() + 1, points.end() - 1, station,
                                      [](double value, const PathPoint& p) { return value < p.s; });
  const auto i = static_cast<std::size_t>(after - points.begin());
  const double t = (station - points[i - 1].s) / (points[i].s - points[i - 1].s);
  return widths[i - 1] + t * (widths[i] - widths[i - 1]);
}

World loadWorld(const std::string& file, const WorldOptions& options) {
  Node node = config::loadFile(file);
  const std::string type = node.choice("type", {"tunnel", "random_tunnel", "map"});
  const std::string name = node.text("name");
  World world =
      type == "map" ? loadMap(node, file, options) : loadTunnel(node, options, type == "random_tunnel");
  world.name = name;
  node.finish();
  return world;
}

}  // namespace tunnel_pilot::world
