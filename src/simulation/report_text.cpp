#include "report_text.h"

#include <cmath>
#include <cstdio>
#include <limits>

namespace tunnel_pilot::simulation {

double metricOf(const EpisodeResult& episode, const std::string& key) {
  const auto found = episode.metrics.find(key);
  return found == episode.metrics.end() ? std::numeric_limits<double>::quiet_NaN() : found->second;
}

std::string shown(const std::string& key, double value) {
  if (std::isnan(value)) return "none";
  if (std::isinf(value)) return "never";
  char text[32];
  const double scaled = value * metricText(key).factor;
  const double magnitude = std::abs(scaled);
  const bool whole = std::abs(scaled - std::round(scaled)) < 1e-9 && magnitude < 1e6;
  const int decimals = whole               ? 0
                       : magnitude >= 1000 ? 0
                       : magnitude >= 100  ? 1
                       : magnitude >= 10   ? 2
                                           : 3;
  std::snprintf(text, sizeof text, "%.*f", decimals, scaled);
  return text;
}

std::string shownGoal(const Goal& goal) {
  std::string text;
  if (goal.min && goal.max) {
    text = shown(goal.metric, *goal.min) + " .. " + shown(goal.metric, *goal.max);
  } else if (goal.max) {
    text = "<= " + shown(goal.metric, *goal.max);
  } else if (goal.min) {
    text = ">= " + shown(goal.metric, *goal.min);
  } else {
    return "report";
  }
  return goal.judge == Judge::kMedian ? text + " (median)" : text;
}

std::set<std::string> metricKeys(const std::vector<EpisodeResult>& episodes) {
  std::set<std::string> keys;
  for (const EpisodeResult& episode : episodes) {
    for (const auto& [key, value] : episode.metrics) keys.insert(key);
  }
  return keys;
}

std::string shownName(const std::string& key) {
  const MetricText& text = metricText(key);
  return text.words + (text.unit.empty() ? "" : " [" + text.unit + "]");
}

std::string shownVerdict(const GoalResult& result) {
  if (result.goal.judge == Judge::kReportOnly) return "-";
  return result.holds ? "ok" : "MISSED";
}

}  // namespace tunnel_pilot::simulation
