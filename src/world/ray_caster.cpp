#include "tunnel_pilot/world/ray_caster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

// Each wall segment is visited once, instead of each beam: it covers an interval of beams, found from
// its two end points' angles, and in that interval the inverse range is c A + s B for a beam of
// direction (c, s). Consecutive segments share the angle of their common vertex, so no beam slips
// between them. The loops over a chunk's vertices have fixed lengths and no branches, so that the
// compiler makes vector instructions of them.
//
// Float is used where its rounding stays far below 2 mm, and double where it would not: for the pose's
// subtraction, for vertices within rounding of a beam, and for segments seen nearly edge-on.

namespace tunnel_pilot::world {
namespace {

using geometry::Point;
using geometry::Pose;

constexpr int kVertices = 16;  // in a chunk, the last one repeated where there are less
constexpr int kSegments = kVertices - 1;
constexpr int kLane = 4;           // beams filled at once
constexpr std::size_t kGroup = 8;  // chunks culled together
constexpr int kMaxBeams = 16384;
constexpr float kSlack = 1e-3F;       // of bounds, for the rounding of float [m]
constexpr double kAngleError = 5e-6;  // bound on the float angle's error [rad]
// A beam that meets a line at range r, where the line passes the sensor at distance h, has a rounding
// error of about 2e-7 r^2 / h: below 0.5 mm where h exceeds this times r^2.
constexpr float kGrazing = 4e-4F;  // [1/m]

// What encloses a chunk or a group of them: all points within `thickness` of a line through the middle,
// half of which is (along_x, along_y). Walls are long and thin, so this culls far better than a circle.
struct Bounds {
  double x;  // middle [m]
  double y;
  float along_x;
  float along_y;
  float thickness;
  float radius;  // of the circle about the middle [m]
};

// Bounds of a group's chunks, field by field, so that all can be looked at together.
struct GroupedBounds {
  alignas(32) double x[kGroup];
  alignas(32) double y[kGroup];
  alignas(32) float along_x[kGroup];
  alignas(32) float along_y[kGroup];
  alignas(32) float thickness[kGroup];
  alignas(32) float radius[kGroup];

  void set(std::size_t i, const Bounds& b) {
    x[i] = b.x;
    y[i] = b.y;
    along_x[i] = b.along_x;
    along_y[i] = b.along_y;
    thickness[i] = b.thickness;
    radius[i] = b.radius;
  }
};

// Chains cut into chunks of at most kSegments segments, and groups of kGroup chunks.
class ChunkList {
 public:
  void assign(const std::vector<WallChain>& chains) {
    bounds.clear();
    groups.clear();
    grouped.clear();
    x.clear();
    y.clear();
    for (const WallChain& chain : chains) {
      for (std::size_t first = 0; first + 1 < chain.size(); first += kSegments) {
        add(&chain[first], std::min<std::size_t>(kVertices, chain.size() - first));
      }
    }
    for (std::size_t first = 0; first < bounds.size(); first += kGroup) addGroup(first);
  }

  std::vector<Bounds> bounds;          // of the chunks
  std::vector<Bounds> groups;          // the circles round groups
  std::vector<GroupedBounds> grouped;  // the chunks' bounds again, the last one repeated at the end
  std::vector<double> x;               // kVertices a chunk [m]
  std::vector<double> y;

 private:
  void addGroup(std::size_t first) {
    const std::size_t last = std::min(first + kGroup, bounds.size());
    Point middle(0.0, 0.0);
    for (std::size_t i = first; i < last; ++i) {
      middle += Point(bounds[i].x, bounds[i].y) / static_cast<double>(last - first);
    }
    double radius = 0.0;
    for (std::size_t i = first; i < last; ++i) {
      const double far = std::hypot(bounds[i].x - middle.x(), bounds[i].y - middle.y());
      radius = std::max(radius, far + static_cast<double>(bounds[i].radius));
    }
    const float circle = static_cast<float>(radius) + kSlack;
    groups.push_back({middle.x(), middle.y(), 0.0F, 0.0F, circle, circle});
    grouped.emplace_back();
    for (std::size_t i = 0; i < kGroup; ++i) {
      grouped.back().set(i, bounds[std::min(first + i, bounds.size() - 1)]);
    }
  }

  void add(const Point* vertices, std::size_t count) {
    Point along = vertices[count - 1] - vertices[0];
    along = along.norm() > 0.0 ? along.normalized() : Point(1.0, 0.0);
    const Point across(-along.y(), along.x());
    Point low(1e300, 1e300);
    Point high(-1e300, -1e300);
    for (std::size_t i = 0; i < count; ++i) {
      if (!vertices[i].allFinite()) throw std::invalid_argument("a wall vertex is not finite");
      const Point p(vertices[i].dot(along), vertices[i].dot(across));
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const Point middle = 0.5 * (low.x() + high.x()) * along + 0.5 * (low.y() + high.y()) * across;
    const Point half = 0.5 * (high - low);
    bounds.push_back({middle.x(), middle.y(), static_cast<float>(half.x() * along.x()),
                      static_cast<float>(half.x() * along.y()), static_cast<float>(half.y()) + kSlack,
                      static_cast<float>(half.norm()) + kSlack});
    for (std::size_t i = 0; i < kVertices; ++i) {
      x.push_back(vertices[std::min(i, count - 1)].x());
      y.push_back(vertices[std::min(i, count - 1)].y());
    }
  }
};

// The beams [first, last) of one scan: where they start, where they look, what they have met so far.
struct View {
  double x, y;          // sensor [m]
  double cosine, sine;  // of the middle direction of all beams, in the map
  int first, last;
  Eigen::Vector2f right;  // direction of the first beam, in the map
  Eigen::Vector2f left;   // direction of the last beam, in the map
  bool wide;              // the beams span more than half a turn
  float range_max;        // [m]
  float* inverse;         // 1 / range by beam [1/m]

  // False when what is enclosed lies out of range or beside all beams.
  bool mayMeet(const Bounds& b) const {
    return mayMeet(b.x, b.y, b.along_x, b.along_y, b.thickness, b.radius) != 0;
  }

  // The same for all chunks of a group.
  void mayMeet(const GroupedBounds& b, int* meets) const {
    for (std::size_t i = 0; i < kGroup; ++i) {
      meets[i] = mayMeet(b.x[i], b.y[i], b.along_x[i], b.along_y[i], b.thickness[i], b.radius[i]);
    }
  }

  // Numbers and no branches, for vector loops.
  int mayMeet(double middle_x, double middle_y, float along_x, float along_y, float thickness,
              float radius) const {
    const auto dx = static_cast<float>(middle_x - x);
    const auto dy = static_cast<float>(middle_y - y);
    const float reach = range_max + radius;
    const int in_range = dx * dx + dy * dy > reach * reach ? 0 : 1;
    const auto partlyLeftOf = [&](float ray_x, float ray_y) {
      const float half = std::abs(ray_x * along_y - ray_y * along_x);
      return ray_x * dy - ray_y * dx + half + thickness >= 0.0F ? 1 : 0;
    };
    const int left_of_first = partlyLeftOf(right.x(), right.y());
    const int right_of_last = partlyLeftOf(-left.x(), -left.y());
    return in_range & (wide ? left_of_first | right_of_last : left_of_first & right_of_last);
  }
};

// Kinds of segments, numbers because they are told apart in vector loops.
constexpr int kPlain = 0;
constexpr int kEdgeOn = 1;  // nearly in line with the beams
constexpr int kBehind = 2;  // passes behind the sensor, where the places begin and end

// What the vertices and segments of a chunk are in the sensor's frame, whose x axis is the middle beam.
struct Projected {
  // One more vertex, the last one again, so that there are as many segments as vertices.
  alignas(32) float x[kVertices + 1];
  alignas(32) float y[kVertices + 1];
  alignas(32) float u[kVertices + 1];  // place among the beams: their index, not rounded
  alignas(32) float a[kVertices];
  alignas(32) float b[kVertices];
  alignas(32) int from[kVertices];
  alignas(32) int to[kVertices];
  alignas(32) int kind[kVertices];  // one of the following
};

// atan on [0, 1], error below 2e-6.
inline float atanUnit(float t) {
  const float q = t * t;
  return t * (0.99997726F +
              q * (-0.33262347F +
                   q * (0.19354346F + q * (-0.11643287F + q * (0.05265332F - q * 0.01172120F)))));
}

}  // namespace

struct RayCaster::Impl {
  Beams beams{};
  double middle = 0.0;        // angle of the middle of all beams [rad]
  double middle_beam = 0.0;   // its place among the beams
  double per_radian = 0.0;    // beams a radian
  float window = 0.0F;        // a vertex nearer to a beam is placed in double [beams]
  std::vector<float> cosine;  // of the beams, from the middle
  std::vector<float> sine;
  std::vector<double> exact_cosine;
  std::vector<double> exact_sine;
  ChunkList walls;
  ChunkList moving;

  explicit Impl(const Beams& wanted);
  View view(const Pose& sensor, int first, int last, float* inverse) const;
  void castList(const ChunkList& list, const View& view) const;
  void castChunk(const double* x, const double* y, const View& view) const;
  void project(const double* x, const double* y, const View& view, Projected& p) const;
  void placeExactly(const double* x, const double* y, const View& view, Projected& p) const;
  void makeSegments(const View& view, Projected& p) const;
  void fill(float a, float b, int from, int to, float* inverse) const;
  void fillExactly(const double* x, const double* y, const View& view, int from, int to) const;
};

RayCaster::Impl::Impl(const Beams& wanted) : beams(wanted) {
  const double span = (wanted.count - 1) * wanted.angle_increment;
  if (wanted.count < 1 || wanted.count > kMaxBeams || !std::isfinite(wanted.angle_min) ||
      !(wanted.angle_increment > 0.0) || !(span <= 2.0 * M_PI + 1e-6) ||
      !(wanted.range_max > 0.0 && wanted.range_max <= 1e4)) {
    throw std::invalid_argument(
        "beams need a count of 1 to 16384, a finite angle_min [rad], a positive angle_increment [rad] "
        "that "
        "spans at most a full turn, and a range_max [m] in (0, 10000]");
  }
  middle_beam = 0.5 * (wanted.count - 1);
  middle = wanted.angle_min + middle_beam * wanted.angle_increment;
  per_radian = 1.0 / wanted.angle_increment;
  window = static_cast<float>(kAngleError * per_radian) +
           4.0F * std::numeric_limits<float>::epsilon() * static_cast<float>(M_PI * per_radian);
  for (int i = 0; i < wanted.count; ++i) {
    const double angle = (i - middle_beam) * wanted.angle_increment;
    exact_cosine.push_back(std::cos(angle));
    exact_sine.push_back(std::sin(angle));
    cosine.push_back(static_cast<float>(exact_cosine.back()));
    sine.push_back(static_cast<float>(exact_sine.back()));
  }
}

View RayCaster::Impl::view(const Pose& sensor, int first, int last, float* inverse) const {
  View v{};
  v.x = sensor.x;
  v.y = sensor.y;
  v.cosine = std::cos(sensor.heading + middle);
  v.sine = std::sin(sensor.heading + middle);
  v.first = first;
  v.last = last;
  const auto direction = [&](int beam) {
    const auto k = static_cast<std::size_t>(beam);
    return Eigen::Vector2f(static_cast<float>(v.cosine * exact_cosine[k] - v.sine * exact_sine[k]),
                           static_cast<float>(v.sine * exact_cosine[k] + v.cosine * exact_sine[k]));
  };
  v.right = direction(first);
  v.left = direction(last - 1);
  v.wide = (last - 1 - first) * beams.angle_increment > M_PI;
  v.range_max = static_cast<float>(beams.range_max);
  v.inverse = inverse;
  return v;
}

void RayCaster::Impl::castList(const ChunkList& list, const View& view) const {
  for (std::size_t group = 0; group < list.groups.size(); ++group) {
    if (!view.mayMeet(list.groups[group])) continue;
    alignas(32) int meets[kGroup];
    view.mayMeet(list.grouped[group], meets);
    const std::size_t first = group * kGroup;
    const std::size_t count = std::min(kGroup, list.bounds.size() - first);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t vertices = (first + i) * kVertices;
      if (meets[i] != 0) castChunk(&list.x[vertices], &list.y[vertices], view);
    }
  }
}

void RayCaster::Impl::project(const double* x, const double* y, const View& view, Projected& p) const {
  const auto c = static_cast<float>(view.cosine);
  const auto s = static_cast<float>(view.sine);
  const auto scale = static_cast<float>(per_radian);
  const auto middle_place = static_cast<float>(middle_beam);
  for (int i = 0; i < kVertices; ++i) {
    const auto dx = static_cast<float>(x[i] - view.x);
    const auto dy = static_cast<float>(y[i] - view.y);
    p.x[i] = c * dx + s * dy;
    p.y[i] = c * dy - s * dx;
  }
  for (int i = 0; i < kVertices; ++i) {
    const float ax = std::abs(p.x[i]);
    const float ay = std::abs(p.y[i]);
    const float large = (ax > ay ? ax : ay) + 1e-30F;
    const float small = ax > ay ? ay : ax;
    float angle = atanUnit(small / large);
    angle = ay > ax ? static_cast<float>(M_PI_2) - angle : angle;
    angle = p.x[i] < 0.0F ? static_cast<float>(M_PI) - angle : angle;
    angle = p.y[i] < 0.0F ? -angle : angle;
    p.u[i] = angle * scale + middle_place;
  }
}

// Where float cannot tell on which side of a beam a vertex lies, double does.
void RayCaster::Impl::placeExactly(const double* x, const double* y, const View& view,
                                   Projected& p) const {
  constexpr float kRounder = 12582912.0F;  // 1.5 * 2^23: adding and taking it away rounds
  int near_a_beam = 0;
  for (int i = 0; i < kVertices; ++i) {
    const float nearest = (p.u[i] + kRounder) - kRounder;
    near_a_beam |= std::abs(p.u[i] - nearest) < window ? 1 : 0;
  }
  if (near_a_beam == 0) return;
  for (int i = 0; i < kVertices; ++i) {
    const float nearest = std::nearbyint(p.u[i]);
    if (std::abs(p.u[i] - nearest) >= window) continue;
    const double dx = x[i] - view.x;
    const double dy = y[i] - view.y;
    const double angle =
        std::atan2(view.cosine * dy - view.sine * dx, view.cosine * dx + view.sine * dy);
    const double beyond = angle * per_radian + middle_beam - static_cast<double>(nearest);
    p.u[i] = beyond == 0.0 ? nearest : nearest + std::copysign(window, static_cast<float>(beyond));
  }
}

void RayCaster::Impl::makeSegments(const View& view, Projected& p) const {
  const auto half_turn = static_cast<float>(M_PI * per_radian);
  const auto first = static_cast<float>(view.first);
  const auto last = static_cast<float>(view.last - 1);
  p.x[kVertices] = p.x[kSegments];
  p.y[kVertices] = p.y[kSegments];
  p.u[kVertices] = p.u[kSegments];
  for (int i = 0; i < kVertices; ++i) {
    const float dx = p.x[i + 1] - p.x[i];
    const float dy = p.y[i + 1] - p.y[i];
    const float cross = p.x[i] * dy - p.y[i] * dx;
    const float start2 = p.x[i] * p.x[i] + p.y[i] * p.y[i];
    const float end2 = p.x[i + 1] * p.x[i + 1] + p.y[i + 1] * p.y[i + 1];
    const float limit = kGrazing * (start2 > end2 ? start2 : end2);
    const float inverse_cross = 1.0F / cross;
    p.a[i] = dy * inverse_cross;
    p.b[i] = -dx * inverse_cross;
    const float low = p.u[i] < p.u[i + 1] ? p.u[i] : p.u[i + 1];
    const float high = p.u[i] < p.u[i + 1] ? p.u[i + 1] : p.u[i];
    const float from = low > first ? low : first;
    const float to = high < last ? high : last;
    const int whole_from = static_cast<int>(from);
    const int whole_to = static_cast<int>(to);
    p.from[i] = whole_from + (static_cast<float>(whole_from) < from ? 1 : 0);
    p.to[i] = whole_to - (static_cast<float>(whole_to) > to ? 1 : 0);
    const int grazing = cross * cross < (dx * dx + dy * dy) * (limit * limit) ? kEdgeOn : kPlain;
    p.kind[i] = high - low > half_turn ? kBehind : grazing;
  }
}

inline void RayCaster::Impl::fill(float a, float b, int from, int to, float* __restrict inverse) const {
  const float* __restrict c = cosine.data();
  const float* __restrict s = sine.data();
  const auto offer = [&](int i) {
    const float value = c[i] * a + s[i] * b;
    inverse[i] = value > inverse[i] ? value : inverse[i];
  };
  int i = from;
  for (; i + kLane <= to + 1; i += kLane) {
    for (int k = 0; k < kLane; ++k) offer(i + k);
  }
#pragma GCC unroll 1
  for (; i <= to; ++i) offer(i);
}

void RayCaster::Impl::fillExactly(const double* x, const double* y, const View& view, int from,
                                  int to) const {
  const auto toSensor = [&](double px, double py) {
    const double dx = px - view.x;
    const double dy = py - view.y;
    return Point(view.cosine * dx + view.sine * dy, view.cosine * dy - view.sine * dx);
  };
  const Point start = toSensor(x[0], y[0]);
  const Point end = toSensor(x[1], y[1]);
  const Point along = end - start;
  const double cross = start.x() * along.y() - start.y() * along.x();
  // The sensor on the segment's line: the nearer end is seen, or the segment touches the sensor.
  const double in_line = start.dot(end) <= 0.0 ? 0.0 : std::min(start.norm(), end.norm());
  for (int i = from; i <= to; ++i) {
    const auto k = static_cast<std::size_t>(i);
    double range = cross / (exact_cosine[k] * along.y() - exact_sine[k] * along.x());
    if (!(range > 0.0 && range < 1e12)) range = in_line;
    const auto value = static_cast<float>(1.0 / range);
    view.inverse[i] = std::max(view.inverse[i], value);
  }
}

void RayCaster::Impl::castChunk(const double* x, const double* y, const View& view) const {
  Projected p;
  project(x, y, view, p);
  placeExactly(x, y, view, p);
  makeSegments(view, p);
  for (int i = 0; i < kSegments; ++i) {
    if (p.kind[i] == kPlain) {
      fill(p.a[i], p.b[i], p.from[i], p.to[i], view.inverse);
    } else if (p.kind[i] == kEdgeOn) {
      fillExactly(x + i, y + i, view, p.from[i], p.to[i]);
    } else {  // from the greater place to the last beam, and from the first beam to the lesser place
      const float low = std::min(p.u[i], p.u[i + 1]);
      const float high = std::max(p.u[i], p.u[i + 1]);
      const int from = std::max(view.first, static_cast<int>(std::ceil(high)));
      const int to = std::min(view.last - 1, static_cast<int>(std::floor(low)));
      fillExactly(x + i, y + i, view, from, view.last - 1);
      fillExactly(x + i, y + i, view, view.first, to);
    }
  }
}

RayCaster::RayCaster(const std::vector<WallChain>& walls, const Beams& beams)
    : impl_(std::make_unique<Impl>(beams)) {
  impl_->walls.assign(walls);
}
RayCaster::~RayCaster() = default;
RayCaster::RayCaster(RayCaster&&) noexcept = default;
RayCaster& RayCaster::operator=(RayCaster&&) noexcept = default;

void RayCaster::setMovingChains(const std::vector<WallChain>& chains) { impl_->moving.assign(chains); }

void RayCaster::cast(const Pose& sensor, float* ranges, int first, int last) const {
  if (first < 0 || last > impl_->beams.count || first > last) {
    throw std::invalid_argument("beams [" + std::to_string(first) + ", " + std::to_string(last) +
                                ") are not of this scan");
  }
  if (!std::isfinite(sensor.x) || !std::isfinite(sensor.y) || !std::isfinite(sensor.heading)) {
    throw std::invalid_argument("the sensor's pose is not finite");
  }
  if (first == last) return;
  alignas(32) std::array<float, kMaxBeams> inverse;
  std::fill(&inverse[static_cast<std::size_t>(first)], &inverse[static_cast<std::size_t>(last)], 0.0F);
  const View view = impl_->view(sensor, first, last, inverse.data());
  impl_->castList(impl_->walls, view);
  impl_->castList(impl_->moving, view);
  const float least = 1.0F / view.range_max;
  for (int i = first; i < last; ++i) {
    const float value = inverse[static_cast<std::size_t>(i)];
    ranges[i] = value >= least ? 1.0F / value : std::numeric_limits<float>::infinity();
  }
}

void RayCaster::cast(const Pose& sensor, std::vector<float>& ranges) const {
  ranges.resize(static_cast<std::size_t>(impl_->beams.count));
  cast(sensor, ranges.data(), 0, impl_->beams.count);
}

}  // namespace tunnel_pilot::world
