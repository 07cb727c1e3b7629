#pragma once

#include <cstddef>
#include <fstream>
#include <string>

#include "tunnel_pilot/config/sha256.h"
#include "tunnel_pilot/learning/data_set.h"

namespace tunnel_pilot::learning {

/// A data set as a file: one line of JSON that tells what follows, then the examples, one behind the
/// other, in 32-bit words, least significant byte first. The line's version and fields must be those of
/// this code; SHA-256 is of the examples' bytes. docs/learning.md shows one.
///
/// Reads the whole file or nothing. Throws config::ConfigError that names the file and what is wrong
/// with it: size and hash are checked before an example is believed, and every number: ranges are as
/// REP-117 has them (NaN no measurement, +infinity no return, never negative), all others finite.
DataSet readDataSet(const std::string& file);

/// Writes a data set example by example, with no more memory than one of them. The file appears under
/// its name when it is complete; until then it is called `<file>.part`, which goes with a writer that
/// was not finished. Throws config::ConfigError when it cannot be written, and for examples that
/// readDataSet would refuse.
class DataWriter {
 public:
  explicit DataWriter(const std::string& file);
  ~DataWriter();
  DataWriter(const DataWriter&) = delete;
  DataWriter& operator=(const DataWriter&) = delete;

  void add(const Example& example);
  void finish();

  std::size_t examples() const { return examples_; }

 private:
  void check();

  std::string file_;
  std::string part_;
  std::ofstream out_;
  config::Sha256 hash_;
  std::size_t examples_ = 0;
  bool finished_ = false;
};

void writeDataSet(const std::string& file, const DataSet& examples);

}  // namespace tunnel_pilot::learning
