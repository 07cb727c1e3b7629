#pragma once

#include <string>

namespace tunnel_pilot::config {

/// SHA-256 (FIPS 180-4) of a text, in hexadecimal.
std::string sha256(const std::string& text);

}  // namespace tunnel_pilot::config
