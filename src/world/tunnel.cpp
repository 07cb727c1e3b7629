#include "tunnel.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

namespace tunnel_pilot::world {
namespace {

using geometry::Path;
using geometry::PathPoint;
using geometry::Point;

constexpr double kFoldLimit = 0.9;  // curvature times wall offset; at 1 the inner wall would be a point
constexpr double kMaxWallPoints = 20000.0;  // of one wall
constexpr double kCornerSmoothing = 1.0;    // roughness fades out towards an opening's corners [m]

Point normalOf(const PathPoint& p) { return {-std::sin(p.heading), std::cos(p.heading)}; }
Point positionOf(const PathPoint& p) { return {p.x, p.y}; }

// Wall vertices with the arc length that each belongs to.
struct TaggedChain {
  WallChain points;
  std::vector<double> s;

  void add(const Point& point, double at) {
    points.push_back(point);
    s.push_back(at);
  }
};

// Points by squares of a net: what is nearer to a point than a square's side lies in its square or in
// one of the eight around it.
class Net {
 public:
  explicit Net(double side) : side_(side) {}

  void add(const Point& point, std::size_t index) { squares_[squareOf(point)].push_back(index); }

  template <class Visit>
  void visitNear(const Point& point, Visit visit) const {
    const Square middle = squareOf(point);
    for (const double dx : {-1.0, 0.0, 1.0}) {
      for (const double dy : {-1.0, 0.0, 1.0}) {
        const auto found = squares_.find({middle.first + dx, middle.second + dy});
        if (found == squares_.end()) continue;
        std::for_each(found->second.begin(), found->second.end(), visit);
      }
    }
  }

 private:
  using Square = std::pair<double, double>;  // whole numbers
  Square squareOf(const Point& point) const {
    return {std::floor(point.x() / side_), std::floor(point.y() / side_)};
  }

  double side_;
  std::map<Square, std::vector<std::size_t>> squares_;
};

class WallBuilder {
 public:
  explicit WallBuilder(const TunnelPlan& plan)
      : plan_(plan), line_(geometry::buildPath(plan.pieces, {}, plan.wall_spacing, plan.closed)) {
    for (const PathPoint& p : line_.points()) s_.push_back(p.s);
    if (plan.closed) s_.pop_back();  // it is the first again
  }

  TunnelWalls build() {
    TunnelWalls walls;
    TaggedChain all;
    for (const bool left : {true, false}) {
      TaggedChain chain = wall(left);
      all.points.insert(all.points.end(), chain.points.begin(), chain.points.end());
      all.s.insert(all.s.end(), chain.s.begin(), chain.s.end());
      walls.chains.push_back(std::move(chain.points));
    }
    walls.conflict = foldOf();
    if (walls.conflict.empty()) walls.conflict = conflictOf(all);
    return walls;
  }

 private:
  double halfWidth(double s) const { return 0.5 * widthAt(plan_, s); }

  TaggedChain wall(bool left) const {
    const double side = left ? 1.0 : -1.0;
    Draws draws(plan_.seed, left ? 1 : 2);
    const std::vector<double> rough =
        roughnessAlong(s_, line_.length(), plan_.closed, plan_.roughness, draws);
    std::vector<Opening> openings;
    for (const Opening& o : plan_.openings) {
      if (o.left == left) openings.push_back(o);
    }
    std::sort(openings.begin(), openings.end(),
              [](const Opening& a, const Opening& b) { return a.at < b.at; });
    TaggedChain chain;
    auto next = openings.begin();
    for (std::size_t i = 0; i < s_.size(); ++i) {
      for (; next != openings.end() && s_[i] >= next->at - 0.5 * next->width; ++next) {
        addOpening(*next, side, draws, chain);
      }
      const bool inside =
          next != openings.begin() && s_[i] <= std::prev(next)->at + 0.5 * std::prev(next)->width;
      if (inside) continue;
      const PathPoint& p = line_.points()[i];
      chain.add(positionOf(p) + side * (halfWidth(p.s) + rough[i]) * normalOf(p), p.s);
    }
    if (plan_.closed) chain.add(chain.points.front(), chain.s.front());
    return chain;
  }

  // The wall's way round a recess: out, along the face, back.
  void addOpening(const Opening& o, double side, Draws& draws, TaggedChain& chain) const {
    const PathPoint middle = line_.at(o.at);
    const Point outward = side * normalOf(middle);
    const Point along(std::cos(middle.heading), std::sin(middle.heading));
    const double wall = halfWidth(o.at);
    const Point mouth = positionOf(middle) + wall * outward - 0.5 * o.width * along;
    const double perimeter = 2.0 * o.depth + o.width;
    const auto steps = std::max(6, static_cast<int>(std::ceil(perimeter / plan_.wall_spacing)));
    std::vector<double> way;
    for (const auto& [from, to] : {std::pair(0.0, o.depth), std::pair(o.depth, o.depth + o.width),
                                   std::pair(o.depth + o.width, perimeter)}) {
      const int part = std::max(1, static_cast<int>(std::lround(steps * (to - from) / perimeter)));
      for (int k = from == 0.0 ? 0 : 1; k <= part; ++k) way.push_back(from + (to - from) * k / part);
    }
    const std::vector<double> rough = roughnessAlong(way, perimeter, false, plan_.roughness, draws);
    for (std::size_t i = 0; i < way.size(); ++i) {
      const double u = way[i];
      const double corner =
          std::min({u, std::abs(u - o.depth), std::abs(u - o.depth - o.width), perimeter - u});
      const double offset = rough[i] * std::min(1.0, corner / kCornerSmoothing);
      Point p = mouth;
      if (u <= o.depth) {
        p += u * outward - offset * along;
      } else if (u <= o.depth + o.width) {
        p += (o.depth + offset) * outward + (u - o.depth) * along;
      } else {
        p += (perimeter - u) * outward + (o.width + offset) * along;
      }
      chain.add(p, o.at);
    }
  }

  // The inner wall of a bend runs backwards where the line's radius is less than the wall's offset.
  std::string foldOf() const {
    for (const PathPoint& p : line_.points()) {
      if (std::abs(p.curvature) * halfWidth(p.s) <= kFoldLimit) continue;
      std::ostringstream out;
      out << "folds its inner wall at s = " << p.s << " m: the radius of " << 1.0 / std::abs(p.curvature)
          << " m must exceed the half width of " << halfWidth(p.s) << " m";
      return out.str();
    }
    return "";
  }

  // Where walls that are far apart along the line come near to each other. Neighbours along the line are
  // left out: there the opposite wall and an opening's corners are near by right.
  std::string conflictOf(const TaggedChain& all) const {
    double widest = 0.0;
    for (const double s : s_) widest = std::max(widest, halfWidth(s));
    const double neighbourhood = M_PI * (widest + plan_.separation);
    const double apart = std::max(plan_.separation, plan_.wall_spacing);  // crossing walls are within it
    Net before(apart);
    for (std::size_t i = 0; i < all.points.size(); ++i) {
      std::size_t first = i;
      before.visitNear(all.points[i], [&](std::size_t k) {
        if ((all.points[i] - all.points[k]).squaredNorm() >= apart * apart) return;
        double gap = std::abs(all.s[i] - all.s[k]);
        if (plan_.closed) gap = std::min(gap, line_.length() - gap);
        if (gap > neighbourhood) first = std::min(first, k);
      });
      before.add(all.points[i], i);
      if (first == i) continue;
      std::ostringstream out;
      out << "brings the walls at s = " << all.s[first] << " m and s = " << all.s[i] << " m within "
          << apart << " m of each other";
      return out.str();
    }
    return "";
  }

  const TunnelPlan& plan_;
  Path line_;
  std::vector<double> s_;
};

}  // namespace

double widthAt(const TunnelPlan& plan, double s) {
  double width = plan.width;
  for (const Widening& w : plan.widenings) {
    if (s <= w.from || s >= w.to) continue;
    const double share = std::min({1.0, (s - w.from) / w.taper, (w.to - s) / w.taper});
    width += share * (w.width - plan.width);
  }
  return width;
}

TunnelWalls buildWalls(const TunnelPlan& plan) {
  double length = 0.0;
  for (const geometry::PathPiece& piece : plan.pieces) length += piece.length;
  if (length > kMaxWallPoints * plan.wall_spacing) {
    std::ostringstream out;
    out << "is " << length << " m long: more than " << kMaxWallPoints << " wall_spacings of "
        << plan.wall_spacing << " m";
    return {{}, out.str()};
  }
  return WallBuilder(plan).build();
}

}  // namespace tunnel_pilot::world
