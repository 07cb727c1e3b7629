#include "tunnel_pilot/simulation/report.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "episode_plots.h"
#include "html_report.h"
#include "report_text.h"

namespace tunnel_pilot::simulation {
namespace {

using nlohmann::ordered_json;

GoalResult judgeGoal(const Goal& goal, const std::vector<EpisodeResult>& episodes) {
  GoalResult result;
  result.goal = goal;
  result.holds = true;
  std::vector<double> values;
  double worst_badness = -std::numeric_limits<double>::infinity();
  for (const EpisodeResult& episode : episodes) {
    const double value = metricOf(episode, goal.metric);
    values.push_back(std::isnan(value) ? std::numeric_limits<double>::infinity() : value);
    if (!goal.holds(value) && goal.judge == Judge::kEverySeed) result.holds = false;
    const double badness = goal.badness(value);
    if (result.worst_episode.empty() || badness > worst_badness) {
      worst_badness = badness;
      result.worst = value;
      result.worst_episode = episode.label();
    }
  }
  result.median = quantile(values, 0.5);
  if (goal.judge == Judge::kMedian) result.holds = goal.holds(result.median);
  return result;
}

std::ofstream openFile(const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  if (!out) throw std::runtime_error("cannot write '" + file.string() + "'");
  return out;
}

std::string csvNumber(double value) {
  if (!std::isfinite(value)) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

void writeRow(std::ostream& out, const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) out << (i == 0 ? "" : ",") << csvNumber(values[i]);
  out << "\n";
}

std::string fileLabel(const EpisodeResult& episode) {
  return "seed_" + std::to_string(episode.seed) + (episode.reversed ? "_reversed" : "");
}

void writeTrack(const std::filesystem::path& folder, const EpisodeResult& episode) {
  std::ofstream out = openFile(folder / (fileLabel(episode) + ".csv"));
  out << "time,x,y,heading,articulation,articulation_command,speed,yaw_rate,lateral_acceleration,"
         "station,lateral_offset,heading_error,curvature,clearance\n";
  for (const TrackSample& s : episode.track) {
    writeRow(out, {s.time, s.front.x, s.front.y, s.front.heading, s.articulation, s.articulation_command,
                   s.speed, s.yaw_rate, s.lateral_acceleration, s.station, s.lateral_offset,
                   s.heading_error, s.curvature, s.clearance});
  }
}

void writePerception(const std::filesystem::path& folder, const EpisodeResult& episode) {
  if (episode.perception.empty()) return;
  std::ofstream out = openFile(folder / (fileLabel(episode) + "_perception.csv"));
  out << "stamp,station,curvature,valid,lateral_offset_error,heading_error_error,width_error,"
         "curvature_error\n";
  for (const PerceptionSample& s : episode.perception) {
    writeRow(out, {toSeconds(s.stamp), s.station, s.curvature, s.valid ? 1.0 : 0.0, s.offset_error,
                   s.heading_error, s.width_error, s.curvature_error});
  }
}

void writeEpisodes(const std::filesystem::path& folder, const std::vector<EpisodeResult>& episodes) {
  std::ofstream out = openFile(folder / "episodes.csv");
  const std::set<std::string> keys = metricKeys(episodes);
  out << "seed,reversed,ending";
  for (const std::string& key : keys) out << "," << key;
  out << "\n";
  for (const EpisodeResult& episode : episodes) {
    out << episode.seed << "," << (episode.reversed ? 1 : 0) << "," << episode.ending;
    for (const std::string& key : keys) out << "," << csvNumber(metricOf(episode, key));
    out << "\n";
  }
}

ordered_json goalJson(const GoalResult& result) {
  ordered_json json;
  json["metric"] = result.goal.metric;
  json["paper"] = result.goal.paper;
  json["judge"] = result.goal.judge == Judge::kMedian      ? "median"
                  : result.goal.judge == Judge::kEverySeed ? "every_seed"
                                                           : "report_only";
  json["min"] = result.goal.min ? ordered_json(*result.goal.min) : ordered_json();
  json["max"] = result.goal.max ? ordered_json(*result.goal.max) : ordered_json();
  json["median"] = result.median;
  json["worst"] = result.worst;
  json["worst_episode"] = result.worst_episode;
  json["holds"] = result.holds;
  return json;
}

void writeSummary(const std::filesystem::path& folder, const Scenario& scenario,
                  const Evaluation& evaluation, const std::vector<EpisodeResult>& episodes,
                  const Fingerprints& fingerprints) {
  ordered_json json;
  json["scenario"] = scenario.name;
  json["title"] = scenario.title;
  json["passed"] = evaluation.passed;
  json["driver"] = fingerprints.driver;
  json["sha256"] = {{"scenario", fingerprints.scenario},
                    {"controller", fingerprints.controller},
                    {"plant", fingerprints.plant},
                    {"world", fingerprints.world},
                    {"network", fingerprints.network}};
  json["units"] = "SI, radians";
  json["goals"] = ordered_json::array();
  for (const GoalResult& goal : evaluation.goals) json["goals"].push_back(goalJson(goal));
  json["episodes"] = ordered_json::array();
  for (const EpisodeResult& episode : episodes) {
    ordered_json one{{"seed", episode.seed}, {"reversed", episode.reversed}, {"ending", episode.ending}};
    one["metrics"] = episode.metrics;
    json["episodes"].push_back(one);
  }
  openFile(folder / "summary.json") << json.dump(2) << "\n";
}

// The episodes worth a picture: the median and the worst by the first goal.
std::vector<const EpisodeResult*> pictured(const Scenario& scenario,
                                           const std::vector<EpisodeResult>& episodes) {
  std::vector<const EpisodeResult*> order;
  order.reserve(episodes.size());
  for (const EpisodeResult& episode : episodes) order.push_back(&episode);
  const Goal& goal = scenario.goals.front();
  std::stable_sort(order.begin(), order.end(), [&](const EpisodeResult* a, const EpisodeResult* b) {
    return goal.badness(metricOf(*a, goal.metric)) < goal.badness(metricOf(*b, goal.metric));
  });
  if (order.size() < 2) return order;
  return {order[order.size() / 2 - (order.size() % 2 == 0 ? 1 : 0)], order.back()};
}

// What an earlier report left would stand beside this one's files as if it belonged to it.
void removeEpisodeFiles(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> old;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename().string().rfind("seed_", 0) == 0) old.push_back(entry.path());
  }
  for (const std::filesystem::path& file : old) std::filesystem::remove(file);
}

std::string padded(const std::string& text, std::size_t width, bool right) {
  const std::string space(width > text.size() ? width - text.size() : 0, ' ');
  return right ? space + text : text + space;
}

}  // namespace

std::string EpisodeResult::label() const {
  return "seed " + std::to_string(seed) + (reversed ? " reversed" : "");
}

Evaluation judge(const Scenario& scenario, const std::vector<EpisodeResult>& episodes) {
  Evaluation evaluation;
  evaluation.passed = !episodes.empty();
  for (const Goal& goal : scenario.goals) {
    evaluation.goals.push_back(judgeGoal(goal, episodes));
    evaluation.passed = evaluation.passed && evaluation.goals.back().holds;
  }
  return evaluation;
}

std::string table(const Scenario& scenario, const Evaluation& evaluation) {
  std::vector<std::vector<std::string>> rows = {
      {"metric", "paper", "goal", "median", "worst", "verdict"}};
  for (const GoalResult& result : evaluation.goals) {
    const std::string& key = result.goal.metric;
    rows.push_back({shownName(key), result.goal.paper, shownGoal(result.goal), shown(key, result.median),
                    shown(key, result.worst), shownVerdict(result)});
  }
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string out = scenario.title + "\n";
  for (std::size_t r = 0; r < rows.size(); ++r) {
    std::string line;
    for (std::size_t i = 0; i < rows[r].size(); ++i) {
      line += (i == 0 ? "" : "  ") + padded(rows[r][i], widths[i], i == 3 || i == 4);
    }
    out += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
    if (r == 0) out += std::string(line.size(), '-') + "\n";
  }
  return out;
}

void makeReportFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error("cannot make folder '" + folder + "': " + error.message());
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw std::runtime_error("cannot write into '" + folder + "': " + std::strerror(errno));
  }
}

void writeReport(const std::string& folder, const Scenario& scenario, const Evaluation& evaluation,
                 const std::vector<EpisodeResult>& episodes, const Fingerprints& fingerprints,
                 const vehicle::TruckGeometry& truck) {
  const std::filesystem::path path(folder);
  makeReportFolder(folder);
  removeEpisodeFiles(path);
  writeSummary(path, scenario, evaluation, episodes, fingerprints);
  writeEpisodes(path, episodes);
  for (const EpisodeResult& episode : episodes) {
    writeTrack(path, episode);
    writePerception(path, episode);
  }
  std::vector<Picture> pictures;
  for (const EpisodeResult* episode : pictured(scenario, episodes)) {
    pictures.push_back({episode->label(), episodePicture(scenario, *episode, truck)});
    if (pictures.back().png.empty()) continue;
    openFile(path / (fileLabel(*episode) + ".png")) << pictures.back().png;
  }
  openFile(path / "report.html") << htmlReport(scenario, evaluation, episodes, fingerprints, pictures);
}

}  // namespace tunnel_pilot::simulation
