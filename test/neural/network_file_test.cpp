#include "tunnel_pilot/neural/network_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <clocale>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>

#include "small_network.h"
#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::neural {
namespace {

void expectSame(const NetworkFile& a, const NetworkFile& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.training, b.training);
  EXPECT_EQ(a.sha256, b.sha256);
  EXPECT_EQ(a.network.parameters(), b.network.parameters());
  ASSERT_EQ(a.network.layers().size(), b.network.layers().size());
  for (std::size_t i = 0; i < a.network.layers().size(); ++i) {
    const Layer& x = a.network.layers()[i];
    const Layer& y = b.network.layers()[i];
    EXPECT_TRUE(x.kind == y.kind && x.activation == y.activation && x.channels_in == y.channels_in &&
                x.length_in == y.length_in && x.channels_out == y.channels_out && x.kernel == y.kernel &&
                x.stride == y.stride && x.passed == y.passed)
        << i;
  }
  ASSERT_EQ(a.inputs.size(), b.inputs.size());
  for (std::size_t i = 0; i < a.inputs.size(); ++i) {
    const InputGroup& x = a.inputs[i];
    const InputGroup& y = b.inputs[i];
    EXPECT_TRUE(x.meaning == y.meaning && x.unit == y.unit && x.count == y.count &&
                x.transform == y.transform && x.offset == y.offset && x.scale == y.scale &&
                x.min == y.min && x.max == y.max)
        << i;
  }
  EXPECT_TRUE(a.output.meaning == b.output.meaning && a.output.unit == b.output.unit &&
              a.output.code == b.output.code && a.output.offset == b.output.offset &&
              a.output.scale == b.output.scale && a.output.first == b.output.first &&
              a.output.spacing == b.output.spacing && a.output.width == b.output.width);
}

TEST(NetworkFile, ComesBackAsItWasSaved) {
  const Folder folder;
  NetworkFile network = smallNetwork();
  saveNetwork(folder.file("a.yaml"), network);
  const NetworkFile loaded = loadNetwork(folder.file("a.yaml"));
  EXPECT_EQ(loaded.sha256.size(), 64u);
  expectSame(network, loaded);
}

TEST(NetworkFile, ValueOutputsComeBack) {
  const Folder folder;
  NetworkFile network = smallNetwork();
  network.output = {"u", "m/s", OutputGroup::Code::kValue, 0.5, 1.0 / 3.0, 0.0, 0.0, 0.0};
  network.training.clear();
  saveNetwork(folder.file("a.yaml"), network);
  expectSame(network, loadNetwork(folder.file("a.yaml")));
}

TEST(NetworkFile, SavingWhatWasLoadedGivesTheSameBytes) {
  const std::string text = textOf(smallNetwork());
  EXPECT_EQ(textOf(parseNetwork(text, "text")), text);
}

TEST(NetworkFile, KeepsEveryFloatExactly) {
  NetworkFile network = smallNetwork();
  std::vector<double>& p = network.network.parameters();
  for (double& value : p) value = static_cast<double>(static_cast<float>(value));
  p[0] = static_cast<double>(std::nextafter(1000.0F, 0.0F));
  p[1] = static_cast<double>(std::numeric_limits<float>::min());
  p[2] = static_cast<double>(std::numeric_limits<float>::denorm_min());
  p[3] = static_cast<double>(0.1F);
  p[4] = -0.0;
  p[5] = static_cast<double>(std::nextafter(0.5F, 1.0F));
  EXPECT_EQ(parseNetwork(textOf(network), "text").network.parameters(), p);
}

TEST(NetworkFile, ParametersAreRoundedToFloat) {
  const Folder folder;
  NetworkFile network = smallNetwork();
  network.network.parameters()[0] = 0.1;
  saveNetwork(folder.file("a.yaml"), network);
  EXPECT_EQ(network.network.parameters()[0], static_cast<double>(0.1F));
}

TEST(NetworkFile, LinesStayWithinAHundredColumns) {
  std::istringstream lines(textOf(smallNetwork()));
  for (std::string line; std::getline(lines, line);) {
    if (line.find('{') != std::string::npos) continue;
    EXPECT_LE(line.size(), 100u) << line;
  }
}

TEST(NetworkFile, NumbersHaveAPointWhateverTheLocale) {
  const std::string before = textOf(smallNetwork());
  const char* const comma = std::setlocale(LC_ALL, "de_DE.UTF-8");
  if (comma == nullptr) GTEST_SKIP() << "this system has no locale with a decimal comma";
  const std::string with_comma = textOf(smallNetwork());
  std::setlocale(LC_ALL, "C");
  EXPECT_EQ(with_comma, before);
}

TEST(NetworkFile, SavesOverAnOldFileAndLeavesNoOther) {
  const Folder folder;
  NetworkFile network = smallNetwork();
  saveNetwork(folder.file("a.yaml"), network);
  network.name = "second";
  saveNetwork(folder.file("a.yaml"), network);
  EXPECT_EQ(loadNetwork(folder.file("a.yaml")).name, "second");
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(NetworkFile, WhatCannotBeSavedLeavesTheOldFileAndNoOther) {
  const Folder folder;
  NetworkFile network = smallNetwork();
  saveNetwork(folder.file("a.yaml"), network);
  const std::string before = contentOf(folder.file("a.yaml"));
  NetworkFile bad = network;
  bad.network.parameters()[3] = std::nan("");
  EXPECT_THROW(saveNetwork(folder.file("a.yaml"), bad), config::ConfigError);
  bad = network;
  bad.network.parameters()[3] = 1000.0;
  EXPECT_THROW(saveNetwork(folder.file("a.yaml"), bad), config::ConfigError);
  bad = network;
  bad.training = "a tab\tand a bell \a";
  EXPECT_THROW(saveNetwork(folder.file("a.yaml"), bad), config::ConfigError);
  bad = network;
  bad.inputs[0].count = 3;
  EXPECT_THROW(saveNetwork(folder.file("a.yaml"), bad), config::ConfigError);
  bad = network;
  bad.name = "";
  EXPECT_THROW(saveNetwork(folder.file("a.yaml"), bad), config::ConfigError);
  EXPECT_EQ(contentOf(folder.file("a.yaml")), before);
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(NetworkFile, SavingToAFolderOrIntoNoneIsRefused) {
  const Folder folder;
  NetworkFile network = smallNetwork();
  std::filesystem::create_directory(folder.file("a.yaml"));
  EXPECT_THROW(saveNetwork(folder.file("a.yaml"), network), config::ConfigError);
  EXPECT_THROW(saveNetwork(folder.file("none/a.yaml"), network), config::ConfigError);
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(NetworkFile, SixtyThousandParametersLoadInLessThanHalfASecond) {
  const Folder folder;
  Network large({Layer::dense(1900, 32, Activation::kTanh), Layer::dense(32, 5, Activation::kSigmoid)});
  large.randomise(1);
  NetworkFile network = smallNetwork();
  network.network = large;
  network.inputs = {{"ranges", "m", 1900, InputGroup::Transform::kLinear, 0.0, 40.0, 0.0, 40.0}};
  saveNetwork(folder.file("a.yaml"), network);
  const std::clock_t start = std::clock();  // processor time: other programs do not count
  loadNetwork(folder.file("a.yaml"));
  const double taken = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  RecordProperty("load_ms", static_cast<int>(1e3 * taken));
  EXPECT_LT(taken, 0.5);
}

TEST(InputGroup, ScalesAfterItClamps) {
  const InputGroup linear{"a", "rad", 1, InputGroup::Transform::kLinear, 0.1, 0.5, -0.4, 0.6};
  EXPECT_DOUBLE_EQ(linear.scaled(0.1), 0.0);
  EXPECT_DOUBLE_EQ(linear.scaled(9.0), 1.0);
  EXPECT_DOUBLE_EQ(linear.scaled(-9.0), -1.0);
  const InputGroup inverse{"r", "m", 1, InputGroup::Transform::kInverse, 0.0, 2.0, 0.5, 40.0};
  EXPECT_DOUBLE_EQ(inverse.scaled(8.0), 0.25);
  EXPECT_DOUBLE_EQ(inverse.scaled(0.0), 4.0);
  EXPECT_DOUBLE_EQ(inverse.scaled(1e9), 0.05);
}

NetworkFile networkWithDomain() {
  NetworkFile network = smallNetwork();
  network.domain = InputDomain{"sectors", 7.5, {0.5, -1.25}, {2.0, 0.1, 3.0}};
  return network;
}

TEST(NetworkFile, TheDomainOfItsInputsComesBackInFloats) {
  const NetworkFile loaded = parseNetwork(textOf(networkWithDomain()), "file");
  ASSERT_TRUE(loaded.domain);
  EXPECT_EQ(loaded.domain->meaning, "sectors");
  EXPECT_EQ(loaded.domain->limit, 7.5);
  EXPECT_EQ(loaded.domain->mean, (std::vector<double>{0.5, -1.25}));
  EXPECT_EQ(loaded.domain->whitening, (std::vector<double>{2.0, static_cast<double>(0.1F), 3.0}));
}

TEST(NetworkFile, WithoutADomainThereIsNone) {
  EXPECT_FALSE(parseNetwork(textOf(smallNetwork()), "file").domain);
}

// --- bad files

std::string refusal(const std::string& text) {
  try {
    parseNetwork(text, "file");
  } catch (const config::ConfigError& e) {
    return e.what();
  }
  return "(accepted)";
}

std::string refusalOfFile(const std::string& file) {
  try {
    loadNetwork(file);
  } catch (const config::ConfigError& e) {
    return std::string(e.what()).substr(file.size());
  }
  return "(accepted)";
}

struct BadFile {
  const char* replace;  // what stands in the good file
  const char* by;
  const char* message;
};

// Every one is signed anew, so that what is wrong is the content, not the hash.
const BadFile kBadFiles[] = {
    {"format: tunnel_pilot_network\n", "format: other\n",
     "file: is not a network file: its first line must be 'format: tunnel_pilot_network'"},
    {"version: 1", "version: 2", "file: 'version' = 2 must be a whole number [1] in [1, 1]"},
    {"version: 1\n", "", "file: 'version' is missing"},
    {"version: 1\n", "version: 1\nversion: 1\n", "file: 'version' stands twice"},
    {"version: 1\n", "version: 1\nextra: 1\n", "file: 'extra' is unknown"},
    {"name: \"small\"", "name: \"\"", "file: 'name' must be 1 to 100 printable characters"},
    {"name: \"small\"", "name: [small]", "file: 'name' must be text"},
    {"{kind: dense, inputs: 11", "{kind: lstm, inputs: 11",
     "file: 'layers[1].kind' = 'lstm' must be one of: dense, convolution"},
    {"activation: tanh", "activation: swish",
     "file: 'layers[1].activation' = 'swish' must be one of: linear, tanh, sigmoid, relu"},
    {"inputs: 11, outputs: 4", "inputs: 12, outputs: 4",
     "file: 'layers' do not fit: layer 2 takes 12 values, the one before gives 11"},
    {"inputs: 11, outputs: 4", "inputs: 11, outputs: 0",
     "file: 'layers[1].outputs' = 0 must be a whole number [1] in [1, 100000]"},
    {"inputs: 11, outputs: 4", "inputs: 11, outputs: 4.5",
     "file: 'layers[1].outputs' must be a whole number [1] in [1, 100000]"},
    {"inputs: 11, outputs: 4", "inputs: 11, outputs: -4",
     "file: 'layers[1].outputs' = -4 must be a whole number [1] in [1, 100000]"},
    {"inputs: 11, outputs: 4", "inputs: 11, outputs: 18446744073709551617",
     "file: 'layers[1].outputs' must be a whole number [1] in [1, 100000]"},
    {"inputs: 4, outputs: 5", "inputs: 100000, outputs: 100000",
     "file: 'layers' do not fit: layer 3 takes 100000 values, the one before gives 4"},
    {"inputs: 11, outputs: 4", "inputs: 11, outputs: 4, bias: 1", "file: 'layers[1].bias' is unknown"},
    {"kernel: 3, stride: 2", "kernel: 13, stride: 2",
     "file: 'layers' do not fit: layer 1 has a kernel longer than its signals"},
    {"kernel: 3, stride: 2", "kernel: 3, stride: 0",
     "file: 'layers[0].stride' = 0 must be a whole number [1] in [1, 100000]"},
    {"kernel: 3, stride: 2", "kernel: 3", "file: 'layers[0].stride' is missing"},
    {"length_in: 12", "length_in: 100000", "file: 'layers' do not fit: layer 1 is wider than 100000"},
    {"count: 12", "count: 13", "file: 'inputs' are 14 values, the first layer takes 13"},
    {"transform: inverse", "transform: log",
     "file: 'inputs[0].transform' = 'log' must be one of: linear, inverse"},
    {"scale: 1, min: 0.5, max: 40", "scale: 1, min: 0, max: 40",
     "file: 'inputs[0].min' = 0 must be a number [m] in [1e-06, 1e+06]"},
    {"scale: 1, min: 0.5, max: 40", "scale: 1, min: 0.5, max: 0.5",
     "file: 'inputs[0].max' must be above 'min'"},
    {"scale: 1, min: 0.5, max: 40", "scale: 0, min: 0.5, max: 40",
     "file: 'inputs[0].scale' = 0 must be a number [m] in [1e-06, 1e+06]"},
    {"scale: 1, min: 0.5, max: 40", "scale: .nan, min: 0.5, max: 40",
     "file: 'inputs[0].scale' = .nan must be a number [m] in [1e-06, 1e+06]"},
    {"code: gaussian", "code: softmax",
     "file: 'output.code' = 'softmax' must be one of: value, gaussian"},
    {"spacing: 0.1", "spacing: -0.1",
     "file: 'output.spacing' = -0.1 must be a number [rad] in [1e-06, 1e+06]"},
    {"width: 5", "width: 0", "file: 'output.width' = 0 must be a number [1] in [0.5, 100]"},
    {"width: 5", "width: 5, offset: 0", "file: 'output.offset' is unknown"},
    {"output: {", "output: [{", "file: is not YAML: "},
    {"version: 1\n", "version: 1\n---\n", "file: must be one YAML document"},
    {"version: 1\n", "version: 1\n...\n,\n", "file: must be one YAML document"},
    {"training: |2-\n", "training: [|2-]\n", "file: is not YAML: "},
    {"parameters: |\n", "parameters: >\n", "file: 'parameters' is missing, or is no block of numbers"},
    {"parameters: |\n", "parameters: |\n  0.5\n", "file: parameters: more than the 81 that belong here"},
    {"parameters: |\n", "parameters: |\n  0.5\nparameters: |\n", "file: 'parameters' is unknown"},
    {"parameters: |\n  ", "parameters: |\n  nan ", "file: parameter 1 'nan' is not finite"},
    {"parameters: |\n  ", "parameters: |\n  -inf ", "file: parameter 1 '-inf' is not finite"},
    {"parameters: |\n  ", "parameters: |\n  1e99 ", "file: parameter 1 '1e99' is not finite"},
    {"parameters: |\n  ", "parameters: |\n  1000 ", "file: parameter 1 '1000' is too large"},
    {"parameters: |\n  ", "parameters: |\n  -1000 ", "file: parameter 1 '-1000' is too large"},
    {"parameters: |\n  ", "parameters: |\n  0,5 ", "file: parameter 1 '0,5' is not a number"},
    {"parameters: |\n  ", "parameters: |\n  x ", "file: parameter 1 'x' is not a number"},
    {"golden_input: |\n  ", "golden_input: |\n  0.5 ",
     "file: golden inputs: more than the 13 that belong here"},
    {"golden_output: |\n  ", "golden_output: |\n  0.5 ",
     "file: golden outputs: more than the 5 that belong here"},
    {"golden_output: |\n", "golden: |\n", "file: 'golden_output' is missing, or is no block of numbers"},
};

class BadNetworkFile : public testing::Test {
 protected:
  const std::string good_ = textOf(smallNetwork());

  std::string replaced(const std::string& what, const std::string& by) const {
    const std::size_t at = good_.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    std::string text = good_;
    return text.replace(at, what.size(), by);
  }
  // The numbers of a block, one of them replaced.
  std::string withNumber(const std::string& block, const std::string& number) const {
    const std::size_t begin = good_.find(block + ": |\n  ") + block.size() + 6;
    const std::size_t end = good_.find_first_of(" \n", begin);
    return resigned(good_.substr(0, begin) + number + good_.substr(end));
  }
};

TEST_F(BadNetworkFile, GoodOneIsAccepted) {
  EXPECT_EQ(refusal(good_), "(accepted)");
  EXPECT_EQ(refusal(resigned(good_)), "(accepted)");
}

TEST_F(BadNetworkFile, EveryWrongContentIsRefusedWithItsReason) {
  for (const BadFile& bad : kBadFiles) {
    const std::string message = refusal(resigned(replaced(bad.replace, bad.by)));
    const bool yaml = std::string(bad.message).find("YAML: ") != std::string::npos;
    EXPECT_EQ(yaml ? message.substr(0, std::string(bad.message).size()) : message, bad.message)
        << bad.replace << " -> " << bad.by;
  }
}

TEST_F(BadNetworkFile, AWrongDomainIsRefusedWithItsReason) {
  const BadFile bad_domains[] = {
      {"domain: {meaning: \"sectors\", size: 2, limit: 7.5}\n", "", "file: 'domain_mean' is unknown"},
      {"domain_mean: |\n  0.5 -1.25\n", "", "file: 'domain_mean' is missing, or is no block of numbers"},
      {"size: 2", "size: 3", "file: domain_mean numbers: only 2 of 3"},
      {"size: 2", "size: 1", "file: domain_mean numbers: more than the 1 that belong here"},
      {"size: 2", "size: 257", "file: 'domain.size' = 257 must be a whole number [1] in [1, 256]"},
      {"limit: 7.5", "limit: 0", "file: 'domain.limit' = 0 must be a number [1] in [0.001, 1e+09]"},
      {"limit: 7.5", "limit: 7.5, factor: 2", "file: 'domain.factor' is unknown"},
      {"  2 0.1 3\n", "  2 0.1\n", "file: domain_whitening numbers: only 2 of 3"},
      {"  2 0.1 3\n", "  2 0.1 nan\n", "file: domain_whitening number 3 'nan' is not finite"},
  };
  const std::string good = textOf(networkWithDomain());
  for (const BadFile& bad : bad_domains) {
    std::string text = good;
    const std::size_t at = text.find(bad.replace);
    ASSERT_NE(at, std::string::npos) << bad.replace;
    text.replace(at, std::string(bad.replace).size(), bad.by);
    EXPECT_EQ(refusal(resigned(text)), bad.message);
  }
}

TEST_F(BadNetworkFile, MissingNumbersAreCounted) {
  const std::size_t block = good_.find("parameters: |\n  ") + 16;
  const std::string less = good_.substr(0, block) + good_.substr(good_.find(' ', block) + 1);
  EXPECT_EQ(refusal(resigned(less)), "file: parameters: only 80 of 81");
}

TEST_F(BadNetworkFile, AnotherParameterDoesNotGiveTheGoldenOutput) {
  const std::string message = refusal(withNumber("parameters", "3.5"));
  EXPECT_EQ(message.substr(0, 11), "file: gives");
  EXPECT_NE(message.find("of its golden pair, which says"), std::string::npos) << message;
}

TEST_F(BadNetworkFile, AWrongGoldenOutputIsRefused) {
  const std::string message = refusal(withNumber("golden_output", "0.9"));
  EXPECT_NE(message.find("as output 1 of its golden pair, which says 0.9"), std::string::npos)
      << message;
}

TEST_F(BadNetworkFile, AGoldenOutputMustBeWithinATolerance) {
  const float first = std::stof(good_.substr(good_.find("golden_output: |\n  ") + 19));
  EXPECT_EQ(refusal(withNumber("golden_output", std::to_string(first + 5e-6F))), "(accepted)");
  EXPECT_NE(refusal(withNumber("golden_output", std::to_string(first + 2e-5F))), "(accepted)");
}

TEST_F(BadNetworkFile, AnotherHashIsRefused) {
  std::string text = good_;
  text[text.size() - 2] = text[text.size() - 2] == '0' ? '1' : '0';
  EXPECT_EQ(refusal(text), "file: has not the content that its sha256 tells: it was changed or damaged");
  EXPECT_EQ(refusal(replaced("small", "smell")),
            "file: has not the content that its sha256 tells: it was changed or damaged");
}

TEST_F(BadNetworkFile, NothingMayFollowTheHash) {
  EXPECT_EQ(refusal(good_ + "\n"),
            "file: does not end with the line 'sha256: ...': it is cut short, or was written to");
}

TEST_F(BadNetworkFile, EveryTruncationIsRefused) {
  for (std::size_t size = 0; size < good_.size(); ++size) {
    ASSERT_NE(refusal(good_.substr(0, size)), "(accepted)") << size;
  }
}

TEST_F(BadNetworkFile, TooMuchWorkIsRefusedBeforeItIsDone) {
  const std::string text =
      replaced(good_.substr(good_.find("layers:\n"), good_.find("inputs:\n") - good_.find("layers:\n")),
               "layers:\n  - {kind: convolution, channels_in: 20, length_in: 5000, channels_out: 20, "
               "kernel: 2500, stride: 1, passed: 0, activation: relu}\n");
  EXPECT_EQ(refusal(resigned(text)), "file: 'layers' make more than 200 million multiplications");
}

TEST_F(BadNetworkFile, TooManyParametersAreRefused) {
  const std::string text =
      replaced(good_.substr(good_.find("layers:\n"), good_.find("inputs:\n") - good_.find("layers:\n")),
               "layers:\n  - {kind: dense, inputs: 100000, outputs: 100000, activation: relu}\n");
  EXPECT_EQ(refusal(resigned(text)), "file: 'layers' do not fit: layer 1 has too many parameters");
}

TEST_F(BadNetworkFile, TooManyLayersAreRefused) {
  std::string layers = "layers:\n";
  for (int i = 0; i < 65; ++i) layers += "  - {kind: dense, inputs: 1, outputs: 1, activation: relu}\n";
  EXPECT_EQ(refusal(resigned(replaced("layers:\n", layers))),
            "file: 'layers' must be a list of 1 to 64");
}

TEST_F(BadNetworkFile, AnEndlessHeaderIsRefused) {
  EXPECT_EQ(
      refusal(resigned(replaced("version: 1\n", "version: 1\n" + std::string(2 << 20, '#') + "\n"))),
      "file: has more than 1 MiB beside its numbers");
}

TEST_F(BadNetworkFile, FolderAndMissingAndEmptyFileAreRefused) {
  const Folder folder;
  EXPECT_EQ(refusalOfFile(folder.file("none")), ": does not exist");
  std::filesystem::create_directory(folder.file("folder"));
  EXPECT_EQ(refusalOfFile(folder.file("folder")), ": is a directory");
  std::ofstream(folder.file("empty")).flush();
  EXPECT_EQ(refusalOfFile(folder.file("empty")),
            ": is not a network file: its first line must be 'format: tunnel_pilot_network'");
}

TEST_F(BadNetworkFile, AFifoIsRefusedWithoutWaiting) {
  const Folder folder;
  ASSERT_EQ(::mkfifo(folder.file("fifo").c_str(), 0600), 0);
  EXPECT_EQ(refusalOfFile(folder.file("fifo")), ": is not a regular file");
  EXPECT_EQ(refusalOfFile("/dev/zero"), ": is not a regular file");
}

TEST_F(BadNetworkFile, AHugeFileIsRefusedUnread) {
  const Folder folder;
  std::ofstream(folder.file("huge")).flush();
  std::filesystem::resize_file(folder.file("huge"), (64U << 20U) + 1);
  EXPECT_EQ(refusalOfFile(folder.file("huge")), ": is larger than 64 MiB");
}

TEST_F(BadNetworkFile, MessagesStayOneLine) {
  std::string text = replaced("parameters: |\n  ", "parameters: |\n  a\tb\x01 ");
  EXPECT_EQ(refusal(resigned(text)), "file: parameter 1 'a b ' is not a number");
}

}  // namespace
}  // namespace tunnel_pilot::neural
