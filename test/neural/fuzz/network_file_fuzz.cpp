// Fuzz target of the network file's reader (libFuzzer); scripts/fuzz builds and runs it. Every input is
// read as it is, which only a signed file passes, and with a hash that suits it, which leads behind.
#include <cstdint>
#include <string>

#include "../small_network.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/neural/inference.h"

namespace {

using namespace tunnel_pilot;

void read(const std::string& text) {
  try {
    const neural::NetworkFile file = neural::parseNetwork(text, "fuzz");
    neural::Inference inference(file.network);
    const std::vector<float> input(file.network.inputs(), 0.5F);
    std::vector<float> output(file.network.outputs());
    inference.run(input.data(), output.data());
  } catch (const config::ConfigError&) {
    // Refused: as it should be.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  read(text);
  read(neural::resigned(text));
  return 0;
}
