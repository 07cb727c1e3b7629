#pragma once

#include <vector>

#include "tunnel_pilot/config/tuning.h"
#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::supervision {

/// One number of config/arbiter.yaml that may be changed while the arbiter runs: one that a decision
/// reads anew, so that no memory of the arbiter's contradicts it. The limiter's are not among them: what
/// it let out last would lie outside its own limits.
struct ArbiterTunable {
  config::TunableNumber number;
  double& (*of)(ArbiterParameters& parameters);
};

/// All of them; Arbiter::tune() takes its values in their order.
const std::vector<ArbiterTunable>& arbiterTunables();

/// Their present values, for requests.
config::Tuning tuningOf(const Arbiter& arbiter);

}  // namespace tunnel_pilot::supervision
