#pragma once

#include <locale.h>

#include <clocale>
#include <string>
#include <vector>

namespace tunnel_pilot::neural {

/// While it lives, this thread reads and writes numbers with a decimal point, whatever the process'
/// locale.
class PlainNumbers {
 public:
  PlainNumbers() : plain_(newlocale(LC_ALL_MASK, "C", nullptr)), before_(uselocale(plain_)) {}
  ~PlainNumbers() {
    uselocale(before_);
    freelocale(plain_);
  }
  PlainNumbers(const PlainNumbers&) = delete;
  PlainNumbers& operator=(const PlainNumbers&) = delete;

 private:
  locale_t plain_;
  locale_t before_;
};

/// The shortest decimal text that is read back as the same number. To be called under PlainNumbers.
std::string shortest(float value);
std::string shortest(double value);

/// Numbers in lines of at most 100 columns, each line indented by two spaces.
std::string numberLines(const std::vector<float>& values);

/// Reads exactly `count` numbers, separated by white space, finite and of magnitude below `limit`.
/// Throws std::invalid_argument with the reason, beginning with `what`.
std::vector<float> parseNumbers(const std::string& text, std::size_t count, float limit,
                                const std::string& what);

}  // namespace tunnel_pilot::neural
