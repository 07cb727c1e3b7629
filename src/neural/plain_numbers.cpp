#include "plain_numbers.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kColumns = 100;
constexpr std::size_t kShown = 24;  // characters of a bad number that a message repeats

bool isSpace(char c) { return c == ' ' || c == '\n'; }

[[noreturn]] void refuse(const std::string& what, std::size_t index, std::string text,
                         const std::string& why) {
  if (text.size() > kShown) text = text.substr(0, kShown) + "...";
  throw std::invalid_argument(what + " " + std::to_string(index + 1) + " '" + text + "' " + why);
}

// One number from the characters up to `end`, all of which must belong to it.
float parseNumber(const char* begin, const char* end, float limit, const std::string& what,
                  std::size_t index) {
  char* stop = nullptr;
  const float value = std::strtof(begin, &stop);
  if (stop != end) refuse(what, index, std::string(begin, end), "is not a number");
  if (!std::isfinite(value)) refuse(what, index, std::string(begin, end), "is not finite");
  if (std::abs(value) >= limit) refuse(what, index, std::string(begin, end), "is too large");
  return value;
}

}  // namespace

std::string shortest(float value) {
  std::array<char, 32> text{};
  for (int digits = 6; digits <= 9; ++digits) {
    std::snprintf(text.data(), text.size(), "%.*g", digits, static_cast<double>(value));
    if (std::strtof(text.data(), nullptr) == value) break;
  }
  return text.data();
}

std::string shortest(double value) {
  std::array<char, 32> text{};
  for (int digits = 9; digits <= 17; ++digits) {
    std::snprintf(text.data(), text.size(), "%.*g", digits, value);
    if (std::strtod(text.data(), nullptr) == value) break;
  }
  return text.data();
}

std::string numberLines(const std::vector<float>& values) {
  std::string lines;
  std::size_t column = kColumns;
  for (const float value : values) {
    const std::string text = shortest(value);
    if (column + 1 + text.size() > kColumns) {
      lines += lines.empty() ? "  " : "\n  ";
      column = 2;
    } else {
      lines += ' ';
      ++column;
    }
    lines += text;
    column += text.size();
  }
  return lines + "\n";
}

std::vector<float> parseNumbers(const std::string& text, std::size_t count, float limit,
                                const std::string& what) {
  std::vector<float> values;
  values.reserve(count);
  const char* at = text.c_str();
  const char* const end = at + text.size();
  for (;;) {
    while (at != end && isSpace(*at)) ++at;
    if (at == end) break;
    const char* const begin = at;
    while (at != end && !isSpace(*at)) ++at;
    if (values.size() == count) {
      throw std::invalid_argument(what + "s: more than the " + std::to_string(count) +
                                  " that belong here");
    }
    values.push_back(parseNumber(begin, at, limit, what, values.size()));
  }
  if (values.size() < count) {
    throw std::invalid_argument(what + "s: only " + std::to_string(values.size()) + " of " +
                                std::to_string(count));
  }
  return values;
}

}  // namespace tunnel_pilot::neural
