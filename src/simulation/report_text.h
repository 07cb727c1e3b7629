#pragma once

#include <set>
#include <string>
#include <vector>

#include "tunnel_pilot/simulation/report.h"

// What the table and the page of a report share.
namespace tunnel_pilot::simulation {

/// An episode's metric, NaN when it does not have it.
double metricOf(const EpisodeResult& episode, const std::string& key);

/// The metrics that any of the episodes has.
std::set<std::string> metricKeys(const std::vector<EpisodeResult>& episodes);

/// As shown to people: in the metric's own unit, with three to four digits.
std::string shown(const std::string& key, double value);

/// The goal's bounds, so shown.
std::string shownGoal(const Goal& goal);

/// A metric's words and unit: "lateral RMS [mm]".
std::string shownName(const std::string& key);

/// What became of a goal: "ok", "MISSED", or "-" where it is for report only.
std::string shownVerdict(const GoalResult& result);

}  // namespace tunnel_pilot::simulation
