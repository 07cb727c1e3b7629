#pragma once

#include <linux/can.h>

#include <optional>

#include "tunnel_pilot/can/frame.h"

namespace tunnel_pilot::can {

/// A data frame as the kernel has it.
can_frame toLinux(const Frame& frame);

/// nullopt for remote and error frames and for impossible lengths and identifiers.
std::optional<Frame> fromLinux(const can_frame& in);

}  // namespace tunnel_pilot::can
