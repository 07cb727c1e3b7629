// An exact scan of 761 beams, 190 degrees, 40 m, in a drift of 400 wall segments: ours beside Embree,
// Box2D and a Bresenham walk over a grid map.

#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "harness.h"
#include "tunnel_pilot/world/ray_caster.h"

#ifdef HAVE_EMBREE
#include <embree3/rtcore.h>
#endif
#ifdef HAVE_BOX2D
#include <box2d/box2d.h>
#endif

namespace {

using tunnel_pilot::benchmark::Contest;
using tunnel_pilot::geometry::Point;
using tunnel_pilot::geometry::Pose;
using tunnel_pilot::world::RayCaster;
using tunnel_pilot::world::WallChain;

constexpr int kBeams = 761;
constexpr int kSectors = 16;
constexpr double kRangeMax = 40.0;      // [m]
constexpr double kSegmentLength = 0.5;  // [m]
const RayCaster::Beams kScan{-95.0 * M_PI / 180.0, 0.25 * M_PI / 180.0, kBeams, kRangeMax};

// A winding drift 5 m wide with rough walls, of `segments` wall segments, and poses along its middle.
struct Drift {
  std::vector<WallChain> walls;
  std::vector<Pose> poses;
};

Drift makeDrift(int segments) {
  Drift drift;
  const int steps = segments / 2;
  WallChain left, right;
  Pose pose;
  for (int i = 0; i <= steps; ++i) {
    const double s = i * kSegmentLength;
    pose.heading = 0.7 * std::sin(s / 12.0);
    const Point normal(-std::sin(pose.heading), std::cos(pose.heading));
    left.push_back(pose.position() + (2.5 + 0.07 * std::sin(1.7 * s)) * normal);
    right.push_back(pose.position() - (2.5 + 0.07 * std::sin(1.3 * s + 1.0)) * normal);
    const bool in_the_middle = std::abs(i - steps / 2) < 50;
    if (in_the_middle && i % 3 == 0) {
      const Point p = pose.position() + 0.4 * std::sin(s) * normal;
      drift.poses.push_back({p.x(), p.y(), pose.heading + 0.1 * std::cos(s)});
    }
    pose.x += kSegmentLength * std::cos(pose.heading);
    pose.y += kSegmentLength * std::sin(pose.heading);
  }
  drift.walls = {left, right};
  return drift;
}

// Hands out the drift's poses one after the other.
class Route {
 public:
  explicit Route(const std::vector<Pose>& poses) : poses_(poses) {}
  const Pose& next() { return poses_[index_++ % poses_.size()]; }

 private:
  const std::vector<Pose>& poses_;
  std::size_t index_ = 0;
};

// Beam directions of a scan from `pose`, by the angle-sum formulas, as a careful user of any of the
// peers would have them.
class Directions {
 public:
  Directions() {
    for (int i = 0; i < kBeams; ++i) {
      const double angle = kScan.angle_min + i * kScan.angle_increment;
      cosine_.push_back(static_cast<float>(std::cos(angle)));
      sine_.push_back(static_cast<float>(std::sin(angle)));
    }
  }
  void turn(const Pose& pose) {
    const auto c = static_cast<float>(std::cos(pose.heading));
    const auto s = static_cast<float>(std::sin(pose.heading));
    for (std::size_t i = 0; i < kBeams; ++i) {
      x[i] = c * cosine_[i] - s * sine_[i];
      y[i] = s * cosine_[i] + c * sine_[i];
    }
  }
  float x[kBeams];
  float y[kBeams];

 private:
  std::vector<float> cosine_;
  std::vector<float> sine_;
};

#ifdef HAVE_EMBREE
// Each wall segment is an upright quad; rays run in the plane z = 0.
class EmbreeScan {
 public:
  explicit EmbreeScan(const std::vector<WallChain>& walls)
      : device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_)) {
    for (const WallChain& chain : walls) addChain(chain);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    rtcCommitScene(scene_);
  }
  ~EmbreeScan() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeScan(const EmbreeScan&) = delete;
  EmbreeScan& operator=(const EmbreeScan&) = delete;

  void castSingle(const Pose& pose, float* ranges) {
    directions_.turn(pose);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    RTCRayHit ray{};
    for (int i = 0; i < kBeams; ++i) {
      ray.ray.org_x = static_cast<float>(pose.x);
      ray.ray.org_y = static_cast<float>(pose.y);
      ray.ray.dir_x = directions_.x[i];
      ray.ray.dir_y = directions_.y[i];
      ray.ray.tfar = static_cast<float>(kRangeMax);
      ray.ray.mask = ~0U;
      ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(scene_, &context, &ray);
      ranges[i] = ray.hit.geomID == RTC_INVALID_GEOMETRY_ID ? std::numeric_limits<float>::infinity()
                                                            : ray.ray.tfar;
    }
  }

  void castPackets(const Pose& pose, float* ranges) {
    directions_.turn(pose);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    alignas(64) RTCRayHit16 rays{};
    alignas(64) int valid[16];
    for (int first = 0; first < kBeams; first += 16) {
      for (int k = 0; k < 16; ++k) {
        const int i = std::min(first + k, kBeams - 1);
        valid[k] = first + k < kBeams ? -1 : 0;
        rays.ray.org_x[k] = static_cast<float>(pose.x);
        rays.ray.org_y[k] = static_cast<float>(pose.y);
        rays.ray.dir_x[k] = directions_.x[i];
        rays.ray.dir_y[k] = directions_.y[i];
        rays.ray.tfar[k] = static_cast<float>(kRangeMax);
        rays.ray.mask[k] = ~0U;
        rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect16(valid, scene_, &context, &rays);
      for (int k = 0; k < 16 && first + k < kBeams; ++k) {
        const bool hit = rays.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
        ranges[first + k] = hit ? rays.ray.tfar[k] : std::numeric_limits<float>::infinity();
      }
    }
  }

 private:
  void addChain(const WallChain& chain) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_QUAD);
    auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 2 * chain.size()));
    for (const Point& p : chain) {
      for (const float z : {-1.0F, 1.0F}) {
        *vertex++ = static_cast<float>(p.x());
        *vertex++ = static_cast<float>(p.y());
        *vertex++ = z;
      }
    }
    auto* quad = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 4 * sizeof(unsigned), chain.size() - 1));
    for (unsigned i = 0; i + 1 < chain.size(); ++i) {
      for (const unsigned corner : {2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2}) *quad++ = corner;
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }

  RTCDevice device_;
  RTCScene scene_;
  Directions directions_;
};
#endif

#ifdef HAVE_BOX2D
class Box2dScan {
 public:
  explicit Box2dScan(const std::vector<WallChain>& walls) : world_(b2Vec2(0.0F, 0.0F)) {
    b2BodyDef definition;
    b2Body* body = world_.CreateBody(&definition);
    for (const WallChain& chain : walls) {
      for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
        b2EdgeShape edge;
        edge.SetTwoSided(toBox2d(chain[i]), toBox2d(chain[i + 1]));
        body->CreateFixture(&edge, 0.0F);
      }
    }
  }

  void cast(const Pose& pose, float* ranges) {
    directions_.turn(pose);
    const b2Vec2 from(static_cast<float>(pose.x), static_cast<float>(pose.y));
    const auto reach = static_cast<float>(kRangeMax);
    for (int i = 0; i < kBeams; ++i) {
      Nearest nearest;
      world_.RayCast(&nearest, from, from + reach * b2Vec2(directions_.x[i], directions_.y[i]));
      ranges[i] =
          nearest.fraction <= 1.0F ? nearest.fraction * reach : std::numeric_limits<float>::infinity();
    }
  }

 private:
  struct Nearest : b2RayCastCallback {
    float ReportFixture(b2Fixture*, const b2Vec2&, const b2Vec2&, float at) override {
      fraction = at;
      return at;
    }
    float fraction = 2.0F;
  };
  static b2Vec2 toBox2d(const Point& p) {
    return {static_cast<float>(p.x()), static_cast<float>(p.y())};
  }

  b2World world_;
  Directions directions_;
};
#endif

// A 5 cm grid with the walls drawn by OpenCV, walked cell by cell (Bresenham 1965).
class GridScan {
 public:
  explicit GridScan(const std::vector<WallChain>& walls) {
    Point low(1e9, 1e9), high(-1e9, -1e9);
    for (const WallChain& chain : walls) {
      for (const Point& p : chain) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
    origin_ = low - Point(1.0, 1.0);
    const Point size = (high - origin_ + Point(1.0, 1.0)) / kCell;
    grid_ = cv::Mat::zeros(static_cast<int>(size.y()), static_cast<int>(size.x()), CV_8U);
    for (const WallChain& chain : walls) {
      for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
        cv::line(grid_, cellOf(chain[i]), cellOf(chain[i + 1]), 255);
      }
    }
  }

  void cast(const Pose& pose, float* ranges) {
    directions_.turn(pose);
    const cv::Point from = cellOf(pose.position());
    for (int i = 0; i < kBeams; ++i) {
      const Point end = pose.position() + kRangeMax * Point(directions_.x[i], directions_.y[i]);
      ranges[i] = walk(from, cellOf(end));
    }
  }

 private:
  static constexpr double kCell = 0.05;  // [m]

  cv::Point cellOf(const Point& p) const {
    const Point cell = (p - origin_) / kCell;
    return {static_cast<int>(std::floor(cell.x())), static_cast<int>(std::floor(cell.y()))};
  }

  float walk(cv::Point at, cv::Point to) const {
    const cv::Point from = at;
    const int dx = std::abs(to.x - at.x), dy = -std::abs(to.y - at.y);
    const int step_x = at.x < to.x ? 1 : -1, step_y = at.y < to.y ? 1 : -1;
    int error = dx + dy;
    while (at.x >= 0 && at.y >= 0 && at.x < grid_.cols && at.y < grid_.rows && at != to) {
      if (grid_.ptr(at.y)[at.x])
        return static_cast<float>(kCell * std::hypot(at.x - from.x, at.y - from.y));
      const int twice = 2 * error;
      if (twice >= dy) {
        error += dy;
        at.x += step_x;
      }
      if (twice <= dx) {
        error += dx;
        at.y += step_y;
      }
    }
    return std::numeric_limits<float>::infinity();
  }

  Point origin_;
  cv::Mat grid_;
  Directions directions_;
};

// Median difference of a peer's ranges from ours over the route [m]: whether both do the same work.
template <typename Scan>
double medianDifference(const RayCaster& caster, const std::vector<Pose>& poses, Scan scan) {
  std::vector<double> differences;
  std::vector<float> ours;
  float theirs[kBeams];
  for (const Pose& pose : poses) {
    caster.cast(pose, ours);
    scan(pose, theirs);
    for (std::size_t i = 0; i < kBeams; ++i) {
      if (std::isfinite(ours[i]))
        differences.push_back(std::abs(static_cast<double>(ours[i]) - theirs[i]));
    }
  }
  std::nth_element(differences.begin(), differences.begin() + static_cast<long>(differences.size() / 2),
                   differences.end());
  return differences[differences.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  Contest contest("ray casting", argc, argv);
  const Drift drift = makeDrift(400);
  const Drift long_drift = makeDrift(4000);
  const RayCaster caster(drift.walls, kScan);
  const RayCaster long_caster(long_drift.walls, kScan);
  Route route(drift.poses), long_route(long_drift.poses), sector_route(drift.poses);
  float ranges[kBeams];
  double embree_difference = 0.0, box2d_difference = 0.0;

  contest.add("ours", [&] { caster.cast(route.next(), ranges, 0, kBeams); });
  contest.add("ours, ten times the walls",
              [&] { long_caster.cast(long_route.next(), ranges, 0, kBeams); });
  contest.add("ours, 16 sectors", [&] {
    const Pose& pose = sector_route.next();
    for (int i = 0; i < kSectors; ++i) {
      caster.cast(pose, ranges, i * kBeams / kSectors, (i + 1) * kBeams / kSectors);
    }
  });
#ifdef HAVE_EMBREE
  EmbreeScan embree(drift.walls);
  Route packet_route(drift.poses), single_route(drift.poses);
  contest.add("Embree, packets of 16 rays", [&] { embree.castPackets(packet_route.next(), ranges); });
  contest.add("Embree, single rays", [&] { embree.castSingle(single_route.next(), ranges); });
  embree_difference =
      medianDifference(caster, drift.poses, [&](const Pose& p, float* r) { embree.castPackets(p, r); });
#else
  contest.missing("Embree (libembree-dev)");
#endif
#ifdef HAVE_BOX2D
  Box2dScan box2d(drift.walls);
  Route box2d_route(drift.poses);
  contest.add("Box2D", [&] { box2d.cast(box2d_route.next(), ranges); });
  box2d_difference =
      medianDifference(caster, drift.poses, [&](const Pose& p, float* r) { box2d.cast(p, r); });
#else
  contest.missing("Box2D (libbox2d-dev)");
#endif
  GridScan grid(drift.walls);
  Route grid_route(drift.poses);
  contest.add("Bresenham on a 5 cm grid", [&] { grid.cast(grid_route.next(), ranges); });

  if (!contest.run()) return 0;
#ifdef HAVE_EMBREE
  contest.requireFaster("Embree, packets of 16 rays", "ours", 4.0);
  contest.tell("Embree, single rays", "ours");
  contest.requireAtMost("median difference from Embree", "m", embree_difference, 1e-4);
#endif
#ifdef HAVE_BOX2D
  contest.requireFaster("Box2D", "ours", 40.0);
  contest.requireAtMost("median difference from Box2D", "m", box2d_difference, 1e-4);
#endif
  contest.tell("Bresenham on a 5 cm grid", "ours");
  contest.requireAtMost("ten times the walls, against once", "1",
                        contest.median("ours, ten times the walls") / contest.median("ours"), 1.3);
  contest.requireAtMost("a scan in 16 sectors, against at once", "1",
                        contest.median("ours, 16 sectors") / contest.median("ours"), 5.0);
  contest.requireInstructions("ours", 40000);
  contest.requireInstructions("ours, ten times the walls", 52000);
  return contest.finish();
}
