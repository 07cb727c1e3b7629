#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace tunnel_pilot::neural {

/// Training met a value that is not finite. Every trainer throws it before it changes the parameters, so
/// that they are what they were before the call.
class Diverged : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws Diverged when one of the values is not finite, or so large that its square is not.
void requireFinite(const std::vector<double>& values, const std::string& what);

}  // namespace tunnel_pilot::neural
