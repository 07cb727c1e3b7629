#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tunnel_pilot::config {

/// A number that may be changed while its stage runs.
struct TunableNumber {
  std::string name;  ///< the key's way from its file's root
  std::string unit;
  double min, max;      ///< what the file may hold
  bool higher_loosens;  ///< false: the higher, the more careful
};

/// The numbers of a stage that may be changed while it runs, and their values. A request changes all the
/// numbers it names or, when one of them is refused, none. Units are those of the numbers; nothing
/// throws.
class Tuning {
 public:
  using Request = std::vector<std::pair<std::string, double>>;

  /// One value for each number, in range.
  Tuning(std::vector<TunableNumber> numbers, std::vector<double> values);

  /// Nothing when the request was taken, else why it was refused: an unknown name, one that stands
  /// twice, a value that is not finite or out of range, or a looser one where it may `only_tighten`.
  std::optional<std::string> change(const Request& request, bool only_tighten);

  const std::vector<TunableNumber>& numbers() const { return numbers_; }
  const std::vector<double>& values() const { return values_; }

 private:
  std::vector<TunableNumber> numbers_;
  std::vector<double> values_;
};

}  // namespace tunnel_pilot::config
