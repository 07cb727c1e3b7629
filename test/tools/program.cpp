#include "program.h"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace tunnel_pilot {

Outcome runProgram(const std::string& program, const std::vector<std::string>& arguments) {
  std::string command = "'" + program + "'";
  for (const std::string& argument : arguments) command += " '" + argument + "'";
  Outcome outcome;
  FILE* pipe = popen((command + " 2>&1 < /dev/null").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer;
  std::size_t count = 0;
  while ((count = fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
    outcome.output.append(buffer.data(), count);
  }
  const int state = pclose(pipe);
  // A shell tells a program's death by a signal as status 128 + signal.
  const int status = WIFEXITED(state) ? WEXITSTATUS(state) : -1;
  outcome.signal = WIFSIGNALED(state) ? WTERMSIG(state) : status > 128 ? status - 128 : 0;
  outcome.status = outcome.signal == 0 ? status : -1;
  return outcome;
}

std::string contentOf(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::map<std::string, std::string> contentsBelow(const std::filesystem::path& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    contents[std::filesystem::relative(entry.path(), folder).string()] = contentOf(entry.path());
  }
  return contents;
}

Workplace::Workplace() {
  std::string name = (std::filesystem::temp_directory_path() / "tools_test_XXXXXX").string();
  folder_ = mkdtemp(name.data());
}

Workplace::~Workplace() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

}  // namespace tunnel_pilot
