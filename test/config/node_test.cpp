#include "tunnel_pilot/config/node.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace tunnel_pilot::config {
namespace {

Node parse(const std::string& text) { return Node(YAML::Load(text), "truck.yaml"); }

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "(no error)";
}

TEST(ConfigNode, ReadsWhatIsThere) {
  Node node = parse("{a: 1.5, b: 3, c: text, d: true, e: [1, 2], f: {g: 2}}");
  EXPECT_DOUBLE_EQ(node.number("a", "m", 0, 2), 1.5);
  EXPECT_EQ(node.integer("b", "1", 0, 5), 3);
  EXPECT_EQ(node.text("c"), "text");
  EXPECT_TRUE(node.boolean("d"));
  EXPECT_EQ(node.numbers("e", "m", 0, 5, 2, 2).size(), 2u);
  Node f = node.child("f");
  EXPECT_DOUBLE_EQ(f.number("g", "m", 0, 5), 2.0);
  f.finish();
  node.finish();
}

TEST(ConfigNode, OutOfRangeNamesFileKeyUnitAndRange) {
  Node node = parse("{steering: {dead_time: -1}}");
  Node child = node.child("steering");
  EXPECT_EQ(messageOf([&] { child.number("dead_time", "s", 0, 1); }),
            "truck.yaml: 'steering.dead_time' = -1 must be a number [s] in [0, 1]");
}

TEST(ConfigNode, MissingKeyIsNamed) {
  Node node = parse("{a: 1}");
  EXPECT_EQ(messageOf([&] { node.number("b", "m", 0, 1); }), "truck.yaml: 'b' is missing");
}

TEST(ConfigNode, UnknownKeyIsNamed) {
  Node node = parse("{a: 1, typo: 2}");
  node.number("a", "m", 0, 1);
  EXPECT_EQ(messageOf([&] { node.finish(); }), "truck.yaml: 'typo' is unknown");
}

TEST(ConfigNode, AKeyThatStandsTwiceIsNamed) {
  EXPECT_EQ(messageOf([] { parse("{a: 1, b: 2, a: 3}"); }), "truck.yaml: 'a' stands twice");
  Node node = parse("{steering: {lag: 1, lag: 2}}");
  EXPECT_EQ(messageOf([&] { node.child("steering"); }), "truck.yaml: 'steering.lag' stands twice");
}

TEST(ConfigNode, ASecondDocumentIsRefusedAlsoWhereItHasNoEnd) {
  // yaml-cpp makes empty documents of what begins none, one after the other.
  for (const char* text :
       {"a: 1\n---\nb: 2\n", "---\na: 1\n---\n", "a: 1\n...\n,\n", "a: 1\n...\nb: 1\n"}) {
    EXPECT_EQ(messageOf([&] { parseText(text, "truck.yaml"); }),
              "truck.yaml: must be one YAML document");
  }
}

TEST(ConfigNode, OneDocumentMayHaveItsMarks) {
  Node node = parseText("---\na: 1\n...\n", "truck.yaml");
  EXPECT_EQ(node.integer("a", "1", 0, 5), 1);
}

TEST(ConfigNode, AMessageIsOneLineWhateverTheFileHolds) {
  Node node = parse("{a: \"x\\n\\e[31my\", \"b\\nc\": 1}");
  EXPECT_EQ(messageOf([&] { node.choice("a", {"z"}); }),
            "truck.yaml: 'a' = 'x  [31my' must be one of: z");
  EXPECT_EQ(messageOf([&] { node.finish(); }), "truck.yaml: 'b c' is unknown");
}

TEST(ConfigNode, QuotedNumberNanAndTextAreNotNumbers) {
  for (const char* value : {"'3'", ".nan", ".inf", "three", "[1]", "{b: 1}", "~"}) {
    Node node = parse(std::string("{a: ") + value + "}");
    EXPECT_THROW(node.number("a", "m", 0, 5), ConfigError) << value;
  }
}

TEST(ConfigNode, FractionIsNotAWholeNumber) {
  Node node = parse("{a: 1.5}");
  EXPECT_THROW(node.integer("a", "1", 0, 5), ConfigError);
}

TEST(ConfigNode, ListsOfWrongSizeAreRefused) {
  Node node = parse("{a: [1, 2, 3]}");
  EXPECT_THROW(node.numbers("a", "m", 0, 5, 2, 2), ConfigError);
}

TEST(ConfigNode, ListsOfTextAreReadAndOthersRefused) {
  Node node(YAML::Load("{names: [a, /b], empty: [], text: a, maps: [{a: 1}], blank: ['']}"), "x");
  EXPECT_EQ(node.texts("names", 0, 2), (std::vector<std::string>{"a", "/b"}));
  EXPECT_TRUE(node.texts("empty", 0, 2).empty());
  for (const char* wrong : {"text", "maps", "blank"}) {
    EXPECT_THROW(node.texts(wrong, 0, 2), ConfigError) << wrong;
  }
  EXPECT_THROW(node.texts("names", 0, 1), ConfigError);
  EXPECT_THROW(node.texts("empty", 1, 2), ConfigError);
}

TEST(ConfigNode, RecordsTellKeyUnitRangeAndValue) {
  Node node = parse("{steering: {dead_time: 0.15}, kind: a}");
  Node child = node.child("steering");
  child.number("dead_time", "s", 0, 1);
  node.choice("kind", {"a", "b"});
  ASSERT_EQ(node.records().size(), 2u);
  EXPECT_EQ(node.records()[0].key, "steering.dead_time");
  EXPECT_EQ(node.records()[0].unit, "s");
  EXPECT_EQ(node.records()[0].range, "[0, 1]");
  EXPECT_EQ(node.records()[0].value, "0.15");
  EXPECT_EQ(node.records()[1].range, "a, b");
}

TEST(ConfigNode, MissingFileDirectoryAndBrokenYamlAreRefused) {
  EXPECT_THROW(loadFile("/does/not/exist.yaml"), ConfigError);
  EXPECT_THROW(loadFile("/tmp"), ConfigError);
  EXPECT_THROW(parse("[1, 2]"), ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::config
