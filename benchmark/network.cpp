// One input through the lidar network 762-5-31 of sigmoid layers: our Inference beside Eigen, OpenBLAS
// and onnxruntime, warm (the same again and again) and with cold caches (other work in between, as
// between two scans of a driving truck). A wider network is told beside it.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "harness.h"
#include "network_peers.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/inference.h"

namespace {

using namespace tunnel_pilot;
using benchmark::NetworkPeer;
using neural::Activation;
using neural::Layer;
using neural::Network;

constexpr std::size_t kInputs = 762;
constexpr std::size_t kOutputs = 31;

class Ours : public NetworkPeer {
 public:
  explicit Ours(const Network& network) : inference_(network) {}
  void run(const float* input, float* output) override { inference_.run(input, output); }

 private:
  neural::Inference inference_;
};

struct Entrant {
  std::string name;
  std::unique_ptr<NetworkPeer> peer;
};

Network sigmoidNetwork(std::size_t hidden) {
  Network network({Layer::dense(kInputs, hidden, Activation::kSigmoid),
                   Layer::dense(hidden, kOutputs, Activation::kSigmoid)});
  network.randomise(1);
  for (double& p : network.parameters()) p = static_cast<double>(static_cast<float>(p));
  return network;
}

std::vector<float> someInput() {
  std::vector<float> input(kInputs);
  for (std::size_t i = 0; i < kInputs; ++i) {
    input[i] = 0.5F + 0.4F * std::sin(0.02F * static_cast<float>(i));
  }
  return input;
}

double errorOf(NetworkPeer& peer, const Network& network, const std::vector<float>& input) {
  neural::BatchPass exact(network);
  for (std::size_t i = 0; i < input.size(); ++i) exact.input(i)[0] = static_cast<double>(input[i]);
  exact.forward();
  std::vector<float> output(network.outputs());
  peer.run(input.data(), output.data());
  double largest = 0.0;
  for (std::size_t i = 0; i < output.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(output[i]) - exact.output(i)[0]));
  }
  return largest;
}

// The one that is named, or that of the unpacked wheel in the build's folder; empty when there is none.
std::string onnxLibrary() {
  const char* const named = std::getenv("ONNXRUNTIME_LIBRARY");
  if (named != nullptr) return named;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(ONNXRUNTIME_FOLDER, none)) {
    if (entry.path().filename().string().rfind("libonnxruntime.so", 0) == 0)
      return entry.path().string();
  }
  return "";
}

std::vector<Entrant> entrants(const Network& network, const std::string& size, bool fixed) {
  std::vector<Entrant> all;
  all.push_back({"ours" + size, std::make_unique<Ours>(network)});
  if (fixed) all.push_back({"Eigen, fixed sizes" + size, benchmark::eigenFixed(network)});
  all.push_back({"Eigen" + size, benchmark::eigenDynamic(network)});
  all.push_back({"OpenBLAS" + size, benchmark::openBlas(network)});
  all.push_back({"onnxruntime" + size, benchmark::onnxRuntime(network, onnxLibrary())});
  return all;
}

volatile unsigned g_sink = 0;

// Reads and writes more memory than any cache holds.
void emptyCaches() {
  static std::vector<unsigned> memory(std::size_t{96} << 18U, 1U);  // 96 MiB
  unsigned sum = 0;
  for (std::size_t i = 0; i < memory.size(); i += 16) sum += ++memory[i];
  g_sink = sum;
}

// Median time of the first pass after other work, by turns [us].
std::vector<double> coldTimes(const std::vector<Entrant*>& all, const std::vector<float>& input) {
  constexpr std::size_t kTurns = 41;
  std::vector<std::vector<double>> times(all.size());
  std::vector<float> output(kOutputs);
  for (std::size_t turn = 0; turn < kTurns; ++turn) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      emptyCaches();
      const auto start = std::chrono::steady_clock::now();
      all[i]->peer->run(input.data(), output.data());
      const std::chrono::duration<double, std::micro> taken = std::chrono::steady_clock::now() - start;
      times[i].push_back(taken.count());
    }
  }
  std::vector<double> medians;
  for (std::vector<double>& t : times) {
    std::nth_element(t.begin(), t.begin() + kTurns / 2, t.end());
    medians.push_back(t[kTurns / 2]);
  }
  return medians;
}

}  // namespace

int main(int argc, char** argv) {
  const Network paper = sigmoidNetwork(5);
  const Network wide = sigmoidNetwork(32);
  const std::vector<float> input = someInput();
  std::vector<float> output(kOutputs);
  benchmark::Contest contest("network 762-5-31", argc, argv);
  std::vector<Entrant> all = entrants(paper, "", true);
  for (Entrant& entrant : entrants(wide, ", 762-32-31", false)) all.push_back(std::move(entrant));
  std::vector<Entrant*> present;
  for (Entrant& entrant : all) {
    if (entrant.peer == nullptr) {
      contest.missing(entrant.name);
      continue;
    }
    present.push_back(&entrant);
    contest.add(entrant.name, [&] { entrant.peer->run(input.data(), output.data()); });
  }
  if (!contest.run()) return 0;

  const auto has = [&](const std::string& name) {
    return std::any_of(present.begin(), present.end(),
                       [&](const Entrant* e) { return e->name == name; });
  };
  for (const std::string name : {"Eigen, fixed sizes", "Eigen", "OpenBLAS"}) {
    if (has(name)) contest.requireFaster(name, "ours", 1.3);
  }
  if (has("onnxruntime")) contest.requireFaster("onnxruntime", "ours", 15.0);
  for (const std::string name : {"Eigen", "OpenBLAS", "onnxruntime"}) {
    const std::string size = ", 762-32-31";
    if (has(name + size)) contest.tell(name + size, "ours" + size);
  }
  contest.requireAtMost("error against double precision", "1", errorOf(*all[0].peer, paper, input),
                        1e-6);

  std::vector<Entrant*> small;
  for (Entrant* entrant : present) {
    if (entrant->name.find("762") == std::string::npos) small.push_back(entrant);
  }
  const std::vector<double> cold = coldTimes(small, input);
  for (std::size_t i = 0; i < small.size(); ++i) {
    std::printf("cold caches: %s %.2f us, error %.2g\n", small[i]->name.c_str(), cold[i],
                errorOf(*small[i]->peer, paper, input));
    if (small[i]->name != "onnxruntime") continue;
    contest.requireAtLeast("cold caches: onnxruntime's time in ours", "1", cold[i] / cold[0], 10.0);
  }
  return contest.finish();
}
