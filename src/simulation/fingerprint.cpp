#include "tunnel_pilot/simulation/fingerprint.h"

#include <fstream>
#include <sstream>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/config/sha256.h"

namespace tunnel_pilot::simulation {

std::string sha256OfFiles(const std::vector<std::string>& files) {
  std::ostringstream content;
  for (const std::string& file : files) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw config::ConfigError(file + ": cannot be read");
    content << in.rdbuf();
  }
  return config::sha256(content.str());
}

}  // namespace tunnel_pilot::simulation
