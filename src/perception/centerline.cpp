#include "tunnel_pilot/perception/centerline.h"

#include <algorithm>
#include <cmath>

#include "arc_length_fit.h"

namespace tunnel_pilot::perception {
namespace {

using geometry::PathPoint;
using geometry::Point;
using geometry::Pose;

constexpr double kSeenComing = 2.5;  // [m] along the tunnel, between a width expected and met
// Odometry that moves farther from one scan to the next has jumped.
constexpr double kPoseJump = 1.5;        // [m]
constexpr double kHeadingJump = 0.5;     // [rad]
constexpr double kSameWall = 0.8;        // [m] between a wall seen and one remembered
constexpr double kPathBehind = 1.5;      // [m] of the path's begin behind the reference point
constexpr double kCurveStep = 0.5;       // [m] between samples of the walls' curves
constexpr std::size_t kFewestInFit = 4;  // nodes in a parabola's window

// Farther from its origin, or turned more often, a pose resolves no nanometre any more, and at last
// nothing. Written so that numbers that are none fail.
bool isUsable(const Pose& pose) {
  constexpr double kFarthest = 1e6;  // [m], [rad]
  return std::abs(pose.x) <= kFarthest && std::abs(pose.y) <= kFarthest &&
         std::abs(pose.heading) <= kFarthest;
}

// Unit tangent of a polyline at sample i, by central differences.
Point tangentAt(const std::vector<Point>& curve, std::size_t i) {
  const std::size_t before = i > 0 ? i - 1 : 0;
  const std::size_t after = std::min(i + 1, curve.size() - 1);
  return (curve[after] - curve[before]).normalized();
}

Point leftOf(const Point& direction) { return {-direction.y(), direction.x()}; }

}  // namespace

CenterlineParameters loadCenterline(config::Node node) {
  CenterlineParameters p;
  p.width_min = node.number("width_min", "m", 0.5, 20.0);
  p.width_max = node.number("width_max", "m", 0.5, 20.0);
  if (p.width_max <= p.width_min) node.refuse("width_max", "must exceed width_min");
  p.length_min = node.number("length_min", "m", 1.0, 20.0);
  p.residual_max = node.number("residual_max", "m", 0.01, 1.0);
  p.pair_length_min = node.number("pair_length_min", "m", 0.5, 20.0);
  p.single_distance_max = node.number("single_distance_max", "m", 0.0, 50.0);
  p.single_time_max = node.number("single_time_max", "s", 0.0, 60.0);
  p.width_jump_max = node.number("width_jump_max", "m", 0.05, 10.0);
  p.jump_scans = static_cast<int>(node.integer("jump_scans", "1", 1, 1000));
  p.memory_weight_max = node.number("memory_weight_max", "1", 0.0, 1000.0);
  p.memory_behind = node.number("memory_behind", "m", 0.0, 20.0);
  p.memory_error_max = node.number("memory_error_max", "m", 0.01, 5.0);
  p.disbelief_scans = static_cast<int>(node.integer("disbelief_scans", "1", 1, 1000));
  p.far_distance = node.number("far_distance", "m", 0.5, 50.0);
  p.fit_reach = node.number("fit_reach", "m", 0.5, 10.0);
  p.wall_deviation = node.number("wall_deviation", "m", 0.001, 1.0);
  p.wall_correlation = node.number("wall_correlation", "m", 0.01, 20.0);
  node.finish();
  return p;
}

CenterlineEstimator::CenterlineEstimator(const CenterlineParameters& parameters)
    : parameters_(parameters), fit_(new ArcLengthFit) {}

CenterlineEstimator::~CenterlineEstimator() = default;

void CenterlineEstimator::reset() {
  tunnel_ = Tunnel();
  memory_.clear();
  last_width_.reset();
  last_pose_.reset();
  paired_stamp_.reset();
  single_distance_ = 0.0;
  jumps_ = 0;
  doubts_ = 0;
}

const Tunnel& CenterlineEstimator::refuse(TunnelReason reason) {
  const Stamp stamp = tunnel_.state.stamp;
  tunnel_.state = TunnelState();
  tunnel_.state.stamp = stamp;
  tunnel_.state.reason = reason;
  tunnel_.centerline = geometry::Path();
  return tunnel_;
}

const Tunnel& CenterlineEstimator::update(const Walls& walls, const std::optional<Pose>& odom_pose) {
  tunnel_.state.stamp = walls.stamp;
  const std::optional<Pose> pose = odom_pose && isUsable(*odom_pose) ? odom_pose : std::nullopt;
  TunnelReason reason = measure(walls, pose);
  travel(walls, pose);
  if (reason == TunnelReason::kNone && !paired_now_) reason = checkSingle(walls, pose.has_value());
  if (reason == TunnelReason::kNone) reason = checkWidth(pose);
  if (reason != TunnelReason::kNone) return refuse(reason);
  if (pose) {
    remember(*pose);
  } else {
    memory_.clear();
    before_.clear();
    nodes_ = measured_;
  }
  const bool enough = nodes_.size() >= kFewestInFit;  // or no parabola goes through them
  if (enough) fitPath();
  if (!enough || !isPlausible()) {
    disbelieve();
    return refuse(TunnelReason::kPoorFit);
  }
  // What is remembered there may have come from afar, where no width is checked.
  if (!isTunnels(nodes_[nodeBeside()].width)) return refuse(TunnelReason::kWidthImplausible);
  fillState(walls);
  return tunnel_;
}

// Centerline nodes of this scan, in base_link.
TunnelReason CenterlineEstimator::measure(const Walls& walls, const std::optional<Pose>& pose) {
  measured_.clear();
  paired_now_ = false;
  if (!walls.left.found && !walls.right.found) {
    return walls.enough_returns ? TunnelReason::kNoWalls : TunnelReason::kTooFewPoints;
  }
  for (const Wall* wall : {&walls.left, &walls.right}) {
    if (wall->found && !(wall->residual <= parameters_.residual_max)) return TunnelReason::kPoorFit;
  }
  const std::vector<Point>& left = walls.left.curve;
  const std::vector<Point>& right = walls.right.curve;
  const std::size_t pairs = std::min(left.size(), right.size());
  double length = 0.0;
  for (std::size_t i = 0; i < pairs; ++i) {
    measured_.push_back({0.5 * (left[i] + right[i]), (left[i] - right[i]).norm(), 0.0});
    if (i > 0) length += (measured_[i].position - measured_[i - 1].position).norm();
  }
  paired_now_ = length >= parameters_.pair_length_min;
  if (!paired_now_) measured_.clear();
  if (!paired_now_ && !last_width_) return TunnelReason::kNeverPaired;
  const bool left_longer = left.size() > right.size();
  followWall(left_longer ? left : right, left_longer ? 1.0 : -1.0, pose);
  return measured_.size() < kFewestInFit ? TunnelReason::kPoorFit : TunnelReason::kNone;
}

// Continues the measured nodes along one wall: where the wall is one that is remembered, at the width
// and in the direction that were seen there with both, else at the last width and along the wall.
void CenterlineEstimator::followWall(const std::vector<Point>& curve, double side,
                                     const std::optional<Pose>& pose) {
  if (measured_.size() >= curve.size()) return;
  double width = measured_.empty() ? *last_width_ : measured_.back().width;
  if (pose) recallWall(side, *pose);
  const std::size_t recalled = pose ? recalled_.size() : 0;
  const auto gap = [&](std::size_t k, const Point& p) { return (recalled_[k].place - p).squaredNorm(); };
  std::size_t k = 0;
  for (std::size_t i = measured_.size(); i < curve.size(); ++i) {
    Point normal = leftOf(tangentAt(curve, i));
    while (k + 1 < recalled && gap(k + 1, curve[i]) <= gap(k, curve[i])) ++k;
    if (recalled > 0 && gap(k, curve[i]) < kSameWall * kSameWall) {
      width = recalled_[k].width;
      normal = recalled_[k].normal;
    }
    measured_.push_back({curve[i] - 0.5 * side * width * normal, width, 0.0});
  }
}

// Where the remembered nodes have their wall, in base_link.
void CenterlineEstimator::recallWall(double side, const Pose& pose) {
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  const auto turn = [&](const Point& d) { return Point(c * d.x() + s * d.y(), c * d.y() - s * d.x()); };
  recalled_.clear();
  for (std::size_t k = 0; k + 1 < memory_.size(); ++k) {
    const Node& node = memory_[k];
    const Point& before = memory_[k > 0 ? k - 1 : 0].position;
    const Point normal = turn(leftOf((memory_[k + 1].position - before).normalized()));
    const Point place = turn(node.position - pose.position());
    recalled_.push_back({place + 0.5 * side * node.width * normal, normal, node.width});
  }
}

void CenterlineEstimator::travel(const Walls& walls, const std::optional<Pose>& pose) {
  if (pose && last_pose_) {
    const double step = (pose->position() - last_pose_->position()).norm();
    const double turn = std::abs(geometry::wrapAngle(pose->heading - last_pose_->heading));
    if (step > kPoseJump || turn > kHeadingJump) memory_.clear();
    single_distance_ += step;
  }
  last_pose_ = pose;
  if (!paired_now_) return;
  single_distance_ = 0.0;
  paired_stamp_ = walls.stamp;
}

TunnelReason CenterlineEstimator::checkSingle(const Walls& walls, bool has_odometry) const {
  const bool too_long = has_odometry ? single_distance_ > parameters_.single_distance_max
                                     : !paired_stamp_ || toSeconds(walls.stamp - *paired_stamp_) >
                                                             parameters_.single_time_max;
  return too_long ? TunnelReason::kSingleTooLong : TunnelReason::kNone;
}

bool CenterlineEstimator::isTunnels(double width) const {
  return width >= parameters_.width_min && width <= parameters_.width_max;
}

// The width beside the truck must be a tunnel's, and what was expected of it: what earlier scans saw
// there, or, without odometry, the last one.
TunnelReason CenterlineEstimator::checkWidth(const std::optional<Pose>& pose) {
  const double width = measured_.front().width;
  if (!isTunnels(width)) return TunnelReason::kWidthImplausible;
  double jump = std::abs(width - last_width_.value_or(width));
  if (pose && !memory_.empty()) {
    const Point place = pose->transform(measured_.front().position);
    for (const Node& node : memory_) {
      if ((node.position - place).squaredNorm() < kSeenComing * kSeenComing)
        jump = std::min(jump, std::abs(width - node.width));
    }
  }
  if (jump > parameters_.width_jump_max && ++jumps_ < parameters_.jump_scans)
    return TunnelReason::kWidthJump;
  if (jumps_ >= parameters_.jump_scans) memory_.clear();
  jumps_ = 0;
  if (paired_now_) last_width_ = width;
  return TunnelReason::kNone;
}

// Merges this scan's nodes into those kept in the odom frame, and reads them back.
void CenterlineEstimator::remember(const Pose& pose) {
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  for (Node& node : measured_) {
    const double ratio = node.position.norm() / parameters_.far_distance;
    node.weight = 1.0 / (1.0 + ratio * ratio);
    const Point p = node.position;
    node.position = pose.position() + Point(c * p.x() - s * p.y(), s * p.x() + c * p.y());
  }
  before_ = memory_;
  const Fit fit = fuse();
  if (fit == Fit::kBad) {
    disbelieve();
  } else {
    if (fit == Fit::kGood) doubts_ = 0;
    if (fit == Fit::kApart) memory_.clear();
  }
  if (fit != Fit::kBad || memory_.empty()) appendMeasured();
  forgetBehind(pose);
  nodes_ = memory_;
  for (Node& node : nodes_) {
    const Point d = node.position - pose.position();
    node.position = {c * d.x() + s * d.y(), c * d.y() - s * d.x()};
  }
}

// A scan that does not fit what is remembered is left out, but not many in a row.
void CenterlineEstimator::disbelieve() {
  memory_ = before_;
  if (++doubts_ < parameters_.disbelief_scans) return;
  memory_.clear();
  doubts_ = 0;
}

// Moves each remembered node towards the measured centerline.
CenterlineEstimator::Fit CenterlineEstimator::fuse() {
  double error = 0.0;
  int compared = 0;
  std::size_t j = 0;
  std::size_t kept = 0;
  for (; kept < memory_.size(); ++kept) {
    Node& node = memory_[kept];
    double t = 0.0;
    while (true) {
      const Point chord = measured_[j + 1].position - measured_[j].position;
      t = (node.position - measured_[j].position).dot(chord) / chord.squaredNorm();
      if (t <= 1.0 || j + 2 >= measured_.size()) break;
      ++j;
    }
    if (t > 1.0) break;               // beyond what is seen now
    if (t < 0.0 && j == 0) continue;  // behind what is seen now
    const Node& a = measured_[j];
    const Node& b = measured_[j + 1];
    const double along = std::clamp(t, 0.0, 1.0);
    const Point step = a.position + along * (b.position - a.position) - node.position;
    error += step.norm();
    ++compared;
    const double gain = a.weight / (node.weight + a.weight);
    node.position += gain * step;
    node.width += gain * (a.width + along * (b.width - a.width) - node.width);
    node.weight = std::min(node.weight + a.weight, parameters_.memory_weight_max);
  }
  memory_.resize(kept);
  if (compared == 0) return Fit::kApart;
  return error <= parameters_.memory_error_max * compared ? Fit::kGood : Fit::kBad;
}

void CenterlineEstimator::appendMeasured() {
  constexpr double kNearest = 0.25;  // [m] between nodes
  for (const auto& node : measured_) {
    if (memory_.size() >= 2) {
      const Point& last = memory_.back().position;
      const Point direction = (last - memory_[memory_.size() - 2].position).normalized();
      if (direction.dot(node.position - last) < kNearest) continue;
    }
    memory_.push_back(node);
  }
}

void CenterlineEstimator::forgetBehind(const Pose& pose) {
  std::size_t first = 0;
  while (first + 3 < memory_.size()) {
    const Node& next = memory_[first + 1];
    const Point direction = (memory_[first + 2].position - next.position).normalized();
    if (direction.dot(pose.position() - next.position) < parameters_.memory_behind) break;
    ++first;
  }
  memory_.erase(memory_.begin(), memory_.begin() + static_cast<std::ptrdiff_t>(first));
}

// Moves a window on to node `i`: the nodes within fit_reach of it. `window` is that of a node before.
CenterlineEstimator::Window CenterlineEstimator::slide(Window window, std::size_t i) const {
  const ArcLengthFit& fit = *fit_;
  const double reach = parameters_.fit_reach;
  while (fit.s(i) - fit.s(window.first) > reach) ++window.first;
  window.last = std::max(window.last, i);
  while (window.last + 1 < fit.size() && fit.s(window.last + 1) - fit.s(i) <= reach) ++window.last;
  return window;
}

// At the ends the fit takes the whole first or last stretch of the same length, and never fewer nodes
// than kFewestInFit.
CenterlineEstimator::Window CenterlineEstimator::widened(Window window) const {
  const ArcLengthFit& fit = *fit_;
  const auto too_small = [&] {
    return window.last - window.first < kFewestInFit - 1 ||
           fit.s(window.last) - fit.s(window.first) < 2.0 * parameters_.fit_reach - kCurveStep;
  };
  while (window.last + 1 < fit.size() && too_small()) ++window.last;
  while (window.first > 0 && too_small()) --window.first;
  return window;
}

// Path samples of the nodes, each with the parabola's place, heading and curvature.
void CenterlineEstimator::fitPath() {
  fit_->clear();
  for (const Node& node : nodes_) fit_->add(node.position);
  path_.clear();
  // Nodes farther behind only bear on the fit beside the reference point.
  std::size_t begin = 0;
  while (begin + kFewestInFit < nodes_.size() && nodes_[begin].position.x() < -kPathBehind) ++begin;
  Window near{0, 0};
  for (std::size_t i = begin; i < nodes_.size(); ++i) {
    near = slide(near, i);
    const auto [first, last] = widened(near);
    const ArcLengthFit::Parabola parabola = fit_->fit(first, last, fit_->s(i));
    const Point& place = parabola.place;
    const double s =
        path_.empty() ? 0.0 : path_.back().s + (place - Point(path_.back().x, path_.back().y)).norm();
    path_.push_back({s, place.x(), place.y(), std::atan2(parabola.tangent.y(), parabola.tangent.x()),
                     parabola.curvature()});
  }
  prolongBackwards();
}

// A tunnel is long enough and finite. A kink, as a wall mistaken far ahead gives it, ends the path.
bool CenterlineEstimator::isPlausible() {
  constexpr double kKink = 0.4;  // [rad] between neighbouring samples
  for (std::size_t i = 0; i < path_.size(); ++i) {
    const PathPoint& p = path_[i];
    const bool finite = std::isfinite(p.s) && std::isfinite(p.x) && std::isfinite(p.y) &&
                        std::isfinite(p.heading) && std::isfinite(p.curvature);
    if (!finite || (i > 0 && !(p.s > path_[i - 1].s))) return false;
    const double turn = i > 0 ? p.heading - path_[i - 1].heading : 0.0;
    if (std::abs(turn) > kKink && std::abs(geometry::wrapAngle(turn)) > kKink) {
      path_.resize(i);
      break;
    }
  }
  return path_.size() > 1 && path_.back().s - path_.front().s >= parameters_.length_min;
}

// Back to beside the reference point, at the first sample's curvature.
void CenterlineEstimator::prolongBackwards() {
  constexpr double kBehind = 0.5;  // [m]
  std::vector<PathPoint> added;
  PathPoint p = path_.front();
  while (p.x * std::cos(p.heading) + p.y * std::sin(p.heading) > -kBehind && added.size() < 40) {
    const double mean_heading = p.heading - 0.5 * kCurveStep * p.curvature;
    p.x -= kCurveStep * std::cos(mean_heading);
    p.y -= kCurveStep * std::sin(mean_heading);
    p.heading -= kCurveStep * p.curvature;
    p.s -= kCurveStep;
    added.push_back(p);
  }
  path_.insert(path_.begin(), added.rbegin(), added.rend());
}

void CenterlineEstimator::fillState(const Walls& walls) {
  tunnel_.centerline = geometry::Path(path_);
  const geometry::PathProjection foot = tunnel_.centerline.project(Point::Zero());
  TunnelState& state = tunnel_.state;
  state.valid = true;
  state.reason = TunnelReason::kNone;
  state.lateral_offset = foot.lateral_offset;
  state.heading_error = geometry::wrapAngle(-foot.heading);
  state.curvature = foot.curvature;
  const std::size_t beside = nodeBeside();
  state.width = nodes_[beside].width;
  fillCovariance(walls, beside);
}

// The node that is nearest to the reference point.
std::size_t CenterlineEstimator::nodeBeside() const {
  const auto nearest = std::min_element(nodes_.begin(), nodes_.end(), [](const Node& a, const Node& b) {
    return a.position.squaredNorm() < b.position.squaredNorm();
  });
  return static_cast<std::size_t>(std::distance(nodes_.begin(), nearest));
}

// Of the fit about node `at`, the nearest to the reference point, taken at that point's foot.
void CenterlineEstimator::fillCovariance(const Walls& walls, std::size_t at) {
  const auto [first, last] = widened(slide({0, 0}, at));
  const Point forward =
      (nodes_[std::min(at + 1, last)].position - nodes_[at > 0 ? at - 1 : at].position).normalized();
  const double foot = fit_->s(at) - nodes_[at].position.dot(forward);
  const ArcLengthFit::Parabola parabola = fit_->fit(first, last, foot);
  const double count = static_cast<double>(last - first + 1);
  const double spacing = (fit_->s(last) - fit_->s(first)) / (count - 1.0);
  const double deviation =
      std::max({walls.left.residual, walls.right.residual, parameters_.wall_deviation});
  const double dependent = std::max(1.0, 2.0 * parameters_.wall_correlation / spacing);
  const double variance = deviation * deviation * dependent * (paired_now_ ? 0.5 : 1.0);
  const Eigen::Matrix3d c = variance * parabola.inverse_normal;
  // (offset, heading error, curvature) = (-a, -b, 2 c); the width is the mean of as many pairs.
  const double w = 4.0 * variance / count;
  tunnel_.state.covariance = {c(0, 0),
                              c(0, 1),
                              -2.0 * c(0, 2),
                              0.0,  //
                              c(1, 0),
                              c(1, 1),
                              -2.0 * c(1, 2),
                              0.0,  //
                              -2.0 * c(2, 0),
                              -2.0 * c(2, 1),
                              4.0 * c(2, 2),
                              0.0,  //
                              0.0,
                              0.0,
                              0.0,
                              w};
}

}  // namespace tunnel_pilot::perception
