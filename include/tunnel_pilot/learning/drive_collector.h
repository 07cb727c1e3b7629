#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/learning/teacher.h"
#include "tunnel_pilot/simulation/episode.h"

namespace tunnel_pilot::learning {

/// Collects examples from a drive, whoever drives: each scan beside what the teacher demands from where
/// the truck has come to when a demand begins to act (closed-loop aggregation; Ross, Gordon & Bagnell
/// 2011).
class DriveCollector : public simulation::DriveObserver {
 public:
  DriveCollector(const simulation::Setup& setup, const TeacherParameters& teacher, std::uint32_t tunnel);

  void afterScan(const simulation::Simulator& simulator, const simulation::Pilot& pilot) override;
  void afterTruth(const simulation::Simulator& simulator) override;

  DataSet take() { return std::move(examples_); }

 private:
  struct Pending {
    Stamp due;
    Example example;
  };

  Teacher teacher_;
  Stamp delay_;
  std::uint32_t tunnel_;
  std::deque<Pending> pending_;
  std::optional<TruckBesideLine> last_;  ///< truth before the newest
  Stamp last_stamp_{};
  DataSet examples_;
};

}  // namespace tunnel_pilot::learning
