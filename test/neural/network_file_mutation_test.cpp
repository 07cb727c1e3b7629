// Damaged network files: none may crash the reader, and none that was not signed anew be accepted. The
// same properties as test/neural/fuzz/network_file_fuzz.cpp, over a fixed set of damages.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "small_network.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/neural/inference.h"

namespace tunnel_pilot::neural {
namespace {

const char* const kWords[] = {"[",
                              "{",
                              "]",
                              "}",
                              "&a ",
                              "*a",
                              "!!binary ",
                              "---\n",
                              "...\n",
                              "? ",
                              ": ",
                              "- ",
                              "|\n",
                              ">\n",
                              "\"",
                              "'",
                              "#",
                              "%",
                              "\n",
                              "\t",
                              " ",
                              "nan",
                              "inf",
                              "-1",
                              "0",
                              "1e400",
                              "99999999999999999999",
                              "0x",
                              "<<: *a",
                              "~",
                              "\xFF",
                              "parameters: |\n",
                              "layers:\n",
                              "sha256: ",
                              "dense",
                              "convolution"};

class Damager {
 public:
  explicit Damager(std::uint64_t seed) : random_(seed) {}

  std::string damage(std::string text) {
    const std::size_t times = 1 + below(3);
    for (std::size_t i = 0; i < times; ++i) once(text);
    return text;
  }

 private:
  std::size_t below(std::size_t limit) { return static_cast<std::size_t>(random_() % limit); }
  void once(std::string& text) {
    const std::size_t at = below(text.size());
    const std::size_t length = 1 + below(std::min<std::size_t>(text.size() - at, 40));
    switch (below(6)) {
      case 0:
        text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
        break;
      case 1:
        text[at] = static_cast<char>(below(256));
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        text.insert(at, text.substr(below(text.size()), length));
        break;
      case 4:
        text.insert(at, kWords[below(std::size(kWords))]);
        break;
      default:
        text.replace(at, length, kWords[below(std::size(kWords))]);
    }
    if (text.empty()) text = "x";
  }

  std::mt19937_64 random_;
};

// Whether it was accepted; anything but a ConfigError passes through and fails the test.
bool accepted(const std::string& text) {
  try {
    const NetworkFile file = parseNetwork(text, "file");
    Inference inference(file.network);
    std::vector<float> input(file.network.inputs(), 0.5F);
    std::vector<float> output(file.network.outputs());
    inference.run(input.data(), output.data());
    return true;
  } catch (const config::ConfigError&) {
    return false;
  }
}

TEST(NetworkFileMutation, NoDamagedFileIsAccepted) {
  const std::string good = textOf(smallNetwork());
  Damager damager(1);
  for (int i = 0; i < 5000; ++i) {
    const std::string text = damager.damage(good);
    ASSERT_TRUE(text == good || !accepted(text)) << i << "\n" << text;
  }
}

TEST(NetworkFileMutation, NoDamageThatWasSignedAnewCrashesTheReader) {
  const std::string good = textOf(smallNetwork());
  Damager damager(2);
  int refused = 0;
  for (int i = 0; i < 5000; ++i) {
    if (!accepted(resigned(damager.damage(good)))) ++refused;
  }
  // Damage in free text, spaces and last digits may pass; most must not.
  EXPECT_GT(refused, 3500);
}

}  // namespace
}  // namespace tunnel_pilot::neural
