#include "yaml_numbers.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace tunnel_pilot::tools {
namespace {

namespace filesystem = std::filesystem;

std::string written(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  const std::string number = text.data();
  return number.find_first_of(".e") == std::string::npos ? number + ".0" : number;
}

// The line with another number, its comment in the same column if possible.
std::string withNumber(const std::smatch& line, double value) {
  const std::string number = written(value);
  const std::string old = line[2];
  std::string space = line[3];
  const std::string rest = line[4];
  if (rest.empty()) return line[1].str() + number + rest;
  const auto wanted = static_cast<long>(space.size() + old.size()) - static_cast<long>(number.size());
  space = std::string(static_cast<std::size_t>(std::max(1L, wanted)), ' ');
  return line[1].str() + number + space + rest;
}

std::string replaceOne(const std::string& text, const YamlNumber& number) {
  const std::regex wanted("( +" + number.key + ": +)([-+.0-9eE]+)( *)(#.*)?");
  std::istringstream lines(text);
  std::string result, line;
  bool inside = false;
  int found = 0;
  while (std::getline(lines, line)) {
    if (!line.empty() && line[0] != ' ' && line[0] != '#') inside = line.rfind(number.map + ":", 0) == 0;
    std::smatch parts;
    if (inside && std::regex_match(line, parts, wanted)) {
      ++found;
      line = withNumber(parts, number.value);
    }
    result += line;
    if (!lines.eof()) result += "\n";
  }
  if (found == 1) return result;
  throw std::runtime_error("'" + number.map + "." + number.key + "' stands " + std::to_string(found) +
                           " times on a line of its own");
}

void write(const std::string& file, const std::string& text, filesystem::perms permissions) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << text;
  out.close();
  if (!out) throw std::runtime_error("cannot write '" + file + "': " + std::strerror(errno));
  filesystem::permissions(file, permissions);
}

// Removes what was not renamed.
class Leftovers {
 public:
  ~Leftovers() {
    std::error_code ignored;
    for (const std::string& file : files) filesystem::remove(file, ignored);
  }
  std::vector<std::string> files;
};

}  // namespace

std::string withNumbers(std::string text, const std::vector<YamlNumber>& numbers) {
  for (const YamlNumber& number : numbers) text = replaceOne(text, number);
  return text;
}

void replaceFiles(const std::vector<NewFile>& files) {
  Leftovers leftovers;
  std::vector<std::string> places;
  for (const NewFile& file : files) {
    places.push_back(filesystem::canonical(file.file).string());  // a link stays one
    leftovers.files.push_back(places.back() + ".new" + std::to_string(getpid()));
    write(leftovers.files.back(), file.text, filesystem::status(places.back()).permissions());
    file.check(leftovers.files.back());
  }
  for (std::size_t i = 0; i < files.size(); ++i) filesystem::rename(leftovers.files[i], places[i]);
}

}  // namespace tunnel_pilot::tools
