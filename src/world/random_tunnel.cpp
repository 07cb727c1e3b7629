#include "random_tunnel.h"

#include <vector>

namespace tunnel_pilot::world {
namespace {

using config::Node;

constexpr int kMaxDraws = 200;
constexpr std::uint64_t kLayoutStream = 3;

struct Range {
  double min;
  double max;
};

struct LayoutRanges {
  double min_length = 0.0;            // [m]
  Range straight_length{};            // [m]
  Range bend_radius{};                // [m]
  Range bend_angle{};                 // of the arc alone [rad]
  Range transition_length{};          // [m]
  double reversal_probability = 0.0;  // [1]
  Range reversal_length{};            // of the clothoid between opposite bends [m]
  double bay_probability = 0.0;       // for each straight [1]
  Range bay_width{};                  // [m]
  Range bay_depth{};                  // [m]
};

Range readRange(Node& node, const std::string& key, const std::string& unit, double min, double max) {
  const std::vector<double> ends = node.numbers(key, unit, min, max, 2, 2);
  if (ends[0] > ends[1]) node.refuse(key, "[" + unit + "] must be [smallest, largest]");
  return {ends[0], ends[1]};
}

LayoutRanges readRanges(Node& node) {
  LayoutRanges r;
  r.min_length = node.number("min_length", "m", 20.0, 5000.0);
  r.straight_length = readRange(node, "straight_length", "m", 1.0, 500.0);
  r.bend_radius = readRange(node, "bend_radius", "m", 3.0, 1000.0);
  r.bend_angle = readRange(node, "bend_angle", "rad", 0.05, 3.2);
  r.transition_length = readRange(node, "transition_length", "m", 0.5, 100.0);
  r.reversal_probability = node.number("reversal_probability", "1", 0.0, 1.0);
  r.reversal_length = readRange(node, "reversal_length", "m", 0.5, 100.0);
  Node bays = node.child("bays");
  r.bay_probability = bays.number("probability", "1", 0.0, 1.0);
  r.bay_width = readRange(bays, "width", "m", 0.5, 20.0);
  r.bay_depth = readRange(bays, "depth", "m", 0.1, 40.0);
  bays.finish();
  return r;
}

class Layout {
 public:
  Layout(const LayoutRanges& ranges, Draws& draws) : ranges_(ranges), draws_(draws) {}

  void draw(TunnelPlan& plan) {
    addStraight();
    while (length_ < ranges_.min_length) {
      addBends();
      addStraight();
    }
    plan.pieces = pieces_;
    plan.openings = bays_;
  }

 private:
  double pick(const Range& range) { return draws_.uniform(range.min, range.max); }
  bool happens(double probability) { return draws_.uniform(0.0, 1.0) < probability; }

  void add(double length, double curvature_start, double curvature_end) {
    pieces_.push_back({length, curvature_start, curvature_end});
    length_ += length;
  }

  void addStraight() {
    const double length = pick(ranges_.straight_length);
    const double begin = length_;
    add(length, 0.0, 0.0);
    const bool has_bay = happens(ranges_.bay_probability);
    const Opening bay{happens(0.5), begin + 0.5 * length, pick(ranges_.bay_width),
                      pick(ranges_.bay_depth)};
    if (has_bay && bay.width < length) bays_.push_back(bay);
  }

  void addBends() {
    double curvature = (happens(0.5) ? 1.0 : -1.0) / pick(ranges_.bend_radius);
    add(pick(ranges_.transition_length), 0.0, curvature);
    add(pick(ranges_.bend_angle) / std::abs(curvature), curvature, curvature);
    if (happens(ranges_.reversal_probability)) {
      const double opposite = (curvature > 0.0 ? -1.0 : 1.0) / pick(ranges_.bend_radius);
      add(pick(ranges_.reversal_length), curvature, opposite);
      add(pick(ranges_.bend_angle) / std::abs(opposite), opposite, opposite);
      curvature = opposite;
    }
    add(pick(ranges_.transition_length), curvature, 0.0);
  }

  const LayoutRanges& ranges_;
  Draws& draws_;
  std::vector<geometry::PathPiece> pieces_;
  std::vector<Opening> bays_;
  double length_ = 0.0;  // [m]
};

}  // namespace

TunnelWalls drawRandomTunnel(Node& world, TunnelPlan& plan) {
  const LayoutRanges ranges = readRanges(world);
  plan.separation = world.number("separation", "m", 0.0, 10.0);
  Draws draws(plan.seed, kLayoutStream);
  TunnelWalls walls;
  for (int i = 0; i < kMaxDraws; ++i) {
    Layout(ranges, draws).draw(plan);
    walls = buildWalls(plan);
    if (walls.conflict.empty()) return walls;
  }
  world.refuse("min_length", "[m]: no layout suits in " + std::to_string(kMaxDraws) +
                                 " draws; the last one " + walls.conflict);
}

}  // namespace tunnel_pilot::world
