#include "tunnel_pilot/simulation/scenario.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "tunnel_pilot/simulation/metrics.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr double kPi = 3.141592653589793;
constexpr double kPathSpacing = 0.1;  // [m]

PlantChoice loadPlant(config::Node node) {
  PlantChoice plant;
  plant.model = node.choice("model", {"kinematic", "dynamic"}) == "dynamic" ? PlantModel::kDynamic
                                                                            : PlantModel::kKinematic;
  plant.load = node.choice("load", {"empty", "loaded"}) == "loaded" ? vehicle::Load::kLoaded
                                                                    : vehicle::Load::kEmpty;
  plant.rough_road = node.boolean("rough_road");
  plant.variation = node.number("variation", "1", 0.0, 0.5);
  node.finish();
  return plant;
}

// A file or folder named in a scenario stands relative to it.
std::string besideScenario(config::Node& node, const std::string& key, const std::filesystem::path& base,
                           bool folder = false) {
  const std::filesystem::path path = (base / node.text(key)).lexically_normal();
  std::error_code error;
  const bool there = folder ? std::filesystem::is_directory(path, error)
                            : std::filesystem::is_regular_file(path, error);
  if (!there)
    node.refuse(key, "names '" + path.string() + "', which is no " + (folder ? "folder" : "file"));
  return path.string();
}

DriveExperiment loadDrive(config::Node& node, const std::filesystem::path& base) {
  DriveExperiment drive;
  drive.world_file = besideScenario(node, "world", base);
  drive.both_directions = node.boolean("both_directions");
  drive.station = node.number("station", "m", 0.0, 1e5);
  drive.lateral_offset = node.number("lateral_offset", "m", -10.0, 10.0);
  drive.heading_error = node.number("heading_error", "rad", -1.0, 1.0);
  drive.rolling_speed = node.number("rolling_speed", "m/s", 0.0, 10.0);
  drive.top_speed = node.number("top_speed", "m/s", 0.1, 10.0);
  drive.distance = node.number("distance", "m", 0.0, 1e6);
  drive.time_limit = node.number("time_limit", "s", 1.0, 1e6);
  drive.return_metrics = node.boolean("return_metrics");
  return drive;
}

SteadyTurnExperiment loadSteadyTurn(config::Node& node) {
  SteadyTurnExperiment turn;
  turn.articulation = node.number("articulation", "rad", -0.79, 0.79);
  turn.speed = node.number("speed", "m/s", 0.1, 10.0);
  turn.duration = node.number("duration", "s", 1.0, 1e4);
  turn.settled = node.number("settled", "s", 0.0, turn.duration);
  turn.angle = node.number("angle", "rad", 0.1, 1000.0);
  return turn;
}

LaneChangeExperiment loadLaneChange(config::Node& node) {
  LaneChangeExperiment change;
  change.speed = node.number("speed", "m/s", 0.1, 10.0);
  change.offset = node.number("offset", "m", -20.0, 20.0);
  change.change_length = node.number("change_length", "m", 5.0, 200.0);
  change.straights = node.numbers("straights", "m", 1.0, 1000.0, 2, 3);
  change.offset_sigma = node.number("offset_sigma", "m", 0.0, 1.0);
  change.heading_sigma = node.number("heading_sigma", "rad", 0.0, 0.1);
  return change;
}

PerceptionExperiment loadPerception(config::Node& node, const std::filesystem::path& base) {
  PerceptionExperiment perception;
  perception.world_file = besideScenario(node, "world", base);
  perception.both_directions = node.boolean("both_directions");
  perception.speed = node.number("speed", "m/s", 0.1, 10.0);
  perception.weave_offset = node.number("weave_offset", "m", 0.0, 2.0);
  perception.weave_length = node.number("weave_length", "m", 5.0, 1000.0);
  perception.distance = node.number("distance", "m", 0.0, 1e6);
  return perception;
}

Experiment loadExperiment(config::Node node, const std::filesystem::path& base) {
  const std::string kind = node.choice("kind", {"drive", "steady_turn", "lane_change", "perception"});
  Experiment experiment;
  if (kind == "drive") experiment = loadDrive(node, base);
  if (kind == "steady_turn") experiment = loadSteadyTurn(node);
  if (kind == "lane_change") experiment = loadLaneChange(node);
  if (kind == "perception") experiment = loadPerception(node, base);
  node.finish();
  return experiment;
}

Goal loadGoal(config::Node node) {
  Goal goal;
  goal.metric = node.text("metric");
  if (!isMetric(goal.metric)) node.refuse("metric", "= '" + goal.metric + "' is no metric");
  goal.paper = node.text("paper");
  const std::string judge = node.choice("judge", {"every_seed", "median", "report_only"});
  goal.judge = judge == "median"       ? Judge::kMedian
               : judge == "every_seed" ? Judge::kEverySeed
                                       : Judge::kReportOnly;
  if (node.has("min")) goal.min = node.number("min", "SI", -1e6, 1e6);
  if (node.has("max")) goal.max = node.number("max", "SI", goal.min.value_or(-1e6), 1e6);
  const bool bounded = goal.min || goal.max;
  if (bounded && goal.judge == Judge::kReportOnly) node.refuse("judge", "report_only has no min or max");
  if (!bounded && goal.judge != Judge::kReportOnly) node.refuse("judge", "needs a min or a max");
  node.finish();
  return goal;
}

// Appends a straight or a half-cosine to a path's samples, sampling along x.
void appendPiece(std::vector<geometry::PathPoint>& points, double length, double offset) {
  const geometry::PathPoint start = points.back();
  const int steps = std::max(1, static_cast<int>(std::ceil(length / kPathSpacing)));
  const double w = kPi / length;
  for (int i = 1; i <= steps; ++i) {
    const double x = length * i / steps;
    const double middle = length * (i - 0.5) / steps;
    const double slope = 0.5 * offset * w * std::sin(w * x);
    const double middle_slope = 0.5 * offset * w * std::sin(w * middle);
    const double bend = 0.5 * offset * w * w * std::cos(w * x);
    geometry::PathPoint p;
    // Midpoint rule for the arc length: its error over a change is below 0.1 mm.
    p.s = points.back().s + std::hypot(1.0, middle_slope) * length / steps;
    p.x = start.x + x;
    p.y = start.y + 0.5 * offset * (1.0 - std::cos(w * x));
    p.heading = std::atan(slope);
    p.curvature = bend / std::pow(1.0 + slope * slope, 1.5);
    points.push_back(p);
  }
}

}  // namespace

bool Goal::holds(double value) const {
  if (std::isnan(value)) return false;
  return (!min || value >= *min) && (!max || value <= *max);
}

double Goal::badness(double value) const {
  if (std::isnan(value)) return std::numeric_limits<double>::infinity();
  double badness = -std::numeric_limits<double>::infinity();
  if (max) badness = value - *max;
  if (min) badness = std::max(badness, *min - value);
  return min || max ? badness : std::abs(value);
}

Scenario loadScenario(const std::string& file) {
  config::Node node = config::loadFile(file);
  const std::filesystem::path base = std::filesystem::path(file).parent_path();
  Scenario scenario;
  scenario.file = file;
  scenario.name = node.text("name");
  const std::string stem = std::filesystem::path(file).stem().string();
  if (scenario.name != stem) node.refuse("name", "must be that of the file, '" + stem + "'");
  scenario.title = node.text("title");
  scenario.config_folder = besideScenario(node, "config", base, true);
  if (node.has("preview_law")) scenario.preview_law = drivers::readPreviewLaw(node, "preview_law");
  if (node.has("profile")) scenario.profile = can::readProfileKind(node, "profile");
  scenario.first_seed = static_cast<std::uint64_t>(node.integer("first_seed", "1", 0, 1'000'000'000));
  scenario.seeds = static_cast<int>(node.integer("seeds", "1", 1, 100'000));
  scenario.plant = loadPlant(node.child("plant"));
  scenario.experiment = loadExperiment(node.child("experiment"), base);
  for (config::Node& goal : node.children("goals")) scenario.goals.push_back(loadGoal(std::move(goal)));
  if (scenario.goals.empty()) node.refuse("goals", "must hold at least one goal");
  node.finish();
  return scenario;
}

geometry::Path laneChangePath(const LaneChangeExperiment& experiment) {
  std::vector<geometry::PathPoint> points(1);
  double offset = experiment.offset;
  for (std::size_t i = 0; i < experiment.straights.size(); ++i) {
    if (i > 0) {
      appendPiece(points, experiment.change_length, offset);
      offset = -offset;
    }
    appendPiece(points, experiment.straights[i], 0.0);
  }
  return geometry::Path(std::move(points));
}

}  // namespace tunnel_pilot::simulation
