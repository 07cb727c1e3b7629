// Counts calls of operator new in a program of its own.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "tunnel_pilot/neural/adam.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/inference.h"

namespace {
long g_allocations = 0;
}  // namespace

void* operator new(std::size_t size) {
  ++g_allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  ++g_allocations;
  const auto to = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(to, (size + to - 1) / to * to)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }

namespace tunnel_pilot::neural {
namespace {

Network someNetwork() {
  Network network({Layer::convolution(1, 100, 6, 7, 3, 1, Activation::kRelu),
                   Layer::dense(193, 5, Activation::kTanh), Layer::dense(5, 31, Activation::kSigmoid)});
  network.randomise(1);
  return network;
}

TEST(NeuralAllocation, InferenceAndDecodingAllocateNothing) {
  const Network network = someNetwork();
  const long at_start = g_allocations;
  Inference inference(network);
  EXPECT_GT(g_allocations, at_start);  // the counter counts
  const GaussianCode code(31, -45.0, 3.0, 5.0);
  const std::vector<float> input(network.inputs(), 0.5F);
  std::vector<float> output(network.outputs());
  const long before = g_allocations;
  for (int i = 0; i < 10; ++i) {
    inference.run(input.data(), output.data());
    code.decode(output.data());
  }
  EXPECT_EQ(g_allocations, before);
}

TEST(NeuralAllocation, TrainingStepsAllocateNothing) {
  Network network = someNetwork();
  BatchPass pass(network);
  Adam adam(network.parameters().size(), {});
  std::vector<double> gradient(network.parameters().size());
  const long before = g_allocations;
  for (int i = 0; i < 10; ++i) {
    pass.forward();
    pass.backward(gradient, true);
    adam.step(network.parameters(), gradient);
  }
  EXPECT_EQ(g_allocations, before);
}

}  // namespace
}  // namespace tunnel_pilot::neural
