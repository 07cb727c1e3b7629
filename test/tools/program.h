#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tunnel_pilot {

/// What running a program gave.
struct Outcome {
  int status = -1;     ///< exit status, or -1
  int signal = 0;      ///< that ended it, 0 for none
  std::string output;  ///< both streams
};

/// Runs a program with arguments and waits for it.
Outcome runProgram(const std::string& program, const std::vector<std::string>& arguments);

std::string contentOf(const std::filesystem::path& file);

/// Contents by path, below a folder.
std::map<std::string, std::string> contentsBelow(const std::filesystem::path& folder);

/// A folder of its own that goes when the test ends.
class Workplace {
 public:
  Workplace();
  ~Workplace();
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

 private:
  std::filesystem::path folder_;
};

}  // namespace tunnel_pilot
