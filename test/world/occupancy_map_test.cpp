#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/world/ray_caster.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::world {
namespace {

using geometry::Point;

// A folder with a world, its map and its image, gone when the test ends.
class MapFiles : public ::testing::Test {
 protected:
  MapFiles() { std::filesystem::create_directories(folder_); }
  ~MapFiles() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }

  // Cells by letters: '#' occupied, '?' unknown, '.' free.
  void writeImage(const std::vector<std::string>& rows) {
    std::string text =
        "P5\n" + std::to_string(rows[0].size()) + " " + std::to_string(rows.size()) + "\n255\n";
    for (const std::string& row : rows) {
      for (const char cell : row) {
        text += static_cast<char>(cell == '#' ? 0 : cell == '?' ? 205 : 254);
      }
    }
    write("image.pgm", text);
  }

  World load(const std::string& map = kMap, const std::string& more = "", bool reversed = false) {
    write("map.yaml", map);
    write("world.yaml",
          "type: map\nname: m\nmap: map.yaml\nwidth: 0.0\n"
          "start: {x: 1.0, y: 2.0, heading: 0.5}\n" +
              more);
    return loadWorld((folder_ / "world.yaml").string(), {std::nullopt, reversed});
  }

  std::string refusal(const std::string& map, const std::string& more = "") {
    try {
      load(map, more);
    } catch (const config::ConfigError& e) {
      return e.what();
    }
    return "(accepted)";
  }

  inline static const std::string kMap =
      "image: image.pgm\nresolution: 0.5\norigin: [10.0, 20.0, 0.0]\nnegate: 0\n"
      "occupied_thresh: 0.65\nfree_thresh: 0.196\n";
  std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) /
      ("map_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
};

bool hasVertex(const World& world, double x, double y) {
  for (const WallChain& chain : world.walls) {
    for (const Point& p : chain) {
      if ((p - Point(x, y)).norm() < 1e-9) return true;
    }
  }
  return false;
}

TEST_F(MapFiles, OccupiedBlockBecomesAClosedChainThroughItsOuterCells) {
  writeImage({"......",  //
              ".###..",  //
              ".###..",  //
              "......"});
  const World world = load();
  ASSERT_EQ(world.walls.size(), 1U);
  EXPECT_TRUE(world.walls[0].front() == world.walls[0].back());
  // Columns 1 to 3, rows 1 and 2 from the top of 4: cell centres.
  EXPECT_TRUE(hasVertex(world, 10.75, 20.75));
  EXPECT_TRUE(hasVertex(world, 11.75, 20.75));
  EXPECT_TRUE(hasVertex(world, 11.75, 21.25));
  EXPECT_TRUE(hasVertex(world, 10.75, 21.25));
  EXPECT_EQ(world.walls[0].size(), 5U);
}

TEST_F(MapFiles, SingleCellIsSeenFromAllSides) {
  writeImage({".....",  //
              "..#..",  //
              "....."});
  const World world = load();
  const RayCaster caster(world.walls, {-M_PI, M_PI / 2.0, 5, 40.0});
  std::vector<float> ranges;
  caster.cast({11.25, 23.0, -M_PI / 2.0}, ranges);
  EXPECT_NEAR(ranges[2], 23.0 - 21.0, 1e-5);
}

TEST_F(MapFiles, ThinWallIsWatertight) {
  writeImage({"..........",  //
              ".########.",  //
              ".#......#.",  //
              ".#......#.",  //
              ".#......#.",  //
              ".########.",  //
              ".........."});
  const RayCaster caster(load().walls, {-M_PI, 2.0 * M_PI / 3600.0, 3600, 40.0});
  std::vector<float> ranges;
  caster.cast({12.4, 21.8, 0.1}, ranges);
  for (const float range : ranges) ASSERT_LT(range, 3.0F);
}

TEST_F(MapFiles, UnknownCellsAreNoWalls) {
  writeImage({"??????",  //
              "?.#..?",  //
              "??????"});
  EXPECT_EQ(load().walls.size(), 1U);
}

TEST_F(MapFiles, NegatedImageSwapsBlackAndWhite) {
  writeImage({"####",  //
              "#.##",  //
              "####"});
  std::string map = kMap;
  map.replace(map.find("negate: 0"), 9, "negate: 1");
  const World world = load(map);
  ASSERT_EQ(world.walls.size(), 1U);
  EXPECT_NEAR(world.walls[0][0].x(), 10.75, 0.26);
}

TEST_F(MapFiles, OriginsHeadingTurnsTheMap) {
  writeImage({"...",  //
              "..#"});
  std::string map = kMap;
  map.replace(map.find("20.0, 0.0]"), 10, "20.0, 1.5707963267948966]");
  const World world = load(map);
  EXPECT_TRUE(hasVertex(world, 10.0, 21.0));  // the cell's corner at (1.0, 0.0) of the image
}

TEST_F(MapFiles, LineThroughPointsHasHeadingsAndCurvatures) {
  writeImage({"#."});
  std::string points;
  for (int i = 0; i < 60; ++i) {
    points += (i ? ", " : "") + std::to_string(10.0 * std::cos(i * M_PI / 30.0)) + ", " +
              std::to_string(10.0 * std::sin(i * M_PI / 30.0));
  }
  const World world = load(kMap, "design_line: {closed: true, points: [" + points + "]}\n");
  EXPECT_NEAR(world.design_line.length(), 2.0 * M_PI * 10.0, 0.1);
  EXPECT_NEAR(world.design_line.at(0.0).curvature, 0.1, 1e-3);
  EXPECT_NEAR(world.design_line.at(0.0).heading, M_PI / 2.0, 1e-3);
  EXPECT_NEAR(world.design_line.at(20.0).curvature, 0.1, 1e-3);
}

TEST_F(MapFiles, ReversedStartIsTurnedRound) {
  writeImage({"#."});
  EXPECT_NEAR(load(kMap, "", true).start.heading, 0.5 - M_PI, 1e-12);
}

struct BadMap {
  const char* from;
  const char* to;
  const char* told;
};

TEST_F(MapFiles, BadMapsAreRefusedByFileKeyUnitAndRange) {
  writeImage({"#."});
  write("broken.pgm", "this is no image");
  write("empty.pgm", "P5\n2 1\n255\n\xfe\xfe");
  const std::vector<BadMap> cases = {
      {"resolution: 0.5", "resolution: 0.0",
       "map.yaml: 'resolution' = 0.0 must be a number [m] in [0.001, 10]"},
      {"resolution: 0.5", "resolution: fine", "'resolution' must be a number [m]"},
      {"resolution: 0.5\n", "", "map.yaml: 'resolution' is missing"},
      {"negate: 0", "negate: 2", "'negate' = 2 must be a whole number [1] in [0, 1]"},
      {"origin: [10.0, 20.0, 0.0]", "origin: [10.0, 20.0]", "'origin' must be a list of 3 to 3 numbers"},
      {"free_thresh: 0.196", "free_thresh: 0.7", "'free_thresh' [1] must be less than occupied_thresh"},
      {"occupied_thresh: 0.65", "occupied_thresh: 1.5",
       "'occupied_thresh' = 1.5 must be a number [1] in [0, 1]"},
      {"negate: 0", "negate: 0\nmode: scale", "'mode' = 'scale' must be one of: trinary"},
      {"negate: 0", "negate: 0\nhue: 3", "map.yaml: 'hue' is unknown"},
      {"image: image.pgm", "image: nowhere.pgm", "nowhere.pgm' is not a file"},
      {"image: image.pgm", "image: broken.pgm", "broken.pgm' is no image that OpenCV can read"},
      {"image: image.pgm", "image: empty.pgm", "'empty.pgm' has no occupied cell"},
  };
  for (const BadMap& bad : cases) {
    std::string map = kMap;
    map.replace(map.find(bad.from), std::string(bad.from).size(), bad.to);
    EXPECT_NE(refusal(map).find(bad.told), std::string::npos) << bad.to << "\n" << refusal(map);
  }
}

TEST_F(MapFiles, NoiseIsNoMap) {
  std::vector<std::string> rows(1002, std::string(1002, '.'));
  for (std::size_t y = 0; y < rows.size(); ++y) {
    for (std::size_t x = y % 2; x < rows[y].size(); x += 2) rows[y][x] = '#';
  }
  writeImage(rows);
  EXPECT_NE(refusal(kMap).find("'image' = 'image.pgm' is no map but noise: more than 500000 edges"),
            std::string::npos);
}

TEST_F(MapFiles, BadLinesAreRefused) {
  writeImage({"#."});
  EXPECT_NE(refusal(kMap, "design_line: {closed: false, points: [0, 0, 1]}\n")
                .find("world.yaml: 'design_line.points' must be a list of 4 to 100000 numbers [m]"),
            std::string::npos);
  EXPECT_NE(refusal(kMap, "design_line: {closed: false, points: [0, 0, 1, 1, 2]}\n")
                .find("'design_line.points' [m] must be pairs x, y"),
            std::string::npos);
  EXPECT_NE(refusal(kMap, "design_line: {closed: false, points: [0, 0, 0, 0]}\n")
                .find("'design_line.points' [m] must be at least 0.01 m apart"),
            std::string::npos);
}

}  // namespace
}  // namespace tunnel_pilot::world
