#include "tunnel_pilot/config/tuning.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

namespace tunnel_pilot::config {
namespace {

// Written so that what is no number is refused.
std::optional<std::string> refusal(const TunableNumber& number, double value, double present,
                                   bool only_tighten) {
  std::ostringstream why;
  if (!(std::isfinite(value) && value >= number.min && value <= number.max)) {
    why << number.name << ": " << value << " is not in [" << number.min << ", " << number.max << "] "
        << number.unit;
    return why.str();
  }
  const bool looser = number.higher_loosens ? value > present : value < present;
  if (!only_tighten || !looser) return std::nullopt;
  why << number.name << ": " << value << " " << number.unit << " is looser than " << present
      << ", and the truck may be under way";
  return why.str();
}

}  // namespace

Tuning::Tuning(std::vector<TunableNumber> numbers, std::vector<double> values)
    : numbers_(std::move(numbers)), values_(std::move(values)) {}

std::optional<std::string> Tuning::change(const Request& request, bool only_tighten) {
  std::vector<double> changed = values_;
  std::set<std::string> named;
  for (const auto& [name, value] : request) {
    const auto number = std::find_if(numbers_.begin(), numbers_.end(),
                                     [&wanted = name](const auto& n) { return n.name == wanted; });
    if (number == numbers_.end()) return name + " is no number that can be changed";
    if (!named.insert(name).second) return name + " stands twice in the request";
    const auto place = static_cast<std::size_t>(number - numbers_.begin());
    if (auto why = refusal(*number, value, values_[place], only_tighten)) return why;
    changed[place] = value;
  }
  values_ = std::move(changed);
  return std::nullopt;
}

}  // namespace tunnel_pilot::config
