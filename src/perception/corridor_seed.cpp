#include "corridor_seed.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::perception {
namespace {

constexpr float kSpacingInSeed = 0.3F;  // [m] groups nearer than this vote once
constexpr int kHeadings = 13;
constexpr int kCurvatures = 7;
constexpr float kInsidePenalty = 0.5F;  // of a vote, for each return between the walls
constexpr float kFewestVotes = 4.0F;    // for a heap to be a wall
constexpr int kApart = 4;               // bins between heaps that are different walls

float gridValue(int i, int count, double largest) {
  return static_cast<float>(largest) *
         (2.0F * static_cast<float>(i) / static_cast<float>(count - 1) - 1.0F);
}

}  // namespace

CorridorSeeder::CorridorSeeder(const WallSegmentationParameters& parameters)
    : parameters_(parameters), bin_(static_cast<float>(parameters.width_max / kBins)) {}

void CorridorSeeder::gather(float x, float y) {
  if (!x_.empty()) {
    const float dx = x - x_.back();
    const float dy = y - y_.back();
    if (dx * dx + dy * dy < kSpacingInSeed * kSpacingInSeed) return;
  }
  x_.push_back(x);
  y_.push_back(y);
}

void CorridorSeeder::gatherWithin(const std::vector<PointGroup>& groups, double radius) {
  x_.clear();
  y_.clear();
  const auto limit = static_cast<float>(radius * radius);
  for (const PointGroup& g : groups) {
    if (g.x * g.x + g.y * g.y < limit) gather(g.x, g.y);
  }
}

// In the frame, those within `length` ahead of it.
void CorridorSeeder::gatherAlong(const std::vector<PointGroup>& groups, const SliceFrame& frame,
                                 double length) {
  x_.clear();
  y_.clear();
  for (const PointGroup& g : groups) {
    const float dx = g.x - frame.x;
    const float dy = g.y - frame.y;
    const float along = frame.cosine * dx + frame.sine * dy;
    if (along < 0.0F || along > static_cast<float>(length)) continue;
    gather(along, frame.cosine * dy - frame.sine * dx);
  }
}

void CorridorSeeder::vote(float heading, float curvature) {
  std::fill(std::begin(left_), std::end(left_), 0.0F);
  std::fill(std::begin(right_), std::end(right_), 0.0F);
  const float c = std::cos(heading);
  const float s = std::sin(heading);
  const float per_bin = 1.0F / bin_;
  for (std::size_t i = 0; i < x_.size(); ++i) {
    const float u = c * x_[i] + s * y_[i];
    const float v = c * y_[i] - s * x_[i];
    const float f = v - 0.5F * curvature * (u * u + v * v);
    const float d = 2.0F * f / (1.0F + std::sqrt(std::max(0.0F, 1.0F - 2.0F * curvature * f)));
    const float bin = std::abs(d) * per_bin;
    if (!(bin < static_cast<float>(kBins))) continue;  // too far away, or not a number any more
    (d > 0.0F ? left_ : right_)[static_cast<int>(bin) + 1] += 1.0F;
  }
}

CorridorSeeder::Heap CorridorSeeder::highestHeap(const float* votes, int apart_from) const {
  Heap best;
  float inside = 0.0F;
  for (int b = 1; b <= kBins; ++b) {
    const float heap = 0.5F * votes[b - 1] + votes[b] + 0.5F * votes[b + 1] - kInsidePenalty * inside;
    if (heap > best.votes && std::abs(b - apart_from) >= kApart) best = {b, heap};
    inside += votes[b - 1];
  }
  return best;
}

double CorridorSeeder::offsetOf(const Heap& heap, double side) const {
  const float* votes = side > 0.0 ? left_ : right_;
  const float around[3] = {0.5F * votes[heap.bin - 1], votes[heap.bin], 0.5F * votes[heap.bin + 1]};
  const float shift = (around[2] - around[0]) / (around[0] + around[1] + around[2]);
  return side * static_cast<double>(bin_ * (static_cast<float>(heap.bin) - 0.5F + shift));
}

CorridorSeed CorridorSeeder::judge(float heading, float curvature, float& votes) {
  vote(heading, curvature);
  const Heap left = highestHeap(left_);
  const Heap right = highestHeap(right_);
  // A straight guess wins a tie.
  votes = left.votes + right.votes - 2.0F * std::abs(heading) - 10.0F * std::abs(curvature);
  CorridorSeed seed{heading, curvature, std::nullopt, std::nullopt};
  if (left.votes >= kFewestVotes) seed.left = offsetOf(left, 1.0);
  if (right.votes >= kFewestVotes) seed.right = offsetOf(right, -1.0);
  return seed;
}

// The arc that the gathered groups vote for.
std::optional<CorridorSeed> CorridorSeeder::bestArc() {
  float best_votes = kFewestVotes;
  std::optional<CorridorSeed> best;
  for (int i = 0; i < kHeadings; ++i) {
    const float heading = gridValue(i, kHeadings, parameters_.seed_heading_max);
    for (int j = 0; j < kCurvatures; ++j) {
      float votes = 0.0F;
      const CorridorSeed seed =
          judge(heading, gridValue(j, kCurvatures, parameters_.seed_curvature_max), votes);
      if (votes <= best_votes || (!seed.left && !seed.right)) continue;
      best_votes = votes;
      best = seed;
    }
  }
  return best;
}

const std::vector<CorridorSeed>& CorridorSeeder::find(const std::vector<PointGroup>& groups) {
  seeds_.clear();
  for (const double radius : {parameters_.seed_radius, 2.0 * parameters_.seed_radius}) {
    gatherWithin(groups, radius);
    const std::optional<CorridorSeed> arc = bestArc();
    if (!arc) continue;
    add(*arc);
    const SliceFrame origin = {0.0F, 0.0F, static_cast<float>(std::cos(arc->heading)),
                               static_cast<float>(std::sin(arc->heading))};
    for (const double length : {parameters_.seed_radius, parameters_.lookahead}) {
      gatherAlong(groups, origin, length);
      findWalls(*arc);
    }
  }
  return seeds_;
}

// Pairs of the two highest heaps on either side of the arc, from the groups gathered along it.
void CorridorSeeder::findWalls(const CorridorSeed& arc) {
  vote(0.0F, static_cast<float>(arc.curvature));
  const Heap left = highestHeap(left_);
  const Heap right = highestHeap(right_);
  for (const Heap& l : {left, highestHeap(left_, left.bin)}) {
    for (const Heap& r : {right, highestHeap(right_, right.bin)}) {
      if (l.votes < kFewestVotes || r.votes < kFewestVotes) continue;
      add({arc.heading, arc.curvature, offsetOf(l, 1.0), offsetOf(r, -1.0)});
    }
  }
}

// Unless nearly the same is there already.
void CorridorSeeder::add(const CorridorSeed& seed) {
  const auto near = [this](const std::optional<double>& a, const std::optional<double>& b) {
    return a.has_value() == b.has_value() && (!a || std::abs(*a - *b) < static_cast<double>(bin_));
  };
  for (const CorridorSeed& other : seeds_) {
    if (other.heading == seed.heading && other.curvature == seed.curvature &&
        near(other.left, seed.left) && near(other.right, seed.right)) {
      return;
    }
  }
  seeds_.push_back(seed);
}

CorridorSeed CorridorSeeder::findAlong(const std::vector<PointGroup>& groups, const SliceFrame& frame,
                                       double curvature, double length) {
  gatherAlong(groups, frame, length);
  float votes = 0.0F;
  return judge(0.0F, static_cast<float>(curvature), votes);
}

}  // namespace tunnel_pilot::perception
