#pragma once

#include <memory>
#include <string>

#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::benchmark {

/// A way to run a network of sigmoid layers, one input at a time, on one thread.
class NetworkPeer {
 public:
  virtual ~NetworkPeer() = default;
  virtual void run(const float* input, float* output) = 0;
};

/// Matrices of compile-time sizes for 762-5-31, row-major, with Eigen's own vectorised exponential.
std::unique_ptr<NetworkPeer> eigenFixed(const neural::Network& network);
/// Matrices of any sizes, row-major.
std::unique_ptr<NetworkPeer> eigenDynamic(const neural::Network& network);
/// cblas_sgemv, with Eigen's exponential. None when the build has no OpenBLAS.
std::unique_ptr<NetworkPeer> openBlas(const neural::Network& network);
/// onnxruntime's C API with all its optimisations. None when `library` (libonnxruntime.so) cannot be
/// loaded.
std::unique_ptr<NetworkPeer> onnxRuntime(const neural::Network& network, const std::string& library);

}  // namespace tunnel_pilot::benchmark
