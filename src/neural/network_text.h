#pragma once

// What reader and writer of network files share; docs/neural.md describes the format.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::neural {

constexpr char kFirstLine[] = "format: tunnel_pilot_network\n";
constexpr std::int64_t kVersion = 1;
constexpr char kHashKey[] = "sha256: ";
constexpr std::size_t kHashLine = 8 + 64 + 1;
constexpr float kParameterLimit = 1000.0F;
constexpr float kGoldenLimit = 1e9F;
constexpr float kDomainLimit = 1e6F;
constexpr float kGoldenTolerance = 1e-5F;  // of outputs of magnitude 1; relative to larger ones
constexpr std::size_t kMaxFileBytes = 64U << 20U;
constexpr std::size_t kMaxHeaderBytes = 1U << 20U;  // all but the blocks of numbers
constexpr std::size_t kMaxLayers = 64;
constexpr std::size_t kMaxWork = 200'000'000;  // multiplications of one pass
constexpr std::size_t kMaxName = 100;

}  // namespace tunnel_pilot::neural
