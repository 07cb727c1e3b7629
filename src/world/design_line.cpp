#include "design_line.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

namespace tunnel_pilot::world {
namespace {

using config::Node;
using geometry::PathPiece;

constexpr double kMaxLength = 2000.0;   // of one piece [m]
constexpr double kMaxLineLength = 1e5;  // [m]
constexpr std::size_t kMaxPieces = 1000;
constexpr double kMinRadius = 3.0;          // [m]
constexpr double kMaxRadius = 10000.0;      // [m]
constexpr double kMaxAngle = 2.0 * M_PI;    // of one arc [rad]
constexpr double kClosureTolerance = 0.01;  // [m]
constexpr double kHeadingTolerance = 1e-3;  // [rad]
constexpr double kMinSolvedLength = 0.5;    // [m]
constexpr double kProvisionalLength = 1.0;  // of a straight still to be solved [m]
constexpr double kSpacingOfClosure = 1.0;   // the quadrature is exact enough at any spacing [m]
const char* const kKey = "design_line";

enum class Kind { kStraight, kArc, kClothoid };

struct Piece {
  Kind kind;
  double length = 0.0;     // [m]
  double curvature = 0.0;  // of an arc [1/m]
  bool free = false;       // its length is solved for
};

std::string format(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

// An arc of a bend, without the angle that its two clothoids of `transition` turn by.
Piece readArc(Node& node, double transition, bool closed) {
  const double radius = node.number("radius", "m", kMinRadius, kMaxRadius);
  const bool left = node.choice("turn", {"left", "right"}) == "left";
  Piece arc{Kind::kArc, 0.0, (left ? 1.0 : -1.0) / radius, closed && !node.has("angle")};
  if (arc.free) return arc;
  arc.length = radius * node.number("angle", "rad", 0.001, kMaxAngle) - transition;
  if (arc.length <= 0.0) {
    node.refuse("angle", "[rad] must exceed transition/radius = " + format(transition / radius) +
                             ", what the two clothoids turn by");
  }
  return arc;
}

void readPiece(Node node, bool closed, std::vector<Piece>& pieces) {
  if (node.has("straight")) {
    Node straight = node.child("straight");
    Piece piece{Kind::kStraight, 0.0, 0.0, closed && !straight.has("length")};
    if (!piece.free) piece.length = straight.number("length", "m", 0.01, kMaxLength);
    straight.finish();
    pieces.push_back(piece);
  } else if (node.has("arc")) {
    Node arc = node.child("arc");
    pieces.push_back(readArc(arc, 0.0, closed));
    arc.finish();
  } else if (node.has("clothoid")) {
    Node clothoid = node.child("clothoid");
    pieces.push_back({Kind::kClothoid, clothoid.number("length", "m", 0.01, kMaxLength)});
    clothoid.finish();
  } else if (node.has("bend")) {
    Node bend = node.child("bend");
    const double transition = bend.number("transition", "m", 0.01, kMaxLength);
    const Piece arc = readArc(bend, transition, closed);
    bend.finish();
    // A bend joins straights, so a straight of no length stands for its neighbours' curvature.
    const Piece joint{Kind::kStraight};
    const Piece clothoid{Kind::kClothoid, transition};
    pieces.insert(pieces.end(), {joint, clothoid, arc, clothoid, joint});
  } else {
    node.refuse("straight", "is missing: a piece is one of straight, arc, clothoid, bend");
  }
  node.finish();
}

// Curvature of the neighbour that the clothoid `i` joins; `step` is -1 or +1.
double neighbourCurvature(const Node& world, const std::vector<Piece>& pieces, std::size_t i, int step,
                          bool closed) {
  const std::size_t n = pieces.size();
  const bool at_end = step < 0 ? i == 0 : i + 1 == n;
  if (at_end && !closed) {
    world.refuse(kKey, "must not begin or end with a clothoid: it joins the pieces beside it");
  }
  const Piece& neighbour = pieces[(i + n + static_cast<std::size_t>(step + static_cast<int>(n))) % n];
  if (neighbour.kind == Kind::kClothoid) {
    world.refuse(kKey, "must not hold two clothoids side by side: put a straight or an arc between");
  }
  return neighbour.curvature;
}

// One path piece for each piece; those without length (yet) too.
std::vector<PathPiece> joined(const Node& world, const std::vector<Piece>& pieces, bool closed) {
  std::vector<PathPiece> path;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const Piece& piece = pieces[i];
    double from = piece.curvature;
    double to = piece.curvature;
    if (piece.kind == Kind::kClothoid) {
      from = neighbourCurvature(world, pieces, i, -1, closed);
      to = neighbourCurvature(world, pieces, i, +1, closed);
    }
    path.push_back({piece.length, from, to});
  }
  return path;
}

std::vector<PathPiece> withLength(std::vector<PathPiece> path) {
  const auto empty = [](const PathPiece& piece) { return piece.length <= 0.0; };
  path.erase(std::remove_if(path.begin(), path.end(), empty), path.end());
  return path;
}

// Angle that the first `count` pieces turn by [rad].
double turnOf(const std::vector<PathPiece>& path, std::size_t count) {
  double turn = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    turn += 0.5 * path[i].length * (path[i].curvature_start + path[i].curvature_end);
  }
  return turn;
}

// Gives the arc without an angle the one that makes a full turn.
void closeHeading(const Node& world, std::vector<Piece>& pieces) {
  Piece* free_arc = nullptr;
  for (Piece& piece : pieces) {
    if (!piece.free || piece.kind != Kind::kArc) continue;
    if (free_arc) world.refuse(kKey, "may leave out the angle of one arc or bend only");
    free_arc = &piece;
  }
  const double turn = turnOf(joined(world, pieces, true), pieces.size());
  if (!free_arc) {
    if (std::abs(std::abs(turn) - 2.0 * M_PI) <= kHeadingTolerance) return;
    world.refuse(kKey, "turns by " + format(turn) +
                           " rad in all, a closed line by 6.28319 rad; leave out " +
                           "the angle of one arc or bend to have it solved");
  }
  const double side = free_arc->curvature > 0.0 ? 1.0 : -1.0;
  double angle = side * (2.0 * M_PI - turn);
  const double other_way = side * (-2.0 * M_PI - turn);
  if (angle <= 0.0 || (other_way > 0.0 && other_way < angle)) angle = other_way;
  if (angle <= 0.0 || angle > kMaxAngle) {
    world.refuse(kKey, "cannot be closed by its arc without an angle, which would turn by " +
                           format(angle) + " rad");
  }
  free_arc->length = angle / std::abs(free_arc->curvature);
}

// The end of a line moves linearly with its straights' lengths: two of them close it.
void closePosition(const Node& world, std::vector<Piece>& pieces) {
  std::vector<Piece*> free;
  for (Piece& piece : pieces) {
    if (piece.free && piece.kind == Kind::kStraight) free.push_back(&piece);
  }
  if (free.empty()) return;
  if (free.size() != 2) {
    world.refuse(kKey, "has " + std::to_string(free.size()) +
                           " straights without a length; two are needed to close it, or none");
  }
  for (Piece* piece : free) piece->length = kProvisionalLength;
  const std::vector<PathPiece> path = joined(world, pieces, true);
  std::vector<geometry::Point> directions;
  for (const Piece* piece : free) {
    const double heading = turnOf(path, static_cast<std::size_t>(piece - pieces.data()));
    directions.emplace_back(std::cos(heading), std::sin(heading));
  }
  const geometry::Path line = geometry::buildPath(withLength(path), {}, kSpacingOfClosure);
  const geometry::Point gap(line.points().back().x, line.points().back().y);
  const double cross = directions[0].x() * directions[1].y() - directions[0].y() * directions[1].x();
  if (std::abs(cross) < 0.1) world.refuse(kKey, "has two parallel straights without a length");
  const double first = (gap.y() * directions[1].x() - gap.x() * directions[1].y()) / cross;
  const double second = (gap.x() * directions[0].y() - gap.y() * directions[0].x()) / cross;
  for (const auto& [piece, change] : {std::pair(free[0], first), std::pair(free[1], second)}) {
    piece->length += change;
    if (piece->length >= kMinSolvedLength) continue;
    world.refuse(kKey, "closes only with a straight of " + format(piece->length) + " m, less than " +
                           format(kMinSolvedLength) + " m");
  }
}

void checkClosure(const Node& world, const std::vector<PathPiece>& path) {
  const double gap = geometry::closureGap(geometry::buildPath(path, {}, kSpacingOfClosure));
  if (gap <= kClosureTolerance) return;
  world.refuse(kKey, "ends " + format(gap) +
                         " m from its start, a closed line within 0.01 m; leave out " +
                         "the length of two straights to have them solved");
}

}  // namespace

std::vector<PathPiece> readDesignLine(Node& world, bool closed) {
  std::vector<Piece> pieces;
  const std::vector<Node> nodes = world.children(kKey);
  if (nodes.size() > kMaxPieces) {
    world.refuse(kKey, "must hold at most " + std::to_string(kMaxPieces) + " pieces");
  }
  for (const Node& node : nodes) readPiece(node, closed, pieces);
  if (pieces.empty()) world.refuse(kKey, "must hold at least one piece");
  double length = 0.0;
  for (const Piece& piece : pieces) length += piece.length;
  if (length > kMaxLineLength) {
    world.refuse(kKey,
                 "is " + format(length) + " m long, must be at most " + format(kMaxLineLength) + " m");
  }
  if (closed) {
    closeHeading(world, pieces);
    closePosition(world, pieces);
  }
  std::vector<PathPiece> path = withLength(joined(world, pieces, closed));
  if (closed) checkClosure(world, path);
  return path;
}

}  // namespace tunnel_pilot::world
