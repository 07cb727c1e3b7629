#include "tunnel_pilot/config/node.h"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

namespace tunnel_pilot::config {
namespace {

constexpr std::uintmax_t kMaxFileBytes = 4u << 20;

// yaml-cpp marks a quoted scalar with the tag "!": "3" in quotes is text, never a number.
bool isPlainScalar(const YAML::Node& value) { return value.IsScalar() && value.Tag() != "!"; }

std::string interval(double min, double max) {
  std::ostringstream out;
  out << "[" << min << ", " << max << "]";
  return out.str();
}

std::string range(const std::string& unit, double min, double max) {
  return "[" + unit + "] in " + interval(min, max);
}

// Whatever a file holds, a message stays one line.
std::string oneLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  return text;
}

std::string keyOf(const YAML::Node& key) { return key.IsScalar() ? key.Scalar() : "(not a scalar)"; }

std::string flowText(const YAML::Node& value) {
  YAML::Emitter out;
  out << YAML::Flow << value;
  return out.c_str();
}

// Takes a document's events and keeps nothing.
class NoEvents : public YAML::EventHandler {
  using Mark = const YAML::Mark&;
  using Text = const std::string&;
  using Anchor = YAML::anchor_t;
  using Style = YAML::EmitterStyle::value;
  void OnDocumentStart(Mark /*mark*/) override {}
  void OnDocumentEnd() override {}
  void OnNull(Mark /*mark*/, Anchor /*anchor*/) override {}
  void OnAlias(Mark /*mark*/, Anchor /*anchor*/) override {}
  void OnScalar(Mark /*mark*/, Text /*tag*/, Anchor /*anchor*/, Text /*value*/) override {}
  void OnSequenceStart(Mark /*mark*/, Text /*tag*/, Anchor /*anchor*/, Style /*style*/) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(Mark /*mark*/, Text /*tag*/, Anchor /*anchor*/, Style /*style*/) override {}
  void OnMapEnd() override {}
};

// Asks for no more than two: behind the end of a document, what begins none (a comma) is to yaml-cpp 0.7
// an empty document, and another, without end, which YAML::LoadAll would collect until no memory is
// left.
bool hasTwoDocuments(const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  NoEvents none;
  return parser.HandleNextDocument(none) && parser.HandleNextDocument(none);
}

}  // namespace

Node::Node(const YAML::Node& yaml, std::string source, std::string path)
    : yaml_(yaml),
      source_(std::move(source)),
      path_(std::move(path)),
      records_(std::make_shared<std::vector<ParameterRecord>>()) {
  if (!yaml_.IsMap()) {
    throw ConfigError(source_ + ": " + (path_.empty() ? "the file" : "'" + path_ + "'") +
                      " must be a map of keys");
  }
  std::set<std::string> keys;
  for (const auto& entry : yaml_) {
    const std::string key = keyOf(entry.first);
    if (!keys.insert(key).second) refuse(key, "stands twice");
  }
}

Node::Node(const YAML::Node& yaml, const Node& parent, std::string path)
    : Node(yaml, parent.source_, std::move(path)) {
  records_ = parent.records_;
}

void Node::record(const std::string& key, const std::string& unit, const std::string& allowed,
                  const YAML::Node& value) {
  records_->push_back({name(key), unit, allowed, flowText(value)});
}

std::string Node::name(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

void Node::refuse(const std::string& key, const std::string& why) const {
  throw ConfigError(oneLine(source_ + ": '" + name(key) + "' " + why));
}

bool Node::has(const std::string& key) const {
  const YAML::Node& map = yaml_;
  return map[key].IsDefined();
}

YAML::Node Node::take(const std::string& key) {
  if (!has(key)) refuse(key, "is missing");
  read_.insert(key);
  const YAML::Node& map = yaml_;
  return map[key];
}

double Node::parseNumber(const YAML::Node& value, const std::string& key, const std::string& unit,
                         double min, double max) const {
  double number = 0.0;
  if (!isPlainScalar(value) || !YAML::convert<double>::decode(value, number)) {
    refuse(key, "must be a number " + range(unit, min, max));
  }
  if (!std::isfinite(number) || number < min || number > max) {
    refuse(key, "= " + value.Scalar() + " must be a number " + range(unit, min, max));
  }
  return number;
}

double Node::number(const std::string& key, const std::string& unit, double min, double max) {
  const YAML::Node value = take(key);
  record(key, unit, interval(min, max), value);
  return parseNumber(value, key, unit, min, max);
}

std::int64_t Node::integer(const std::string& key, const std::string& unit, std::int64_t min,
                           std::int64_t max) {
  const YAML::Node value = take(key);
  record(key, unit, interval(static_cast<double>(min), static_cast<double>(max)), value);
  const std::string wanted =
      "must be a whole number " + range(unit, static_cast<double>(min), static_cast<double>(max));
  std::int64_t number = 0;
  if (!isPlainScalar(value) || !YAML::convert<std::int64_t>::decode(value, number)) refuse(key, wanted);
  if (number < min || number > max) refuse(key, "= " + value.Scalar() + " " + wanted);
  return number;
}

bool Node::boolean(const std::string& key) {
  const YAML::Node value = take(key);
  record(key, "", "true, false", value);
  bool flag = false;
  if (!isPlainScalar(value) || !YAML::convert<bool>::decode(value, flag)) {
    refuse(key, "must be true or false");
  }
  return flag;
}

std::string Node::text(const std::string& key) {
  const YAML::Node value = take(key);
  record(key, "", "text", value);
  if (!value.IsScalar()) refuse(key, "must be text");
  return value.Scalar();
}

std::string Node::choice(const std::string& key, const std::vector<std::string>& allowed) {
  std::string value = text(key);
  std::string list;
  for (const std::string& candidate : allowed) list += (list.empty() ? "" : ", ") + candidate;
  records_->back().range = list;
  for (const std::string& candidate : allowed) {
    if (candidate == value) return value;
  }
  refuse(key, "= '" + value + "' must be one of: " + list);
}

std::vector<double> Node::numbers(const std::string& key, const std::string& unit, double min,
                                  double max, std::size_t min_size, std::size_t max_size) {
  const YAML::Node list = take(key);
  record(key, unit, interval(min, max) + " each", list);
  if (!list.IsSequence() || list.size() < min_size || list.size() > max_size) {
    refuse(key, "must be a list of " + std::to_string(min_size) + " to " + std::to_string(max_size) +
                    " numbers " + range(unit, min, max));
  }
  std::vector<double> values;
  values.reserve(list.size());
  for (const YAML::Node& value : list) values.push_back(parseNumber(value, key, unit, min, max));
  return values;
}

std::vector<std::string> Node::texts(const std::string& key, std::size_t min_size,
                                     std::size_t max_size) {
  const YAML::Node list = take(key);
  record(key, "", "texts", list);
  const std::string wanted =
      "must be a list of " + std::to_string(min_size) + " to " + std::to_string(max_size) + " texts";
  if (!list.IsSequence() || list.size() < min_size || list.size() > max_size) refuse(key, wanted);
  std::vector<std::string> values;
  for (const YAML::Node& value : list) {
    if (!value.IsScalar() || value.Scalar().empty()) refuse(key, wanted);
    values.push_back(value.Scalar());
  }
  return values;
}

Node Node::child(const std::string& key) { return Node(take(key), *this, name(key)); }

std::vector<Node> Node::children(const std::string& key) {
  const YAML::Node list = take(key);
  if (!list.IsSequence()) refuse(key, "must be a list");
  std::vector<Node> nodes;
  for (std::size_t i = 0; i < list.size(); ++i) {
    nodes.push_back(Node(list[i], *this, name(key) + "[" + std::to_string(i) + "]"));
  }
  return nodes;
}

void Node::finish() const {
  for (const auto& entry : yaml_) {
    const std::string key = keyOf(entry.first);
    if (read_.count(key) == 0) refuse(key, "is unknown");
  }
}

Node parseText(const std::string& text, const std::string& source) {
  try {
    if (hasTwoDocuments(text)) throw ConfigError(source + ": must be one YAML document");
    return Node(YAML::Load(text), source);
  } catch (const YAML::Exception& e) {
    throw ConfigError(oneLine(source + ": is not YAML: " + e.what()));
  }
}

Node loadFile(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) throw ConfigError(file + ": is not a file");
  if (std::filesystem::file_size(file, error) > kMaxFileBytes) {
    throw ConfigError(file + ": is larger than 4 MiB");
  }
  std::ifstream stream(file);
  if (!stream) throw ConfigError(file + ": cannot be opened");
  return parseText({std::istreambuf_iterator<char>(stream), {}}, file);
}

}  // namespace tunnel_pilot::config
