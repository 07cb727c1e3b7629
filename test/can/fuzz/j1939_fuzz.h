#pragma once

#include "../../fuzz.h"

namespace tunnel_pilot::can {

/// A J1939Bus among strangers: time that jumps, a bus that fails, claims, requests and frames from any
/// address.
void fuzzJ1939(FuzzBytes& bytes);

}  // namespace tunnel_pilot::can
