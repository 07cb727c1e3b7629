#include "tunnel_pilot/learning/human_driver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

constexpr double kSpacing = 0.25;      // of his line [m]
constexpr double kSmoothing = 5.0;     // half length over which bends are seen as one [m]
constexpr double kFullCut = 1 / 25.0;  // curvature from which he cuts in full [1/m]
constexpr double kBehind = 5.0;        // he knows his line from so far behind ... [m]
constexpr double kAhead = 25.0;        // ... to so far ahead of him [m]
constexpr double kWidth = 5.0;         // told for completeness [m]

// Two slow waves.
class Weave {
 public:
  Weave(double largest, std::uint64_t seed) {
    simulation::Random random(seed, simulation::Stream::kWander);
    waves_ = {drawn(0.6 * largest, 30.0, 60.0, random), drawn(0.4 * largest, 15.0, 25.0, random)};
  }
  double at(double s) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += wave.height * std::sin(wave.number * s + wave.phase);
    return sum;
  }

 private:
  struct Wave {
    double height, number, phase;
  };
  static Wave drawn(double height, double shortest, double longest, simulation::Random& random) {
    return {height, 2.0 * M_PI / random.uniform(shortest, longest), random.uniform(0.0, 2.0 * M_PI)};
  }
  std::array<Wave, 2> waves_{};
};

std::vector<double> smoothed(const std::vector<double>& values, std::size_t half) {
  std::vector<double> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t first = i < half ? 0 : i - half;
    const std::size_t last = std::min(i + half, values.size() - 1);
    double sum = 0.0;
    for (std::size_t k = first; k <= last; ++k) sum += values[k];
    result[i] = sum / static_cast<double>(last - first + 1);
  }
  return result;
}

// Points become a path: directions and curvature from one to the next.
geometry::Path pathThrough(const std::vector<geometry::Point>& points) {
  std::vector<geometry::PathPoint> path(points.size());
  const std::size_t last = points.size() - 1;
  for (std::size_t i = 0; i <= last; ++i) {
    const geometry::Point along = points[std::min(i + 1, last)] - points[i > 0 ? i - 1 : 0];
    path[i].x = points[i].x();
    path[i].y = points[i].y();
    path[i].heading = std::atan2(along.y(), along.x());
    if (i > 0) path[i].s = path[i - 1].s + (points[i] - points[i - 1]).norm();
  }
  for (std::size_t i = 1; i < last; ++i) {
    path[i].curvature =
        geometry::wrapAngle(path[i + 1].heading - path[i - 1].heading) / (path[i + 1].s - path[i - 1].s);
  }
  return geometry::Path(std::move(path));
}

}  // namespace

geometry::Path humanLine(const geometry::Path& design_line, const HumanHabit& habit,
                         std::uint64_t seed) {
  const auto count = static_cast<std::size_t>(design_line.length() / kSpacing) + 1;
  std::vector<double> inside(count);  // share of the cut, to the left
  for (std::size_t i = 0; i < count; ++i) {
    const double curvature = design_line.at(static_cast<double>(i) * kSpacing + habit.turn_in).curvature;
    inside[i] = std::clamp(curvature / kFullCut, -1.0, 1.0);
  }
  const auto half = static_cast<std::size_t>(kSmoothing / kSpacing);
  inside = smoothed(smoothed(inside, half / 2), half / 2);
  const Weave weave(habit.weave, seed);
  std::vector<geometry::Point> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = static_cast<double>(i) * kSpacing;
    const geometry::PathPoint foot = design_line.at(s);
    const double wanted = habit.cut * inside[i] + weave.at(s);
    const double left = habit.most * std::tanh(wanted / habit.most);
    points[i] = geometry::Pose{foot.x, foot.y, foot.heading}.transform({0.0, left});
  }
  return pathThrough(points);
}

HumanDriver::HumanDriver(const geometry::Path& line, const drivers::PreviewDriverParameters& parameters,
                         const vehicle::TruckGeometry& truck)
    : line_(&line), driver_(parameters, truck) {}

double HumanDriver::steer(const simulation::Truth& truth, const drivers::Motion& motion, Stamp now) {
  const geometry::Pose& pose = truth.state.pose;
  const geometry::PathProjection foot =
      station_ < 0.0 ? line_->project(pose.position()) : line_->project(pose.position(), station_);
  station_ = std::max(0.0, foot.s);
  perception::Tunnel seen;
  seen.state.stamp = truth.stamp;
  seen.state.valid = true;
  seen.state.reason = perception::TunnelReason::kNone;
  seen.state.lateral_offset = foot.lateral_offset;
  seen.state.heading_error = geometry::wrapAngle(pose.heading - foot.heading);
  seen.state.curvature = foot.curvature;
  seen.state.width = kWidth;
  std::vector<geometry::PathPoint> ahead;
  const double first = std::max(0.0, station_ - kBehind);
  const double last = std::min(line_->length(), station_ + kAhead);
  for (double s = first; s <= last; s += 0.5) {
    const geometry::PathPoint point = line_->at(s);
    const geometry::Point local = pose.inverseTransform({point.x, point.y});
    ahead.push_back({s - first, local.x(), local.y(), geometry::wrapAngle(point.heading - pose.heading),
                     point.curvature});
  }
  if (ahead.size() < 2) return demand_;
  seen.centerline = geometry::Path(std::move(ahead));
  const drivers::Proposal proposal = driver_.propose(seen, motion, now);
  if (proposal.valid) demand_ = proposal.articulation_angle;
  return demand_;
}

}  // namespace tunnel_pilot::learning
