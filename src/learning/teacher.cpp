#include "tunnel_pilot/learning/teacher.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tunnel_pilot/drivers/path_cursor.h"
#include "tunnel_pilot/drivers/path_model.h"

namespace tunnel_pilot::learning {
namespace {

constexpr int kMostSweeps = 40;
constexpr double kSettled = 1e-7;  // [1] of the cost that a sweep saves, then the plan is settled
constexpr double kLeastCorrection = 0.004;  // [1] a start is far from the optimum
constexpr double kMoveStep = 0.02;          // [s]

drivers::TruckResponse response(const drivers::PreviewDriverParameters& p,
                                const vehicle::TruckGeometry& geometry) {
  return {geometry, p.truck.steering.lag, p.truck.steering.max_rate,
          std::min(p.truck.steering.max_articulation, geometry.max_articulation),
          p.truck.slip_compliance};
}

}  // namespace

TeacherParameters loadTeacher(config::Node node) {
  TeacherParameters parameters;
  parameters.beyond = node.number("beyond", "m", 0.0, 0.5);
  parameters.weights = drivers::loadPreviewWeights(node.child("weights"));
  node.finish();
  return parameters;
}

Teacher::Teacher(const TeacherParameters& judgement, const drivers::PreviewDriverParameters& driver,
                 const vehicle::TruckGeometry& truck)
    : judgement_(judgement),
      parameters_(driver),
      response_(response(driver, truck)),
      planner_(response_, judgement.weights, driver.step) {
  planner_.setLeastCorrection(kLeastCorrection);
}

void Teacher::setMaxRate(double rate) {
  response_.max_rate = rate;
  planner_.setMaxRate(rate);
}

double Teacher::command(const geometry::Path& line, const TruckBesideLine& truck,
                        const drivers::YawResponse& believed) {
  const double demand = truck.articulation + parameters_.truck.steering.lag * truck.articulation_rate;
  const double far = std::clamp((std::abs(truck.offset) - kNear) / (kFar - kNear), 0.0, 1.0);
  const double offset = truck.offset + std::copysign(judgement_.beyond * far, truck.offset);
  const drivers::PathState start{truck.station, offset, truck.heading_error, truck.articulation,
                                 std::clamp(demand, -parameters_.truck.steering.max_articulation,
                                            parameters_.truck.steering.max_articulation)};
  const double speed = std::max(truck.speed, parameters_.planning_speed);
  // From one start alone, one plan in some thirty ends in a local optimum.
  planner_.reset();
  const double demand_standing = settled(start, line, speed, believed);
  const double cost_standing = planner_.cost();
  planner_.resetToUnwinding(start.command, speed);
  const double demand_unwinding = settled(start, line, speed, believed);
  return planner_.cost() < cost_standing ? demand_unwinding : demand_standing;
}

double Teacher::settled(const drivers::PathState& start, const geometry::Path& line, double speed,
                        const drivers::YawResponse& believed) {
  double before = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kMostSweeps; ++i) {
    planner_.plan(start, line, speed, believed, 0.0);
    if (!(planner_.cost() < before * (1.0 - kSettled))) break;
    before = planner_.cost();
  }
  return planner_.plannedAt(parameters_.truck.steering.lag).command;
}

TruckBesideLine Teacher::movedOn(const geometry::Path& line, const TruckBesideLine& truck,
                                 const drivers::YawResponse& believed, double time) const {
  return moved(line, truck, believed, time, std::nullopt);
}

TruckBesideLine Teacher::steered(const geometry::Path& line, const TruckBesideLine& truck,
                                 const drivers::YawResponse& believed, double command,
                                 double time) const {
  return moved(line, truck, believed, time, command);
}

TruckBesideLine Teacher::moved(const geometry::Path& line, const TruckBesideLine& truck,
                               const drivers::YawResponse& believed, double time,
                               const std::optional<double>& command) const {
  const auto& steering = parameters_.truck.steering;
  drivers::PathState state{truck.station, truck.offset, truck.heading_error, truck.articulation, 0.0};
  const int steps = std::max(1, static_cast<int>(std::ceil(time / kMoveStep)));
  const double step = time / steps;
  const double rate = std::clamp(truck.articulation_rate, -response_.max_rate, response_.max_rate);
  const double share = drivers::lagShare(step, response_.lag);
  drivers::PathCursor cursor(line, state.s);
  double heading = cursor.headingAt(state.s);
  TruckBesideLine result = truck;
  for (int i = 0; i < steps; ++i) {
    const double demand = command ? *command : state.articulation + steering.lag * rate;
    state.command = std::clamp(demand, -steering.max_articulation, steering.max_articulation);
    const double ahead = std::max(1e-3, truck.speed * step);
    const double curvature = (cursor.headingAt(state.s + ahead) - heading) / ahead;
    const double before = state.articulation;
    state = drivers::advancedOnPath(response_, state, std::cos(state.heading_error), 0.0, truck.speed,
                                    curvature, believed, step, share);
    result.articulation_rate = (state.articulation - before) / step;
    heading = cursor.headingAt(state.s);
  }
  result.station = state.s;
  result.offset = state.offset;
  result.heading_error = state.heading_error;
  result.articulation = state.articulation;
  return result;
}

}  // namespace tunnel_pilot::learning
