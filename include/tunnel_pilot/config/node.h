#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace tunnel_pilot::config {

/// A file or parameter set was refused. what() names the source, the key, the unit and the range.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What one read told of a parameter: the tables of the documentation are made from these.
struct ParameterRecord {
  std::string key;    ///< the key's way from the file's root
  std::string unit;   ///< empty for text and flags
  std::string range;  ///< "[min, max]" or the allowed words
  std::string value;  ///< as it stands in the file
};

/// Strict reading of one YAML map: every key that is asked for must be there, of the right type and in
/// range; finish() refuses keys that nobody asked for. There are no silent defaults. ROS parameters are
/// read through the same class (see ros/parameters.h), so that a key has one meaning and one message.
/// Every reader throws ConfigError.
class Node {
 public:
  /// `source` names the file or parameter namespace in messages; `path` is the key's way from its root.
  /// Refuses what is no map, and a map with a key that stands twice.
  Node(const YAML::Node& yaml, std::string source, std::string path = "");

  /// Number in [min, max]; `unit` such as "m", "rad", "1" stands in the message.
  double number(const std::string& key, const std::string& unit, double min, double max);
  std::int64_t integer(const std::string& key, const std::string& unit, std::int64_t min,
                       std::int64_t max);
  bool boolean(const std::string& key);
  std::string text(const std::string& key);
  /// Text that is one of `allowed`.
  std::string choice(const std::string& key, const std::vector<std::string>& allowed);
  /// List of numbers with min_size..max_size entries.
  std::vector<double> numbers(const std::string& key, const std::string& unit, double min, double max,
                              std::size_t min_size, std::size_t max_size);
  /// List of texts with min_size..max_size entries.
  std::vector<std::string> texts(const std::string& key, std::size_t min_size, std::size_t max_size);
  /// Nested map, and list of maps.
  Node child(const std::string& key);
  std::vector<Node> children(const std::string& key);

  /// True when the key is present: only for keys whose absence has a documented meaning of its own.
  bool has(const std::string& key) const;

  /// Refuses every key that was not read. Call it last.
  void finish() const;

  /// Throws ConfigError for this key with a reason of the caller's.
  [[noreturn]] void refuse(const std::string& key, const std::string& why) const;

  const std::string& source() const { return source_; }

  /// All reads from the file so far, its nested maps' included, in their order.
  const std::vector<ParameterRecord>& records() const { return *records_; }

 private:
  Node(const YAML::Node& yaml, const Node& parent, std::string path);
  void record(const std::string& key, const std::string& unit, const std::string& range,
              const YAML::Node& value);
  YAML::Node take(const std::string& key);
  std::string name(const std::string& key) const;
  double parseNumber(const YAML::Node& value, const std::string& key, const std::string& unit,
                     double min, double max) const;

  YAML::Node yaml_;
  std::string source_;
  std::string path_;
  std::set<std::string> read_;
  std::shared_ptr<std::vector<ParameterRecord>> records_;
};

/// Reads a text that holds one YAML document, and in it one map; `source` is what messages call it.
/// Throws ConfigError.
Node parseText(const std::string& text, const std::string& source);

/// Reads a YAML file of at most 4 MiB as one map. Throws ConfigError when it cannot be opened or parsed.
Node loadFile(const std::string& file);

}  // namespace tunnel_pilot::config
