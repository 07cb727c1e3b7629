// onnxruntime for the network benchmark. Its wheel brings the library but no header, so that the library
// is loaded at run time, and its functions are taken from the table that OrtGetApiBase gives: by their
// places, which its makers promise never to change.
#include <dlfcn.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "network_peers.h"

namespace tunnel_pilot::benchmark {
namespace {

using neural::Layer;
using neural::Network;

// --- the model, as a protocol buffer (onnx.proto)

class Message {
 public:
  void number(int field, std::uint64_t value) {
    varint(static_cast<std::uint64_t>(field) << 3U);
    varint(value);
  }
  void bytes(int field, const std::string& value) {
    varint(static_cast<std::uint64_t>(field) << 3U | 2U);
    varint(value.size());
    text_ += value;
  }
  const std::string& text() const { return text_; }

 private:
  void varint(std::uint64_t value) {
    for (; value >= 0x80U; value >>= 7U) text_ += static_cast<char>(value | 0x80U);
    text_ += static_cast<char>(value);
  }
  std::string text_;
};

std::string tensor(const std::string& name, const std::vector<std::uint64_t>& sizes,
                   const std::vector<float>& values) {
  Message message;
  for (const std::uint64_t size : sizes) message.number(1, size);
  message.number(2, 1);  // float
  message.bytes(8, name);
  message.bytes(9, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)});
  return message.text();
}

std::string node(const std::string& operation, const std::vector<std::string>& inputs,
                 const std::string& output) {
  Message message;
  for (const std::string& input : inputs) message.bytes(1, input);
  message.bytes(2, output);
  message.bytes(4, operation);
  return message.text();
}

std::string valueInfo(const std::string& name, std::uint64_t size) {
  Message shape;
  for (const std::uint64_t length : {std::uint64_t{1}, size}) {
    Message dimension;
    dimension.number(1, length);
    shape.bytes(1, dimension.text());
  }
  Message tensor_type;
  tensor_type.number(1, 1);  // float
  tensor_type.bytes(2, shape.text());
  Message type;
  type.bytes(1, tensor_type.text());
  Message message;
  message.bytes(1, name);
  message.bytes(2, type.text());
  return message.text();
}

// y = sigmoid(x W + b), layer after layer.
std::string modelOf(const Network& network) {
  Message graph;
  std::string x = "x";
  const double* p = network.parameters().data();
  for (std::size_t i = 0; i < network.layers().size(); ++i) {
    const Layer& layer = network.layers()[i];
    const std::string n = std::to_string(i);
    const std::string y = i + 1 == network.layers().size() ? "y" : "y" + n;
    std::vector<float> weights(layer.weights());
    for (std::size_t r = 0; r < layer.channels_out; ++r) {
      for (std::size_t k = 0; k < layer.length_in; ++k) {
        weights[k * layer.channels_out + r] = static_cast<float>(p[r * layer.length_in + k]);
      }
    }
    const double* b = p + layer.weights();
    graph.bytes(1, node("Gemm", {x, "w" + n, "b" + n}, "s" + n));
    graph.bytes(1, node("Sigmoid", {"s" + n}, y));
    graph.bytes(5, tensor("w" + n, {layer.length_in, layer.channels_out}, weights));
    graph.bytes(5, tensor("b" + n, {layer.channels_out}, {b, b + layer.channels_out}));
    x = y;
    p += layer.parameters();
  }
  graph.bytes(2, "network");
  graph.bytes(11, valueInfo("x", network.inputs()));
  graph.bytes(12, valueInfo("y", network.outputs()));
  Message operators;
  operators.number(2, 13);
  Message model;
  model.number(1, 8);
  model.bytes(7, graph.text());
  model.bytes(8, operators.text());
  return model.text();
}

// --- the library

using Handle = void*;
using Status = void*;

// Places of the functions in the table.
enum Place : std::size_t {
  kGetErrorMessage = 2,
  kCreateEnv = 3,
  kCreateSessionFromArray = 8,
  kRun = 9,
  kCreateSessionOptions = 10,
  kSetGraphOptimization = 23,
  kSetIntraOpThreads = 24,
  kCreateTensorWithData = 49,
  kCreateCpuMemoryInfo = 69
};

class OnnxRuntime : public NetworkPeer {
 public:
  OnnxRuntime(const Network& network, const void* const* table)
      : table_(table), input_(network.inputs()), output_(network.outputs()) {
    const std::string model = modelOf(network);
    Handle environment = nullptr;
    Handle options = nullptr;
    Handle session = nullptr;
    check(function<Status(int, const char*, Handle*)>(kCreateEnv)(3, "benchmark", &environment));
    check(function<Status(Handle*)>(kCreateSessionOptions)(&options));
    check(function<Status(Handle, int)>(kSetGraphOptimization)(options, 99));  // all
    check(function<Status(Handle, int)>(kSetIntraOpThreads)(options, 1));
    check(function<Status(Handle, const void*, std::size_t, Handle, Handle*)>(kCreateSessionFromArray)(
        environment, model.data(), model.size(), options, &session));
    session_ = session;
    Handle memory = nullptr;
    check(function<Status(int, int, Handle*)>(kCreateCpuMemoryInfo)(0, 0, &memory));
    input_value_ = wrap(memory, input_);
    output_value_ = wrap(memory, output_);
    run_ = function<RunFunction>(kRun);
  }

  // Tensors over memory of ours, made once: the quickest way that the interface has.
  void run(const float* input, float* output) override {
    std::memcpy(input_.data(), input, input_.size() * sizeof(float));
    static const std::array<const char*, 1> kIn = {"x"};
    static const std::array<const char*, 1> kOut = {"y"};
    check(run_(session_, nullptr, kIn.data(), &input_value_, 1, kOut.data(), 1, &output_value_));
    std::memcpy(output, output_.data(), output_.size() * sizeof(float));
  }

 private:
  using RunFunction = Status(Handle, Handle, const char* const*, const Handle*, std::size_t,
                             const char* const*, std::size_t, Handle*);

  template <typename Signature>
  Signature* function(Place place) const {
    Signature* result = nullptr;
    std::memcpy(&result, &table_[place], sizeof result);
    return result;
  }
  void check(Status status) const {
    if (status == nullptr) return;
    throw std::runtime_error(std::string("onnxruntime: ") +
                             function<const char*(Status)>(kGetErrorMessage)(status));
  }
  Handle wrap(Handle memory, std::vector<float>& values) const {
    const std::array<std::int64_t, 2> shape = {1, static_cast<std::int64_t>(values.size())};
    Handle value = nullptr;
    check(function<Status(Handle, void*, std::size_t, const std::int64_t*, std::size_t, int, Handle*)>(
        kCreateTensorWithData)(memory, values.data(), values.size() * sizeof(float), shape.data(),
                               shape.size(), 1, &value));
    return value;
  }

  const void* const* table_;
  std::vector<float> input_;
  std::vector<float> output_;
  Handle session_ = nullptr;
  Handle input_value_ = nullptr;
  Handle output_value_ = nullptr;
  RunFunction* run_ = nullptr;
};

struct ApiBase {
  const void* const* (*table)(std::uint32_t version);
  const char* (*version)();
};

}  // namespace

std::unique_ptr<NetworkPeer> onnxRuntime(const Network& network, const std::string& library) {
  // Never closed: its threads and its memory end with the program.
  void* const loaded = library.empty() ? nullptr : dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const symbol = loaded == nullptr ? nullptr : dlsym(loaded, "OrtGetApiBase");
  if (symbol == nullptr) return nullptr;
  const ApiBase* (*base)() = nullptr;
  std::memcpy(&base, &symbol, sizeof base);
  return std::make_unique<OnnxRuntime>(network, base()->table(1));
}

}  // namespace tunnel_pilot::benchmark
