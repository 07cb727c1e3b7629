// Eigen and OpenBLAS for the network benchmark. This file alone is compiled for the very machine it runs
// on: Eigen has no choice of instructions at run time, and shall not lose for that.
#include <Eigen/Core>
#include <vector>

#include "network_peers.h"

#ifdef HAVE_OPENBLAS
#include <cblas.h>
#endif

namespace tunnel_pilot::benchmark {
namespace {

using neural::Layer;
using neural::Network;
using Weights = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <typename Vector>
void sigmoid(Vector& v) {
  v = (1.0F + (-v.array()).exp()).inverse().matrix();
}

struct Dense {
  Weights weights;
  Eigen::VectorXf bias;
};

std::vector<Dense> denseLayers(const Network& network) {
  std::vector<Dense> layers;
  const double* p = network.parameters().data();
  for (const Layer& layer : network.layers()) {
    const auto outputs = static_cast<Eigen::Index>(layer.channels_out);
    const auto inputs = static_cast<Eigen::Index>(layer.length_in);
    using Doubles = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    layers.push_back({Eigen::Map<const Doubles>(p, outputs, inputs).cast<float>(),
                      Eigen::Map<const Eigen::VectorXd>(p + layer.weights(), outputs).cast<float>()});
    p += layer.parameters();
  }
  return layers;
}

class EigenDynamic : public NetworkPeer {
 public:
  explicit EigenDynamic(const Network& network) : layers_(denseLayers(network)) {
    for (const Dense& layer : layers_) values_.emplace_back(layer.bias.size());
  }
  void run(const float* input, float* output) override {
    Eigen::Map<const Eigen::VectorXf> x(input, layers_.front().weights.cols());
    for (std::size_t i = 0; i < layers_.size(); ++i) {
      values_[i] = layers_[i].bias;
      if (i == 0) {
        values_[i].noalias() += layers_[i].weights * x;
      } else {
        values_[i].noalias() += layers_[i].weights * values_[i - 1];
      }
      sigmoid(values_[i]);
    }
    Eigen::Map<Eigen::VectorXf>(output, values_.back().size()) = values_.back();
  }

 private:
  std::vector<Dense> layers_;
  std::vector<Eigen::VectorXf> values_;
};

class EigenFixed : public NetworkPeer {
 public:
  explicit EigenFixed(const Network& network) {
    const std::vector<Dense> layers = denseLayers(network);
    w1_ = layers[0].weights;
    b1_ = layers[0].bias;
    w2_ = layers[1].weights;
    b2_ = layers[1].bias;
  }
  void run(const float* input, float* output) override {
    Eigen::Map<const Eigen::Matrix<float, 762, 1>> x(input);
    Eigen::Matrix<float, 5, 1> h = b1_;
    h.noalias() += w1_ * x;
    sigmoid(h);
    Eigen::Matrix<float, 31, 1> y = b2_;
    y.noalias() += w2_ * h;
    sigmoid(y);
    Eigen::Map<Eigen::Matrix<float, 31, 1>>{output} = y;
  }
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW

 private:
  Eigen::Matrix<float, 5, 762, Eigen::RowMajor> w1_;
  Eigen::Matrix<float, 5, 1> b1_;
  Eigen::Matrix<float, 31, 5> w2_;
  Eigen::Matrix<float, 31, 1> b2_;
};

#ifdef HAVE_OPENBLAS
class OpenBlas : public NetworkPeer {
 public:
  explicit OpenBlas(const Network& network) : layers_(denseLayers(network)) {
    openblas_set_num_threads(1);
    for (const Dense& layer : layers_) values_.emplace_back(layer.bias.size());
  }
  void run(const float* input, float* output) override {
    const float* x = input;
    for (std::size_t i = 0; i < layers_.size(); ++i) {
      const Dense& layer = layers_[i];
      const auto columns = static_cast<int>(layer.weights.cols());
      values_[i] = layer.bias;
      cblas_sgemv(CblasRowMajor, CblasNoTrans, static_cast<int>(layer.weights.rows()), columns, 1.0F,
                  layer.weights.data(), columns, x, 1, 1.0F, values_[i].data(), 1);
      sigmoid(values_[i]);
      x = values_[i].data();
    }
    Eigen::Map<Eigen::VectorXf>(output, values_.back().size()) = values_.back();
  }

 private:
  std::vector<Dense> layers_;
  std::vector<Eigen::VectorXf> values_;
};
#endif

}  // namespace

std::unique_ptr<NetworkPeer> eigenFixed(const Network& network) {
  return std::make_unique<EigenFixed>(network);
}

std::unique_ptr<NetworkPeer> eigenDynamic(const Network& network) {
  return std::make_unique<EigenDynamic>(network);
}

std::unique_ptr<NetworkPeer> openBlas([[maybe_unused]] const Network& network) {
#ifdef HAVE_OPENBLAS
  return std::make_unique<OpenBlas>(network);
#else
  return nullptr;
#endif
}

}  // namespace tunnel_pilot::benchmark
