#pragma once

#include <functional>
#include <string>
#include <vector>

// Numbers of a hand-written YAML file, changed in place: comments and layout stay.
namespace tunnel_pilot::tools {

/// One number, two levels deep: `map:` at the left edge, below it, indented, `key: number`.
struct YamlNumber {
  std::string map;
  std::string key;
  double value;
};

/// The file's text with the numbers replaced; a comment behind one keeps its column where there is room.
/// Throws std::runtime_error naming the key unless it stands there exactly once, with a number.
std::string withNumbers(std::string text, const std::vector<YamlNumber>& numbers);

/// Replaces files, all or none: each text is written beside its file, `check` (which throws) is given
/// the new file's name, and only then they take the old ones' places, with their permissions. Throws
/// std::runtime_error and what `check` throws.
struct NewFile {
  std::string file;
  std::string text;
  std::function<void(const std::string& file)> check;
};
void replaceFiles(const std::vector<NewFile>& files);

}  // namespace tunnel_pilot::tools
