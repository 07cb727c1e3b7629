// Every way a world file can be wrong, and what the reader then says.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::world {
namespace {

const char* const kTunnel = R"(type: tunnel
name: a tunnel
seed: 1
width: 5.0
wall_spacing: 0.5
closed: false
start_at: 10.0
roughness: {sigma: 0.05, correlation_length: 2.0}
design_line:
  - straight: {length: 60.0}
  - bend: {radius: 15.0, angle: 1.5, turn: left, transition: 10.0}
  - straight: {length: 60.0}
widenings:
  - {from: 10.0, to: 40.0, width: 8.0, taper: 5.0}
openings:
  - {side: left, at: 50.0, width: 4.0, depth: 2.0}
obstacles:
  - name: box
    outline: [0, 0, 1, 0, 0, 1]
    pose: {x: 20.0, y: 0.0, heading: 0.0}
    speed: 0.0
    travel: 0.0
)";

const char* const kLoop = R"(type: tunnel
name: a loop
seed: 1
width: 5.0
wall_spacing: 0.5
closed: true
start_at: 10.0
roughness: {sigma: 0.05, correlation_length: 2.0}
design_line:
  - straight: {length: 30.0}
  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}
  - straight: {length: 30.0}
  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}
  - straight: {}
  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}
  - straight: {}
  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}
)";

const char* const kRandom = R"(type: random_tunnel
name: random
seed: 1
width: 5.0
wall_spacing: 0.5
start_at: 10.0
roughness: {sigma: 0.05, correlation_length: 2.0}
min_length: 100.0
straight_length: [20.0, 40.0]
bend_radius: [12.0, 25.0]
bend_angle: [0.4, 1.6]
transition_length: [8.0, 12.0]
reversal_probability: 0.3
reversal_length: [13.0, 18.0]
bays: {probability: 0.3, width: [3.0, 6.0], depth: [1.0, 2.5]}
separation: 3.0
)";

std::string refusal(const std::string& text) {
  const std::string file = ::testing::TempDir() + "bad_world.yaml";
  std::ofstream(file) << text;
  std::string told = "(accepted)";
  try {
    loadWorld(file);
  } catch (const config::ConfigError& e) {
    told = e.what();
  }
  std::filesystem::remove(file);
  return told;
}

struct Bad {
  const char* base;
  const char* from;
  const char* to;
  const char* told;  // after the file's name
};

const std::vector<Bad> kBad = {
    // What every tunnel has.
    {kTunnel, "type: tunnel", "type: cave",
     "'type' = 'cave' must be one of: tunnel, random_tunnel, map"},
    {kTunnel, "type: tunnel\n", "", "'type' is missing"},
    {kTunnel, "name: a tunnel\n", "", "'name' is missing"},
    {kTunnel, "seed: 1", "seed: -1", "'seed' = -1 must be a whole number [1] in [0, 1e+09]"},
    {kTunnel, "width: 5.0", "width: -5.0", "'width' = -5.0 must be a number [m] in [1, 50]"},
    {kTunnel, "width: 5.0", "width: wide", "'width' must be a number [m] in [1, 50]"},
    {kTunnel, "width: 5.0", "width: .nan", "'width' = .nan must be a number [m] in [1, 50]"},
    {kTunnel, "wall_spacing: 0.5", "wall_spacing: 0",
     "'wall_spacing' = 0 must be a number [m] in [0.05, 5]"},
    {kTunnel, "closed: false", "closed: perhaps", "'closed' must be true or false"},
    {kTunnel, "start_at: 10.0", "start_at: 1000.0",
     "'start_at' = 1000.0 must be a number [m] in [0, 152.5]"},
    {kTunnel, "sigma: 0.05", "sigma: 5", "'roughness.sigma' = 5 must be a number [m] in [0, 0.5]"},
    {kTunnel, ", correlation_length: 2.0", "", "'roughness.correlation_length' is missing"},
    {kTunnel, "roughness: {sigma: 0.05, correlation_length: 2.0}", "roughness: 3",
     "'roughness' must be a map of keys"},
    {kTunnel, "seed: 1", "seed: 1\ncolour: grey", "'colour' is unknown"},
    // The design line.
    {kTunnel, "straight: {length: 60.0}", "straight: {length: -1}",
     "'design_line[0].straight.length' = -1 must be a number [m] in [0.01, 2000]"},
    {kTunnel, "straight: {length: 60.0}", "straight: {}", "'design_line[0].straight.length' is missing"},
    {kTunnel, "straight: {length: 60.0}", "spiral: {length: 60.0}",
     "'design_line[0].straight' is missing: a piece is one of straight, arc, clothoid, bend"},
    {kTunnel, "straight: {length: 60.0}", "straight: {length: 60.0, slope: 1}",
     "'design_line[0].straight.slope' is unknown"},
    {kTunnel, "radius: 15.0", "radius: 2.0",
     "'design_line[1].bend.radius' = 2.0 must be a number [m] in [3, 10000]"},
    {kTunnel, "turn: left", "turn: up", "'design_line[1].bend.turn' = 'up' must be one of: left, right"},
    {kTunnel, "angle: 1.5", "angle: 0.5",
     "'design_line[1].bend.angle' [rad] must exceed transition/radius = 0.666667"},
    {kTunnel, "angle: 1.5, ", "", "'design_line[1].bend.angle' is missing"},
    {kTunnel, "  - straight: {length: 60.0}\n  - bend", "  - clothoid: {length: 60.0}\n  - bend",
     "'design_line' must not begin or end with a clothoid"},
    {kTunnel, "  - bend", "  - clothoid: {length: 5.0}\n  - clothoid: {length: 5.0}\n  - bend",
     "'design_line' must not hold two clothoids side by side"},
    {kTunnel, "from: 10.0, to: 40.0, width: 8.0", "from: 60.0, to: 90.0, width: 40.0",
     "'design_line' folds its inner wall at s = "},
    {kTunnel, "angle: 1.5,", "angle: 6.2,", "'design_line' brings the walls at s = "},
    {kTunnel, "wall_spacing: 0.5", "wall_spacing: 0.5\nwidth: 4.0", "'width' stands twice"},
    // Closing a loop.
    {kLoop, "angle: 1.5708", "angle: 1.2", "a closed line by 6.28319 rad"},
    {kLoop, "straight: {}", "straight: {length: 20.0}",
     "'design_line' has 1 straights without a length; two are needed"},
    {kLoop, "  - straight: {length: 30.0}\n  - bend", "  - bend",
     "'design_line' closes only with a straight of"},
    {kLoop,
     "straight: {}\n  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}\n"
     "  - straight: {}",
     "straight: {length: 29.0}\n  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}\n"
     "  - straight: {length: 30.0}",
     "'design_line' ends 1"},
    {kLoop,
     "straight: {length: 30.0}\n  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}\n"
     "  - straight: {length: 30.0}",
     "straight: {}\n  - bend: {radius: 15.0, angle: 1.5708, turn: left, transition: 10.0}\n"
     "  - straight: {length: 30.0}",
     "'design_line' has 3 straights without a length"},
    {kLoop, "angle: 1.5708, turn: left, transition: 10.0}\n  - straight: {length: 30.0}",
     "turn: left, transition: 10.0}\n  - bend: {radius: 9.0, turn: left, transition: 2.0}",
     "'design_line' may leave out the angle of one arc or bend only"},
    // Widenings, openings, obstacles.
    {kTunnel, "from: 10.0", "from: -1", "'widenings[0].from' = -1 must be a number [m] in [0, 152.5]"},
    {kTunnel, "to: 40.0", "to: 15.0", "'widenings[0].to' [m] must be at least from + 2 taper"},
    {kTunnel, "taper: 5.0}", "taper: 5.0}\n  - {from: 30.0, to: 60.0, width: 7.0, taper: 5.0}",
     "'widenings' must not overlap"},
    {kTunnel, "side: left", "side: above", "'openings[0].side' = 'above' must be one of: left, right"},
    {kTunnel, "at: 50.0", "at: 152.0", "'openings[0].at' = 152.0 must be a number [m] in [2, 150.5]"},
    {kTunnel, "depth: 2.0}", "depth: 2.0}\n  - {side: left, at: 53.0, width: 4.0, depth: 2.0}",
     "'openings' on one side must be at least 0.5 m apart"},
    {kTunnel, "outline: [0, 0, 1, 0, 0, 1]", "outline: [0, 0, 1, 0]",
     "'obstacles[0].outline' must be a list of 6 to 128 numbers [m]"},
    {kTunnel, "outline: [0, 0, 1, 0, 0, 1]", "outline: [0, 0, 1, 0, 0, 1, 2]",
     "'obstacles[0].outline' [m] must be pairs x, y"},
    {kTunnel, "    pose: {x: 20.0, y: 0.0, heading: 0.0}\n", "", "'obstacles[0].pose' is missing"},
    {kTunnel, "pose: {x: 20.0, y: 0.0, heading: 0.0}", "beside: {s: 900.0, offset: 0.0, heading: 0.0}",
     "'obstacles[0].beside.s' = 900.0 must be a number [m] in [0, 152.5]"},
    {kTunnel, "speed: 0.0", "speed: -3.0",
     "'obstacles[0].speed' = -3.0 must be a number [m/s] in [0, 50]"},
    // Random layouts.
    {kRandom, "bend_radius: [12.0, 25.0]", "bend_radius: [25.0, 12.0]",
     "'bend_radius' [m] must be [smallest, largest]"},
    {kRandom, "straight_length: [20.0, 40.0]", "straight_length: 30.0",
     "'straight_length' must be a list of 2 to 2 numbers [m] in [1, 500]"},
    {kRandom, "probability: 0.3, w", "probability: 1.3, w",
     "'bays.probability' = 1.3 must be a number [1] in [0, 1]"},
    {kRandom, "separation: 3.0\n", "", "'separation' is missing"},
    {kRandom, "separation: 3.0", "separation: 3.0\nclosed: true", "'closed' is unknown"},
    {kRandom, "separation: 3.0", "separation: 30.0",
     "'separation' = 30.0 must be a number [m] in [0, 10]"},
    // Turns on the spot, which bring the drift back beside itself whatever is drawn.
    {kRandom,
     "[12.0, 25.0]\nbend_angle: [0.4, 1.6]\ntransition_length: [8.0, 12.0]\nreversal_probability: 0.3",
     "[3.0, 3.0]\nbend_angle: [2.9, 2.9]\ntransition_length: [0.5, 0.5]\nreversal_probability: 0.0",
     "'min_length' [m]: no layout suits in 200 draws; the last one brings the walls at s = "},
};

TEST(BadWorlds, TheFilesTheyAreMadeFromAreGood) {
  for (const char* base : {kTunnel, kLoop, kRandom}) EXPECT_EQ(refusal(base), "(accepted)");
}

TEST(BadWorlds, EachIsRefusedNamingFileKeyUnitAndRange) {
  for (const Bad& bad : kBad) {
    std::string text = bad.base;
    const std::size_t at = text.find(bad.from);
    ASSERT_NE(at, std::string::npos) << bad.from;
    text.replace(at, std::string(bad.from).size(), bad.to);
    const std::string told = refusal(text);
    EXPECT_NE(told.find("bad_world.yaml: "), std::string::npos) << told;
    EXPECT_NE(told.find(bad.told), std::string::npos) << "wanted: " << bad.told << "\ntold:   " << told;
  }
}

std::string straights(int count, const std::string& length, const std::string& spacing) {
  std::string text = "type: tunnel\nname: long\nseed: 1\nwidth: 5.0\nwall_spacing: " + spacing +
                     "\nclosed: false\nstart_at: 10.0\n"
                     "roughness: {sigma: 0.05, correlation_length: 2.0}\ndesign_line:\n";
  for (int i = 0; i < count; ++i) text += "  - straight: {length: " + length + "}\n";
  return text;
}

TEST(BadWorlds, ATunnelThatWouldTakeHoursOrAllMemoryIsRefused) {
  EXPECT_EQ(refusal(straights(5, "2000.0", "0.5")), "(accepted)");
  EXPECT_NE(refusal(straights(6, "2000.0", "0.5"))
                .find("'design_line' is 12000 m long: more than 20000 wall_spacings of 0.5 m"),
            std::string::npos);
  EXPECT_NE(refusal(straights(1000, "2000.0", "5.0")).find("must be at most 100000 m"),
            std::string::npos);
  EXPECT_NE(refusal(straights(50000, "0.01", "0.5")).find("must hold at most 1000 pieces"),
            std::string::npos);
  std::string random = kRandom;
  random.replace(random.find("min_length: 100.0"), 17, "min_length: 5000.0");
  random.replace(random.find("wall_spacing: 0.5"), 17, "wall_spacing: 0.05");
  EXPECT_NE(refusal(random).find("more than 20000 wall_spacings"), std::string::npos);
}

TEST(BadWorlds, FilesThatAreNoWorldsAreRefused) {
  EXPECT_NE(refusal("type: [tunnel").find("is not YAML"), std::string::npos);
  EXPECT_NE(refusal("- 1\n- 2\n").find("must be a map of keys"), std::string::npos);
  EXPECT_THROW(loadWorld("/nowhere/at_all.yaml"), config::ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::world
