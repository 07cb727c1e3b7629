#include "tunnel_pilot/simulation/fastest_return.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>

#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/vehicle/truck_variation.h"

namespace tunnel_pilot::simulation {
namespace {

using Arcs = std::vector<double>;

constexpr double kBefore = 1.0;        // the start pose: until tyres and drive train roll [s]
constexpr double kHorizon = 10.0;      // of a return [s]
constexpr double kReturned = 0.1;      // the paper's "returned" [m]
constexpr double kTruthPeriod = 0.02;  // [s]
constexpr double kPenalty = 30.0;      // on what lies outside of the bounds [s/m]
// Of the truck as it is believed, heading away; others need up to a fifth more [s].
constexpr std::array<double, 4> kUsual = {2.3, 3.5, 1.5, 0.9};
constexpr int kMoves = 60;  // of one simplex
// What holds the middle afterwards: at 2 m/s a double pole at 0.8 rad/s.
constexpr double kOffsetGain = 0.8;     // [rad/m]
constexpr double kHeadingGain = 4.0;    // [1]
constexpr double kHoldingGain = 2.0;    // of the speed [1/s] ...
constexpr double kHoldingSlowly = 0.5;  // ... against rolling resistance [1/s^2]

// Drives the plant along a straight, the x axis. Offsets and headings count as positive where it starts.
class Returning {
 public:
  Returning(const DriveExperiment& drive, const PlantChoice& choice, const Setup& setup,
            std::uint64_t seed, double most_overshoot)
      : drive_(drive),
        plant_(makePlant(choice, setup.truck, seed)),
        step_(setup.simulator.step),
        side_(drive.lateral_offset < 0.0 ? -1.0 : 1.0),
        most_overshoot_(most_overshoot) {
    const double own =
        vehicle::varied(setup.truck, streamSeed(seed, Stream::kPlantVariation), choice.variation)
            .steering.max_rate;
    rate_ = std::min(own, setup.pilot.bridge.steering_rate);
    most_ = setup.pilot.arbiter.limiter.max_articulation;
  }

  // Time to return, in which each metre outside of the bounds counts for kPenalty seconds: what to
  // minimise. The track is written where one is given.
  double drive(const Arcs& arcs, std::vector<TrackSample>* track = nullptr) {
    start();
    double returned = kHorizon;
    double overshoot = 0.0, back_out = 0.0, nearest = 1e9;
    double before = std::abs(drive_.lateral_offset);
    const std::int64_t steps = std::llround(kHorizon / step_);
    const std::int64_t record_every = std::llround(kTruthPeriod / step_);
    for (std::int64_t i = 0; i < steps; ++i) {
      const double time = static_cast<double>(i) * step_;
      if (track != nullptr && i % record_every == 0) track->push_back(sample(time));
      demand_ = std::clamp(demand_ + step_ * rateAt(time, arcs), -most_, most_);
      advance();
      const double offset = side_ * plant_->state().pose.y;
      if (offset < kReturned && before >= kReturned && returned == kHorizon) {
        returned = time + step_ * (before - kReturned) / (before - offset);
      }
      if (returned < kHorizon) back_out = std::max(back_out, offset - kReturned);
      overshoot = std::max(overshoot, -offset - most_overshoot_);
      nearest = std::min(nearest, offset);
      before = offset;
    }
    if (returned == kHorizon) returned += kPenalty * std::max(0.0, nearest - kReturned);
    return returned + kPenalty * (std::max(0.0, overshoot) + std::max(0.0, back_out));
  }

 private:
  void start() {
    const geometry::Pose pose{0.0, drive_.lateral_offset, drive_.heading_error};
    plant_->reset(pose.compose({-kBefore * drive_.rolling_speed, 0.0, 0.0}), 0.0, drive_.rolling_speed);
    demand_ = missed_ = 0.0;
    for (double time = 0.0; time < kBefore; time += step_) advance();
  }

  void advance() {
    const double error = drive_.top_speed - plant_->state().speed;
    missed_ += error * step_;
    plant_->step({demand_, kHoldingGain * error + kHoldingSlowly * missed_}, {}, step_);
  }

  // The demand's rate: back to the middle first, then by turns, then what holds it [rad/s].
  double rateAt(double time, const Arcs& arcs) const {
    double turn = -side_;
    for (const double arc : arcs) {
      if (time < std::max(0.0, arc)) return turn * rate_;
      time -= std::max(0.0, arc);
      turn = -turn;
    }
    const geometry::Pose& pose = plant_->state().pose;
    const double wanted = -kOffsetGain * pose.y - kHeadingGain * pose.heading;
    return std::clamp((wanted - demand_) / step_, -rate_, rate_);
  }

  TrackSample sample(double time) const {
    TrackSample now;
    now.time = time;
    now.lateral_offset = plant_->state().pose.y;
    now.heading_error = plant_->state().pose.heading;
    now.articulation = plant_->state().articulation;
    now.articulation_command = demand_;
    now.speed = plant_->state().speed;
    return now;
  }

  DriveExperiment drive_;
  std::unique_ptr<vehicle::Plant> plant_;
  double step_;  // [s]
  double side_;
  double most_overshoot_;  // [m]
  double rate_;            // of the demand [rad/s]
  double most_;            // [rad]
  double demand_ = 0.0;    // [rad]
  double missed_ = 0.0;    // way that the speed fell short of [m]
};

struct Corner {
  Arcs arcs;
  double cost = 0.0;
};

// Nelder & Mead (1965).
class Simplex {
 public:
  Simplex(Returning& returning, const Arcs& start, double size) : returning_(returning) {
    add(start);
    for (std::size_t i = 0; i < start.size(); ++i) {
      Arcs moved = start;
      moved[i] += size;
      add(moved);
    }
  }

  const Corner& shrunk(int moves) {
    for (int i = 0; i < moves; ++i) move();
    sort();
    return corners_.front();
  }

 private:
  void add(const Arcs& arcs) { corners_.push_back({arcs, returning_.drive(arcs)}); }
  void sort() {
    std::stable_sort(corners_.begin(), corners_.end(),
                     [](const Corner& a, const Corner& b) { return a.cost < b.cost; });
  }

  // From the others' middle, `stretch` times as far as the worst.
  Corner beyond(double stretch) const {
    const Corner& worst = corners_.back();
    Arcs arcs(worst.arcs.size(), 0.0);
    for (std::size_t i = 0; i < arcs.size(); ++i) {
      for (std::size_t c = 0; c + 1 < corners_.size(); ++c) arcs[i] += corners_[c].arcs[i];
      arcs[i] /= static_cast<double>(corners_.size() - 1);
      arcs[i] += stretch * (worst.arcs[i] - arcs[i]);
    }
    return {arcs, returning_.drive(arcs)};
  }

  void move() {
    sort();
    Corner& worst = corners_.back();
    const Corner reflected = beyond(-1.0);
    if (reflected.cost < corners_.front().cost) {
      const Corner further = beyond(-2.0);
      worst = further.cost < reflected.cost ? further : reflected;
      return;
    }
    if (reflected.cost < corners_[corners_.size() - 2].cost) {
      worst = reflected;
      return;
    }
    const Corner nearer = beyond(reflected.cost < worst.cost ? -0.5 : 0.5);
    if (nearer.cost < std::min(reflected.cost, worst.cost)) {
      worst = nearer;
      return;
    }
    for (std::size_t c = 1; c < corners_.size(); ++c) {
      for (std::size_t i = 0; i < corners_[c].arcs.size(); ++i) {
        corners_[c].arcs[i] = 0.5 * (corners_[c].arcs[i] + corners_.front().arcs[i]);
      }
      corners_[c].cost = returning_.drive(corners_[c].arcs);
    }
  }

  Returning& returning_;
  std::vector<Corner> corners_;
};

// Begun anew, a simplex leaves where the last one stuck.
Corner searched(Returning& returning, const Arcs& start) {
  Corner best{start, std::numeric_limits<double>::infinity()};
  for (const double size : {0.3, -0.2, 0.1, -0.05}) {
    const Corner found = Simplex(returning, best.arcs, size).shrunk(kMoves);
    if (found.cost < best.cost) best = found;
  }
  return best;
}

}  // namespace

FastestReturn fastestReturn(const DriveExperiment& drive, const PlantChoice& plant, const Setup& setup,
                            std::uint64_t seed, double most_overshoot) {
  Returning returning(drive, plant, setup, seed, most_overshoot);
  Corner best{{}, std::numeric_limits<double>::infinity()};
  for (const double share : {1.0, 1.05, 1.1, 1.15, 1.2}) {
    Arcs start(kUsual.begin(), kUsual.end());
    for (double& arc : start) arc *= share;
    const Corner found = searched(returning, start);
    if (found.cost < best.cost) best = found;
  }
  std::vector<TrackSample> track;
  returning.drive(best.arcs, &track);
  const Metrics metrics = returnMetrics(track);
  return {metrics.at("settle_time"), metrics.at("heading_zero_time"), metrics.at("overshoot"),
          best.arcs};
}

}  // namespace tunnel_pilot::simulation
