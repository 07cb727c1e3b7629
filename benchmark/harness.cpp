#include "harness.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace tunnel_pilot::benchmark {
namespace {

// CPU time of this thread [s]: what other programs take away does not count.
double cpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double secondsOf(const std::function<void()>& work, std::uint64_t repeats) {
  const double start = cpuSeconds();
  for (std::uint64_t i = 0; i < repeats; ++i) work();
  return cpuSeconds() - start;
}

std::string text(double number) {
  std::ostringstream out;
  out << number;
  return out.str();
}

}  // namespace

Contest::Contest(std::string work, int argc, char** argv) : work_(std::move(work)) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == "--json" && i + 1 < arguments.size()) {
      json_file_ = arguments[++i];
    } else if (arguments[i] == "--count" && i + 2 < arguments.size()) {
      counted_ = arguments[++i];
      count_ = std::stoull(arguments[++i]);
    } else {
      throw std::invalid_argument("usage: [--json FILE] [--count NAME N]");
    }
  }
}

void Contest::add(const std::string& name, std::function<void()> work) {
  entries_.push_back({name, std::move(work)});
}

const Contest::Entry& Contest::entry(const std::string& name) const {
  for (const Entry& candidate : entries_) {
    if (candidate.name == name) return candidate;
  }
  throw std::invalid_argument("nobody is called '" + name + "'");
}

void Contest::calibrate(Entry& entry, double turn_seconds) const {
  double taken = secondsOf(entry.work, 1);
  while (taken < 0.5 * turn_seconds) {
    entry.repeats *= 2;
    taken = secondsOf(entry.work, entry.repeats);
  }
}

bool Contest::run(int turns, double turn_seconds) {
  if (!counted_.empty()) {
    const Entry& counted = entry(counted_);
    for (std::uint64_t i = 0; i < count_; ++i) counted.work();
    return false;
  }
  std::vector<std::vector<double>> times(entries_.size());
  for (Entry& e : entries_) calibrate(e, turn_seconds);
  for (int turn = 0; turn < turns; ++turn) {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry& e = entries_[i];
      times[i].push_back(1e6 * secondsOf(e.work, e.repeats) / static_cast<double>(e.repeats));
    }
  }
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const auto middle = times[i].begin() + turns / 2;
    std::nth_element(times[i].begin(), middle, times[i].end());
    entries_[i].median = *middle;
  }
  return true;
}

double Contest::median(const std::string& name) const { return entry(name).median; }

void Contest::requireFaster(const std::string& peer, const std::string& ours, double times) {
  tell(peer, ours);
  Row& row = rows_.back();
  row.goal = "at least " + text(times) + " times as fast";
  row.met = row.ratio >= times;
}

void Contest::tell(const std::string& peer, const std::string& ours) {
  rows_.push_back({peer, "us", median(peer), median(ours), median(peer) / median(ours), "", true});
}

void Contest::requireAtMost(const std::string& what, const std::string& unit, double ours,
                            double limit) {
  rows_.push_back({what, unit, limit, ours, limit / ours, "at most " + text(limit), ours <= limit});
}

void Contest::requireAtLeast(const std::string& what, const std::string& unit, double ours,
                             double limit) {
  rows_.push_back({what, unit, limit, ours, ours / limit, "at least " + text(limit), ours >= limit});
}

void Contest::requireInstructions(const std::string& name, double limit) {
  counted_limits_.emplace_back(entry(name).name, limit);
}

int Contest::finish() const {
  nlohmann::json rows = nlohmann::json::array();
  bool all_met = true;
  for (const Row& row : rows_) {
    all_met = all_met && row.met;
    rows.push_back({{"what", row.what},
                    {"unit", row.unit},
                    {"peer", row.peer},
                    {"ours", row.ours},
                    {"ratio", row.ratio},
                    {"goal", row.goal},
                    {"met", row.met}});
    std::printf("%-14s %-42s %10.4g %10.4g %-6s %8.3g  %s%s\n", work_.c_str(), row.what.c_str(),
                row.peer, row.ours, row.unit.c_str(), row.ratio, row.goal.c_str(),
                row.met ? "" : "  NOT MET");
  }
  for (const std::string& peer : missing_) {
    std::printf("%-14s %-42s not installed\n", work_.c_str(), peer.c_str());
  }
  nlohmann::json counted = nlohmann::json::array();
  for (const auto& [name, limit] : counted_limits_)
    counted.push_back({{"name", name}, {"limit", limit}});
  if (!json_file_.empty()) {
    std::ofstream file(json_file_);
    file << nlohmann::json{{"work", work_}, {"rows", rows}, {"missing", missing_}, {"counted", counted}}
                .dump(2)
         << '\n';
    if (!file.flush()) {
      std::fprintf(stderr, "%s: cannot be written\n", json_file_.c_str());
      return 1;
    }
  }
  return all_met ? 0 : 1;
}

}  // namespace tunnel_pilot::benchmark
