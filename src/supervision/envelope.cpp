#include "tunnel_pilot/supervision/envelope.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::supervision {
namespace {

using geometry::Frame;
using geometry::Point;
using geometry::Pose;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kStep = 1.0;              // [m] between stations and between swept poses
constexpr double kLeastWay = 6.0;          // [m] swept ahead of the front axle at any speed
constexpr double kMemoryStep = 0.5;        // [m] driven between remembered walls
constexpr double kMemoryReach = 12.0;      // [m] from base_link: beyond the tail
constexpr double kLongestWallPiece = 3.0;  // [m] a longer gap is not bridged
constexpr double kSlowest = 0.5;           // [m/s] for the steering's slope over the way
constexpr double kOnWall = 0.20;           // [m] a return nearer to the wall's curve is the rough wall's

Point leftOf(const Point& d) { return {-d.y(), d.x()}; }

}  // namespace

EnvelopeParameters loadEnvelope(config::Node node) {
  EnvelopeParameters p{};
  p.margin = node.number("margin", "m", 0.0, 2.0);
  p.smallest_obstacle = node.number("smallest_obstacle", "m", 0.05, 2.0);
  p.obstacle_points = static_cast<int>(node.integer("obstacle_points", "1", 1, 50));
  p.deceleration = node.number("deceleration", "m/s^2", 0.1, 5.0);
  p.reaction_time = node.number("reaction_time", "s", 0.0, 3.0);
  p.reserve = node.number("reserve", "m", 0.0, 10.0);
  p.horizon = node.number("horizon", "m", 6.0, 60.0);
  config::Node follower = node.child("follower");
  p.follower.offset = follower.number("offset", "rad/m", 0.01, 2.0);
  p.follower.heading = follower.number("heading", "1", 0.1, 10.0);
  follower.finish();
  node.finish();
  return p;
}

Envelope::Envelope(const EnvelopeParameters& parameters, const CommandLimiterParameters& limits,
                   const vehicle::TruckGeometry& geometry)
    : parameters_(parameters), limits_(limits), geometry_(geometry) {
  stations_.reserve(static_cast<std::size_t>(parameters.horizon / kStep) + 32);
  const double rear = geometry.rear_axle_to_hinge;
  const double rear_axle = -geometry.front_axle_to_hinge - rear;
  const auto onFront = [](double x) { return OutlinePoint{x, std::floor(x / kStep)}; };
  const auto onRear = [&](double x) { return OutlinePoint{x, std::floor((rear_axle + x) / kStep)}; };
  outline_ = {onFront(geometry.front_overhang),
              onFront(0.0),
              onFront(-geometry.front_axle_to_hinge),
              onRear(rear),
              onRear(0.5 * rear),
              onRear(0.0),
              onRear(-geometry.rear_overhang)};
}

void Envelope::reset() { remembered_ = 0; }

double Envelope::stoppingDistance(double speed) const {
  return speed * parameters_.reaction_time + speed * speed / (2.0 * parameters_.deceleration);
}

const Envelope::Result& Envelope::update(const Input& input) {
  stations_.clear();
  wall_end_ = 0.0;
  result_.free_distance = kInfinity;
  result_.free_until = End::kSight;
  layTruck(input);
  layWay(input);
  layWall(input, true);
  layWall(input, false);
  remember(input);
  limitSight(input);
  compareWalls();
  findObstacles(input.points);
  drawCorridor();
  return result_;
}

void Envelope::addStation(const Point& point, const Point& direction, double s) {
  stations_.push_back({point, direction, s, -kInfinity, kInfinity, kInfinity, -kInfinity});
}

// The spine from the tail through rear body, hinge and front body to the front axle.
void Envelope::layTruck(const Input& input) {
  const Frame front(input.truck);
  const Frame rear = vehicle::rearFrame(geometry_, front, input.articulation);
  const double hinge = geometry_.front_axle_to_hinge;
  const double tail = hinge + geometry_.rear_axle_to_hinge + geometry_.rear_overhang;
  for (double back = std::ceil(tail); back > 0.5; back -= kStep) {
    const bool on_front = back <= hinge;
    const Frame& body = on_front ? front : rear;
    const double x = on_front ? -back : geometry_.rear_axle_to_hinge + hinge - back;
    addStation(body.transform({x, 0.0}), body.direction(), -back);
  }
  front_axle_ = stations_.size();
}

// A stop's, `braking` [m] after it began; before an obstacle or a bend the truck is no faster.
double Envelope::brakedSpeed(double speed, double braking) const {
  const double square = speed * speed - 2.0 * parameters_.deceleration * std::max(0.0, braking);
  return std::max(kSlowest, std::sqrt(std::max(0.0, square)));
}

// Of the front axle, on a way of this curvature [1/m].
double Envelope::slipAngle(const Input& input, double speed, double articulation,
                           double curvature) const {
  return -input.slip_compliance * speed * speed * curvature +
         (input.response.gain - 1.0) * std::tan(0.5 * articulation);
}

// The spine ahead: the front axle's expected way, and the bodies swept along it.
void Envelope::layWay(const Input& input) {
  const double way = std::min(parameters_.horizon, kLeastWay + 2.0 * stoppingDistance(input.speed));
  const double held = input.speed * parameters_.reaction_time;
  const bool on_path = !input.profile.empty();
  geometry::PathProjection place;
  const Pose on_centerline = input.path_frame.relative(input.truck);
  if (on_path) {
    place = input.centerline.project(on_centerline.position());
    path_ahead_ = input.centerline.points().back().s - place.s;
  }
  double heading_error = geometry::wrapAngle(on_centerline.heading - place.heading);
  Frame front(input.truck);
  double articulation = input.articulation;
  double slip = slipAngle(input, input.speed, articulation,
                          vehicle::yawRate(geometry_, input.response.gain, articulation, 0.0));
  std::vector<Posture>& postures = postures_;
  postures.clear();
  for (double s = 0.0;; s += kStep) {
    addStation(front.pose().position(), front.direction(), s);
    postures.push_back({front, articulation});
    if (s + kStep > way) break;
    const double target =
        on_path && s >= held
            ? drivers::followPath(input.profile, parameters_.follower, place.s, place.lateral_offset,
                                  heading_error + slip, limits_.max_articulation) /
                  input.response.gain
            : input.commanded_articulation;
    const double speed = brakedSpeed(input.speed, s - held);
    const double slope = limits_.max_articulation_rate / speed;
    const double change = std::clamp(target - articulation, -slope * kStep, slope * kStep);
    const double middle = articulation + 0.5 * change;
    const double turn = vehicle::yawRate(geometry_, input.response.gain * kStep, middle, change) +
                        kStep * input.response.disturbance;
    slip = slipAngle(input, speed, middle, turn / kStep);
    articulation += change;
    const double course = 0.5 * turn + slip;
    front = Frame(front.compose({kStep * std::cos(course), kStep * std::sin(course), turn}));
    if (!on_path) continue;
    const double curvature = input.profile.curvatureAt(place.s);
    place.lateral_offset += kStep * std::sin(heading_error + slip + 0.5 * (turn - curvature * kStep));
    place.s += kStep;
    heading_error += turn - curvature * kStep;
  }
  const Frame& last = postures.back().front;
  for (double beyond = kStep; beyond < geometry_.front_overhang + kStep; beyond += kStep) {
    addStation(last.transform({beyond, 0.0}), last.direction(), stations_.back().s + kStep);
  }
  for (std::size_t i = 0; i < postures.size(); ++i) sweepBodies(front_axle_ + i, postures[i], i == 0);
}

// Each outline point's way from posture to posture is a line beside the spine; of the first posture the
// sides themselves are laid, from point to point.
void Envelope::sweepBodies(std::size_t station, const Posture& posture, bool first) {
  const Frame rear = vehicle::rearFrame(geometry_, posture.front, posture.articulation);
  const double half = 0.5 * geometry_.overall_width;
  for (std::size_t i = 0; i < kOutline; ++i) {
    const Frame& body = i < kFrontOutline ? posture.front : rear;
    const auto near = static_cast<std::size_t>(
        std::max(0.0, static_cast<double>(station) + outline_[i].stations_ahead));
    for (const bool left : {true, false}) {
      const Beside place = beside(body.transform({outline_[i].along, left ? half : -half}), near);
      Beside& last = swept_[left ? i : kOutline + i];
      if (!first) layEdge(last, place, left);
      if (first && i != 0 && i != kFrontOutline)
        layEdge(swept_[left ? i - 1 : kOutline + i - 1], place, left);
      last = place;
    }
  }
}

Envelope::Beside Envelope::beside(const Point& point, std::size_t near) const {
  std::size_t i = std::min(near, stations_.size() - 1);
  double along = (point - stations_[i].point).dot(stations_[i].direction);
  while (along >= kStep && i + 1 < stations_.size()) {
    ++i;
    along = (point - stations_[i].point).dot(stations_[i].direction);
  }
  while (along < 0.0 && i > 0) {
    --i;
    along = (point - stations_[i].point).dot(stations_[i].direction);
  }
  const double lateral = (point - stations_[i].point).dot(leftOf(stations_[i].direction));
  return {i, stations_[i].s + along, lateral};
}

// Calls take(station, lateral) for every station between two places, the lateral interpolated.
template <typename Take>
void Envelope::between(const Beside& a, const Beside& b, const Take& take) {
  const Beside& low = a.s <= b.s ? a : b;
  const Beside& high = a.s <= b.s ? b : a;
  for (std::size_t i = low.station; i <= high.station; ++i) {
    Station& station = stations_[i];
    if (station.s < low.s || station.s > high.s) continue;
    const double span = high.s - low.s;
    const double t = span > 0.0 ? (station.s - low.s) / span : 0.0;
    take(station, low.lateral + t * (high.lateral - low.lateral));
  }
}

void Envelope::layEdge(const Beside& a, const Beside& b, bool left) {
  between(a, b, [left](Station& station, double lateral) {
    double& edge = left ? station.left : station.right;
    edge = left ? std::max(edge, lateral) : std::min(edge, lateral);
  });
}

void Envelope::layWallPiece(const Beside& a, const Beside& b, bool left) {
  if (std::abs(b.s - a.s) > kLongestWallPiece) return;
  between(a, b, [left](Station& station, double lateral) {
    double& wall = left ? station.wall_left : station.wall_right;
    wall = left ? std::min(wall, lateral) : std::max(wall, lateral);
  });
}

// The walls passed, in the order in which they were remembered, and then the one seen now.
void Envelope::layWall(const Input& input, bool left) {
  const perception::Wall& wall = left ? input.walls.left : input.walls.right;
  std::optional<Beside> last;
  const auto lay = [&](const Beside& place) {
    if (last) layWallPiece(*last, place, left);
    last = place;
  };
  const Frame scan(input.scan_pose);
  const std::size_t oldest = remembered_ - std::min(remembered_, memory_.size());
  for (std::size_t i = oldest; i < remembered_; ++i) {
    const Remembered& passed = memory_[i % memory_.size()];
    if (passed.left != left) continue;
    const Point point = scan.inverseTransform(passed.point);
    if (point.squaredNorm() < kMemoryReach * kMemoryReach) lay(beside(point, front_axle_));
  }
  if (!wall.found) return;
  for (const Point& point : wall.curve) {
    lay(beside(point, last ? last->station : front_axle_));
    wall_end_ = std::max(wall_end_, last->s);
  }
}

// Keeps where the walls began in this scan: the lidar at the nose will not see them again.
void Envelope::remember(const Input& input) {
  const Point here = input.scan_pose.position();
  if (remembered_ > 0 && (here - last_remembered_at_).norm() < kMemoryStep) return;
  last_remembered_at_ = here;
  for (const bool left : {true, false}) {
    const perception::Wall& wall = left ? input.walls.left : input.walls.right;
    if (!wall.found || wall.curve.empty()) continue;
    memory_[remembered_ % memory_.size()] = {input.scan_pose.transform(wall.curve.front()), left};
    ++remembered_;
  }
}

void Envelope::endFreeSpace(double s, End why) {
  const double distance = std::max(0.0, s - geometry_.front_overhang);
  if (distance >= result_.free_distance) return;
  result_.free_distance = distance;
  result_.free_until = why;
}

void Envelope::limitSight(const Input& input) {
  endFreeSpace(input.profile.empty() ? wall_end_ : path_ahead_, End::kSight);
}

void Envelope::compareWalls() {
  double left = kInfinity;
  double right = kInfinity;
  for (const Station& station : stations_) {
    if (!(station.left >= station.right)) continue;  // nothing passes
    const double room_left = station.wall_left - station.left;
    const double room_right = station.right - station.wall_right;
    left = std::min(left, room_left);
    right = std::min(right, room_right);
    if (std::min(room_left, room_right) < parameters_.margin) endFreeSpace(station.s, End::kWall);
  }
  const auto known = [](double room) {
    return room < kInfinity ? room : std::numeric_limits<double>::quiet_NaN();
  };
  result_.clearance_left = known(left);
  result_.clearance_right = known(right);
}

// Returns inside the corridor count as an obstacle when enough of them stand beside each other, thinned
// to one every smallest_obstacle / (obstacle_points + 1), so that lone dust does not stop the truck.
void Envelope::findObstacles(const std::vector<Point>& points) {
  const double apart = parameters_.smallest_obstacle / (parameters_.obstacle_points + 1);
  const double together = parameters_.smallest_obstacle;
  std::size_t near = front_axle_;
  Point last(kInfinity, kInfinity);
  Point last_inside(kInfinity, kInfinity);
  int run = 0;
  bool run_on_wall = true;
  double run_s = kInfinity;
  for (const Point& point : points) {
    if (!((point - last).squaredNorm() >= apart * apart)) continue;  // also NaN
    last = point;
    const Beside place = beside(point, near);
    near = place.station;
    if (!inCorridor(place)) continue;
    const bool joined = (point - last_inside).squaredNorm() < together * together;
    run = joined ? run + 1 : 1;
    run_s = joined ? std::min(run_s, place.s) : place.s;
    run_on_wall = (run_on_wall || !joined) && onWall(place);
    last_inside = point;
    if (run < parameters_.obstacle_points) continue;
    endFreeSpace(run_s, run_on_wall ? End::kWall : End::kObstacle);
  }
}

bool Envelope::onWall(const Beside& place) const {
  const Station& station = stations_[place.station];
  return place.lateral > station.wall_left - kOnWall || place.lateral < station.wall_right + kOnWall;
}

bool Envelope::inCorridor(const Beside& place) const {
  const Station& a = stations_[place.station];
  const Station& b = stations_[std::min(place.station + 1, stations_.size() - 1)];
  const double t = (place.s - a.s) / kStep;
  if (t < 0.0 || t > 1.0 || !(a.left >= a.right) || !(b.left >= b.right)) return false;
  return place.lateral < a.left + t * (b.left - a.left) + parameters_.margin &&
         place.lateral > a.right + t * (b.right - a.right) - parameters_.margin;
}

void Envelope::drawCorridor() {
  result_.corridor_left.clear();
  result_.corridor_right.clear();
  for (const Station& station : stations_) {
    if (!(station.left >= station.right)) continue;
    const Point left = leftOf(station.direction);
    result_.corridor_left.push_back(station.point + station.left * left);
    result_.corridor_right.push_back(station.point + station.right * left);
  }
}

}  // namespace tunnel_pilot::supervision
