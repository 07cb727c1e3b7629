#include "html_report.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <utility>

#include "report_text.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr double kRowWidth = 180.0, kRowHeight = 22.0, kRowEdge = 8.0;  // [pixels]

constexpr const char* kStyle = R"(
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1240px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: 0.2em; }
h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25em 0.8em; border-bottom: 1px solid #ddd; text-align: left; white-space: nowrap; }
th { border-bottom: 2px solid #888; }
td.number, th.number { text-align: right; }
#episodes { font-size: 0.8em; line-height: 1.3; }
#episodes th, #episodes td { padding: 0.25em 0.5em; }
#episodes th { white-space: normal; vertical-align: bottom; min-width: 4.5em; }
#origin th { border-bottom: 1px solid #ddd; font-weight: normal; }
.wide { overflow-x: auto; }
.ok { color: #1a7a32; font-weight: 600; }
.missed { color: #b3261e; font-weight: 600; }
img { width: 100%; border: 1px solid #ddd; }
code { background: #f3f3f3; padding: 0.15em 0.4em; overflow-wrap: anywhere; }
svg { vertical-align: middle; }
)";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string base64(const std::string& bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      word = word << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += i + k > bytes.size() ? '=' : kDigits[word >> (18 - 6 * k) & 63U];
    }
  }
  return out;
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

// A figure as people read it; its SI value for programs.
std::string figure(const std::string& key, double value) {
  if (!std::isfinite(value)) return shown(key, value);
  return format("<data value=\"%.9g\">", value) + shown(key, value) + "</data>";
}

std::string cell(const std::string& content, const char* kind = "") {
  const std::string attribute = *kind == '\0' ? "" : std::string(" class=\"") + kind + "\"";
  return "<td" + attribute + ">" + content + "</td>";
}

std::string verdictCell(const std::string& verdict) {
  return cell(verdict, verdict == "ok" ? "ok" : verdict == "MISSED" ? "missed" : "");
}

// Where a goal's values and bounds lie in its strip.
class Scale {
 public:
  Scale(const std::vector<double>& values, const Goal& goal) {
    std::vector<double> shown;
    std::copy_if(values.begin(), values.end(), std::back_inserter(shown),
                 [](double value) { return std::isfinite(value); });
    for (const auto& bound : {goal.min, goal.max}) {
      if (bound) shown.push_back(*bound);
    }
    if (shown.empty()) return;
    const auto [low, high] = std::minmax_element(shown.begin(), shown.end());
    low_ = *low;
    span_ = *high - *low;
  }

  // What is not finite stands at the right end.
  double x(double value) const {
    const double share = !std::isfinite(value) ? 1.0 : span_ > 0.0 ? (value - low_) / span_ : 0.5;
    return kRowEdge + share * (kRowWidth - 2.0 * kRowEdge);
  }

 private:
  double low_ = 0.0, span_ = 0.0;
};

// Each episode a dot, what the goal allows in green.
std::string strip(const Goal& goal, const std::vector<EpisodeResult>& episodes) {
  std::vector<double> values;
  for (const EpisodeResult& episode : episodes) values.push_back(metricOf(episode, goal.metric));
  const Scale scale(values, goal);
  std::string svg = format("<svg width=\"%g\" height=\"%g\" role=\"img\">", kRowWidth, kRowHeight);
  if (goal.min || goal.max) {
    const double from = goal.min ? scale.x(*goal.min) : 0.0;
    const double to = goal.max ? scale.x(*goal.max) : kRowWidth;
    svg += format("<rect x=\"%.1f\" y=\"3\" width=\"%.1f\" height=\"16\" fill=\"#d9f0df\" />", from,
                  std::max(1.0, to - from));
  }
  for (const double value : values) {
    svg += format("<circle cx=\"%.1f\" cy=\"11\" r=\"3\" fill=\"%s\" fill-opacity=\"0.5\" />",
                  scale.x(value), goal.holds(value) ? "#145fa0" : "#b3261e");
  }
  return svg + "</svg>";
}

std::string goalsTable(const Evaluation& evaluation, const std::vector<EpisodeResult>& episodes) {
  std::string out =
      "<table id=\"goals\">\n<tr><th>metric</th><th>paper</th><th>goal</th><th "
      "class=\"number\">median</th><th class=\"number\">worst</th><th>worst in</th><th>each episode, "
      "the goal green</th><th>verdict</th></tr>\n";
  for (const GoalResult& result : evaluation.goals) {
    const std::string& key = result.goal.metric;
    out += "<tr>" + cell(escaped(shownName(key))) + cell(escaped(result.goal.paper)) +
           cell(escaped(shownGoal(result.goal))) + cell(figure(key, result.median), "number") +
           cell(figure(key, result.worst), "number") + cell(result.worst_episode) +
           cell(strip(result.goal, episodes)) + verdictCell(shownVerdict(result)) + "</tr>\n";
  }
  return out + "</table>\n";
}

std::string episodesTable(const std::vector<EpisodeResult>& episodes) {
  const std::set<std::string> keys = metricKeys(episodes);
  std::string out = "<table id=\"episodes\">\n<tr><th>episode</th><th>ending</th>";
  for (const std::string& key : keys) {
    out += "<th class=\"number\">" + escaped(shownName(key)) + "</th>";
  }
  out += "</tr>\n";
  for (const EpisodeResult& episode : episodes) {
    out += "<tr>" + cell(episode.label()) + cell(escaped(episode.ending));
    for (const std::string& key : keys) out += cell(figure(key, metricOf(episode, key)), "number");
    out += "</tr>\n";
  }
  return out + "</table>\n";
}

std::string endings(const std::vector<EpisodeResult>& episodes) {
  std::map<std::string, int> counts;
  for (const EpisodeResult& episode : episodes) ++counts[episode.ending];
  std::string text;
  for (const auto& [ending, count] : counts) {
    text += (text.empty() ? "" : ", ") + ending + " (" + std::to_string(count) + ")";
  }
  return escaped(text);
}

std::string originTable(const Fingerprints& of) {
  std::string out = "<table id=\"origin\">\n";
  const auto row = [&out](const char* name, const std::string& value) {
    if (!value.empty()) out += std::string("<tr><th>") + name + "</th>" + cell(value) + "</tr>\n";
  };
  const auto code = [](const std::string& text) {
    return text.empty() ? text : "<code>" + escaped(text) + "</code>";
  };
  row("command", code(of.command));
  row("driver", escaped(of.driver));
  row("SHA-256 of the scenario", code(of.scenario));
  row("... of the pilot's parameters", code(of.controller));
  row("... of truck and simulator", code(of.plant));
  row("... of the world", code(of.world));
  row("... of the network", code(of.network));
  return out + "</table>\n";
}

}  // namespace

std::string htmlReport(const Scenario& scenario, const Evaluation& evaluation,
                       const std::vector<EpisodeResult>& episodes, const Fingerprints& fingerprints,
                       const std::vector<Picture>& pictures) {
  std::string out = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\" />\n<title>" +
                    escaped(scenario.name) + "</title>\n<style>" + kStyle +
                    "</style>\n</head>\n<body>\n";
  out += "<h1>" + escaped(scenario.title) + "</h1>\n<p>";
  out += evaluation.passed ? "<span class=\"ok\">Every goal holds.</span> "
                           : "<span class=\"missed\">A goal is MISSED.</span> ";
  out += std::to_string(episodes.size()) + " episodes of " + escaped(scenario.name) + ", driven by " +
         escaped(fingerprints.driver) + ": " + endings(episodes) + ".</p>\n";
  out += "<h2>Goals</h2>\n<div class=\"wide\">\n" + goalsTable(evaluation, episodes) + "</div>\n";
  out += "<h2>The median and the worst episode by the first goal</h2>\n";
  for (const Picture& picture : pictures) {
    if (picture.png.empty()) continue;
    out += "<h3>" + escaped(picture.title) + "</h3>\n<img alt=\"" + escaped(picture.title) +
           "\" src=\"data:image/png;base64," + base64(picture.png) + "\" />\n";
  }
  out += "<h2>Episodes</h2>\n<div class=\"wide\">\n" + episodesTable(episodes) + "</div>\n";
  out += "<h2>What gives this again</h2>\n" + originTable(fingerprints);
  return out + "</body>\n</html>\n";
}

}  // namespace tunnel_pilot::simulation
