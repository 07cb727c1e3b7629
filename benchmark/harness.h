#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace tunnel_pilot::benchmark {

/// A goal for one of our figures, as one row of the table.
struct Row {
  std::string what;   ///< the peer, or the figure that is judged
  std::string unit;   ///< of `peer` and `ours`
  double peer = 0.0;  ///< the peer's figure, or the limit
  double ours = 0.0;
  double ratio = 0.0;  ///< peer / ours
  std::string goal;    ///< in words
  bool met = false;
};

/// One kind of work done by us and by peers, all in one process and by turns, so that a busy or slowing
/// machine slows all alike. A turn is many repeats between two readings of this thread's CPU clock; the
/// figure is the median over the turns.
///
///   main() { Contest contest("ray casting", argc, argv);
///            contest.add("ours", [&] { cast(); });
///            contest.add("Embree", [&] { embree(); });
///            if (contest.run()) { contest.require("Embree", "ours", 4.0); }
///            return contest.finish(); }
///
/// Arguments of such a program:
///   --json FILE   write the rows
///   --count NAME N   do the work called NAME N times and nothing else, for counting instructions
class Contest {
 public:
  Contest(std::string work, int argc, char** argv);

  /// One call is one unit of work.
  void add(const std::string& name, std::function<void()> work);
  /// A peer that this build does without.
  void missing(const std::string& peer) { missing_.push_back(peer); }

  /// Measures; false when this run only counts instructions (the work is then done).
  bool run(int turns = 41, double turn_seconds = 2e-3);

  double median(const std::string& name) const;  ///< [us]

  /// The peer's median must be at least `times` that of `ours`.
  void requireFaster(const std::string& peer, const std::string& ours, double times);
  /// Any other figure: `ours` must not exceed `limit`.
  void requireAtMost(const std::string& what, const std::string& unit, double ours, double limit);
  /// ... or must reach it.
  void requireAtLeast(const std::string& what, const std::string& unit, double ours, double limit);
  /// The work called `name` must not take more than `limit` instructions. They are counted afterwards,
  /// by scripts/benchmark with valgrind, from two runs of this program with --count.
  void requireInstructions(const std::string& name, double limit);
  /// A peer's figure without a goal.
  void tell(const std::string& peer, const std::string& ours);

  /// Prints and writes the rows; 0 when all goals are met, 1 when not.
  int finish() const;

 private:
  struct Entry {
    std::string name;
    std::function<void()> work;
    std::uint64_t repeats = 1;
    double median = 0.0;  // [us]
  };
  const Entry& entry(const std::string& name) const;
  void calibrate(Entry& entry, double turn_seconds) const;

  std::string work_;
  std::string json_file_;
  std::string counted_;
  std::uint64_t count_ = 0;
  std::vector<Entry> entries_;
  std::vector<std::string> missing_;
  std::vector<Row> rows_;
  std::vector<std::pair<std::string, double>> counted_limits_;
};

}  // namespace tunnel_pilot::benchmark
