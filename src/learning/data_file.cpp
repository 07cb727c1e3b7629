#include "tunnel_pilot/learning/data_file.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::learning {
namespace {

using config::ConfigError;

constexpr const char* kFormat = "tunnel_pilot_data_set";
constexpr std::int64_t kVersion = 2;
constexpr std::size_t kBeams = drivers::LidarInputs::kBeams;
constexpr std::size_t kMaxHeader = 4096;  // [bytes]
// No header is deeper than a map of a list of maps: deeper nesting would only fill the parser's stack.
constexpr int kMaxDepth = 4;

// The numbers beside the ranges, in their order in a record.
struct Field {
  const char* name;
  const char* unit;
  float Example::*member;
};
constexpr std::array<Field, 7> kFields = {{
    {"articulation", "rad", &Example::articulation},
    {"articulation_ahead", "rad", &Example::articulation_ahead},
    {"speed", "m/s", &Example::speed},
    {"yaw_gain", "1", &Example::yaw_gain},
    {"yaw_disturbance", "1/m", &Example::yaw_disturbance},
    {"steering_rate", "rad/s", &Example::steering_rate},
    {"label", "rad", &Example::label},
}};
constexpr std::size_t kWords = kBeams + kFields.size() + 1;
using Record = std::array<unsigned char, 4 * kWords>;

void putWord(std::uint32_t word, unsigned char* bytes) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<unsigned char>(word >> (8 * i) & 0xFF);
}

std::uint32_t wordOf(const unsigned char* bytes) {
  return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 |
         std::uint32_t{bytes[3]} << 24;
}

void putFloat(float value, unsigned char* bytes) {
  std::uint32_t word;
  std::memcpy(&word, &value, sizeof word);
  putWord(word, bytes);
}

float floatOf(const unsigned char* bytes) {
  const std::uint32_t word = wordOf(bytes);
  float value;
  std::memcpy(&value, &word, sizeof value);
  return value;
}

// What is wrong with an example; empty: nothing.
std::string faultOf(const Example& example) {
  if (example.ranges.size() != kBeams) {
    return "has " + std::to_string(example.ranges.size()) + " ranges, not " + std::to_string(kBeams);
  }
  for (const float range : example.ranges) {
    if (range < 0.0F) return "has a negative range [m]";
  }
  for (const Field& field : kFields) {
    if (!std::isfinite(example.*field.member)) {
      return std::string("has no finite '") + field.name + "' [" + field.unit + "]";
    }
  }
  return "";
}

void encode(const Example& example, Record& record) {
  unsigned char* at = record.data();
  for (const float range : example.ranges) putFloat(range, at), at += 4;
  for (const Field& field : kFields) putFloat(example.*field.member, at), at += 4;
  putWord(example.tunnel, at);
}

Example decode(const Record& record) {
  Example example;
  example.ranges.resize(kBeams);
  const unsigned char* at = record.data();
  for (float& range : example.ranges) range = floatOf(at), at += 4;
  for (const Field& field : kFields) example.*field.member = floatOf(at), at += 4;
  example.tunnel = wordOf(at);
  return example;
}

std::string fieldText(const std::string& name, const std::string& unit, std::size_t count,
                      const std::string& type) {
  return "{\"name\": \"" + name + "\", \"unit\": \"" + unit + "\", \"count\": " + std::to_string(count) +
         ", \"type\": \"" + type + "\"}";
}

// Always of the same length, so that it can be written again once number and hash are known.
std::string headerText(std::size_t examples, const std::string& hash) {
  std::string text = std::string("{\"format\": \"") + kFormat +
                     "\", \"version\": " + std::to_string(kVersion) + ", \"fields\": [";
  text += fieldText("ranges", "m", kBeams, "float32") + ", ";
  for (const Field& field : kFields) text += fieldText(field.name, field.unit, 1, "float32") + ", ";
  text += fieldText("tunnel", "1", 1, "uint32") + "], ";
  char count[24];
  std::snprintf(count, sizeof count, "%20zu", examples);
  return text + "\"examples\": " + count + ", \"sha256\": \"" + hash + "\"}\n";
}

struct Header {
  std::size_t examples;
  std::string hash;
};

void expectField(config::Node field, const std::string& name, const std::string& unit, std::size_t count,
                 const std::string& type) {
  field.choice("name", {name});
  field.choice("unit", {unit});
  field.integer("count", "1", static_cast<std::int64_t>(count), static_cast<std::int64_t>(count));
  field.choice("type", {type});
  field.finish();
}

void expectFields(std::vector<config::Node> fields, const config::Node& node) {
  if (fields.size() != kFields.size() + 2) {
    node.refuse("fields", "must be " + std::to_string(kFields.size() + 2) + " fields");
  }
  expectField(fields.front(), "ranges", "m", kBeams, "float32");
  for (std::size_t i = 0; i < kFields.size(); ++i) {
    expectField(fields[i + 1], kFields[i].name, kFields[i].unit, 1, "float32");
  }
  expectField(fields.back(), "tunnel", "1", 1, "uint32");
}

bool nestedTooDeep(const std::string& text) {
  int depth = 0;
  for (const char c : text) {
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (depth > kMaxDepth) return true;
  }
  return false;
}

Header parseHeader(const std::string& line, const std::string& file) {
  YAML::Node yaml;
  try {
    if (line.front() != '{' || nestedTooDeep(line)) throw ConfigError("no JSON map");
    yaml = YAML::Load(line);
  } catch (const std::exception&) {
    throw ConfigError(file + ": not a data set: it does not begin with a line of JSON");
  }
  config::Node node(yaml, file);
  node.choice("format", {kFormat});
  node.integer("version", "1", kVersion, kVersion);
  expectFields(node.children("fields"), node);
  Header header;
  header.examples = static_cast<std::size_t>(node.integer("examples", "1", 0, std::int64_t{1} << 40));
  header.hash = node.text("sha256");
  node.finish();
  return header;
}

std::string readHeaderLine(std::ifstream& in, const std::string& file) {
  std::string line;
  for (char c = 0; in.get(c) && c != '\n';) {
    line += c;
    if (line.size() > kMaxHeader) break;
  }
  if (!in || line.empty() || line.size() > kMaxHeader) {
    throw ConfigError(file + ": not a data set: it does not begin with a line of JSON");
  }
  return line;
}

std::uintmax_t sizeOf(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) throw ConfigError(file + ": no such file");
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error) throw ConfigError(file + ": " + error.message());
  return size;
}

// The file must be as long as its examples before memory is asked for them.
void checkSize(std::uintmax_t found, std::size_t examples, const std::string& file) {
  const std::uintmax_t wanted = std::uintmax_t{examples} * sizeof(Record);
  if (found == wanted) return;
  throw ConfigError(file + ": " + std::to_string(examples) + " examples are " + std::to_string(wanted) +
                    " bytes, but " + std::to_string(found) + " follow");
}

}  // namespace

DataSet readDataSet(const std::string& file) {
  const std::uintmax_t size = sizeOf(file);
  std::ifstream in(file, std::ios::binary);
  if (!in) throw ConfigError(file + ": cannot be opened");
  const Header header = parseHeader(readHeaderLine(in, file), file);
  checkSize(size - static_cast<std::uintmax_t>(in.tellg()), header.examples, file);
  DataSet examples;
  examples.reserve(header.examples);
  config::Sha256 hash;
  Record record;
  std::string fault;
  for (std::size_t i = 0; i < header.examples; ++i) {
    if (!in.read(reinterpret_cast<char*>(record.data()), record.size())) {
      throw ConfigError(file + ": cannot be read");
    }
    hash.update(record.data(), record.size());
    examples.push_back(decode(record));
    if (!fault.empty()) continue;
    fault = faultOf(examples.back());
    if (!fault.empty()) fault.insert(0, ": example " + std::to_string(i) + " ");
  }
  if (hash.finish() != header.hash) {
    throw ConfigError(file + ": 'sha256' is not that of its examples: the file is damaged");
  }
  if (!fault.empty()) throw ConfigError(file + fault);
  return examples;
}

DataWriter::DataWriter(const std::string& file)
    : file_(file), part_(file + ".part"), out_(part_, std::ios::binary | std::ios::trunc) {
  out_ << headerText(0, std::string(64, '0'));
  check();
}

DataWriter::~DataWriter() {
  if (finished_) return;
  out_.close();
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void DataWriter::check() {
  if (!out_) throw ConfigError("cannot write '" + part_ + "'");
}

void DataWriter::add(const Example& example) {
  const std::string fault = faultOf(example);
  if (!fault.empty()) throw ConfigError(file_ + ": example " + std::to_string(examples_) + " " + fault);
  Record record;
  encode(example, record);
  hash_.update(record.data(), record.size());
  out_.write(reinterpret_cast<const char*>(record.data()), record.size());
  check();
  ++examples_;
}

void DataWriter::finish() {
  out_.seekp(0);
  out_ << headerText(examples_, hash_.finish());
  out_.close();
  check();
  std::error_code error;
  std::filesystem::rename(part_, file_, error);
  if (error) throw ConfigError("cannot write '" + file_ + "': " + error.message());
  finished_ = true;
}

void writeDataSet(const std::string& file, const DataSet& examples) {
  DataWriter writer(file);
  for (const Example& example : examples) writer.add(example);
  writer.finish();
}

}  // namespace tunnel_pilot::learning
