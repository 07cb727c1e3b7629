// The committed URDF and its meshes against the truck file.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "truck_file.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {
namespace {

const std::string kSource = TUNNEL_PILOT_SOURCE_DIR;
const std::string kUrdf = kSource + "/urdf/tunnel_pilot.urdf";
const std::string kMeshes = kSource + "/urdf/meshes/tunnel_pilot";

std::string read(const std::string& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

struct Outcome {
  int status;
  std::string output;  // both streams
};

Outcome run(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  Outcome result{-1, ""};
  if (pipe == nullptr) return result;
  std::array<char, 4096> buffer;
  while (std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe))
    result.output.append(buffer.data(), n);
  result.status = WEXITSTATUS(pclose(pipe));
  return result;
}

Outcome generate(const std::string& arguments) {
  return run("/usr/bin/python3 '" + kSource + "/scripts/generate_urdf' " + arguments);
}

// A copy of the truck file in which `from` is replaced by `to`, in the test's scratch folder.
std::string changedTruck(const std::string& from, const std::string& to) {
  std::string text = read(truckFile());
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos);
  text.replace(at, from.size(), to);
  const std::string file = ::testing::TempDir() + "changed_truck.yaml";
  std::ofstream(file) << text;
  return file;
}

TEST(Urdf, CommittedFilesAreWhatTheTruckFileGives) {
  const Outcome check = generate("--check");
  EXPECT_EQ(check.status, 0) << check.output;
}

TEST(Urdf, FollowsTheTruckFile) {
  const std::string truck = changedTruck("front_axle_to_hinge: 1.95", "front_axle_to_hinge: 2.05");
  const Outcome check = generate("--check --truck '" + truck + "'");
  EXPECT_EQ(check.status, 1);
  EXPECT_NE(check.output.find("/tunnel_pilot.urdf"), std::string::npos) << check.output;
  EXPECT_NE(check.output.find("/front_body_frame.stl"), std::string::npos) << check.output;
  const std::string urdf = ::testing::TempDir() + "changed_truck.urdf";
  ASSERT_EQ(generate("--truck '" + truck + "' --output '" + urdf + "'").status, 0);
  EXPECT_NE(read(urdf).find("<origin xyz=\"-2.05 0 0\""), std::string::npos);
}

TEST(Urdf, CheckSeesAnyFileThatIsAnotherOneTooManyOrMissing) {
  const std::string urdf = ::testing::TempDir() + "own_truck.urdf";
  const std::string meshes = ::testing::TempDir() + "meshes/own_truck/";
  const std::string output = "--output '" + urdf + "'";
  ASSERT_EQ(generate(output).status, 0);
  EXPECT_EQ(generate("--check " + output).status, 0);
  EXPECT_NE(read(urdf).find("file://" + meshes + "laser_black.stl"), std::string::npos);
  std::ofstream(meshes + "laser_black.stl", std::ios::app) << ' ';
  EXPECT_EQ(generate("--check " + output).status, 1);
  std::filesystem::remove(meshes + "laser_black.stl");
  EXPECT_EQ(generate("--check " + output).status, 1);
  ASSERT_EQ(generate(output).status, 0);
  std::ofstream(meshes + "another.stl") << ' ';
  EXPECT_EQ(generate("--check " + output).status, 1);
  std::filesystem::remove(meshes + "another.stl");
}

// What the corners of a binary STL file's triangles enclose [m].
struct Bounds {
  std::array<float, 3> least{1e9F, 1e9F, 1e9F}, greatest{-1e9F, -1e9F, -1e9F};
};

void enclose(const std::string& file, Bounds& bounds) {
  constexpr std::size_t kHead = 84, kTriangle = 50, kNormal = 12;  // [bytes]
  const std::string data = read(file);
  ASSERT_GE(data.size(), kHead + kTriangle) << file;
  std::uint32_t count = 0;
  std::memcpy(&count, data.data() + 80, sizeof(count));
  ASSERT_EQ(data.size(), kHead + kTriangle * count) << file;
  for (std::uint32_t i = 0; i < count; ++i) {
    std::array<float, 9> corners;
    std::memcpy(corners.data(), data.data() + kHead + i * kTriangle + kNormal, sizeof(corners));
    for (std::size_t j = 0; j < corners.size(); ++j) {
      bounds.least[j % 3] = std::min(bounds.least[j % 3], corners[j]);
      bounds.greatest[j % 3] = std::max(bounds.greatest[j % 3], corners[j]);
    }
  }
}

// By the first word of their names: front (body), rear (link), left and right (wheel), laser.
std::map<std::string, Bounds> boundsOfMeshes() {
  std::map<std::string, Bounds> all;
  for (const auto& entry : std::filesystem::directory_iterator(kMeshes)) {
    const std::string name = entry.path().filename().string();
    enclose(entry.path().string(), all[name.substr(0, name.find('_'))]);
  }
  return all;
}

TEST(Urdf, TheTruckThatIsSeenIsAsLargeAsTheOneThatIsDriven) {
  constexpr double kLooks = 0.03;  // [m]
  const TruckGeometry g = loadTruck(truckFile()).geometry;
  const auto bounds = boundsOfMeshes();
  const auto near = [&](double outline, float seen) { EXPECT_NEAR(outline, std::abs(seen), kLooks); };
  near(g.front_overhang, bounds.at("front").greatest[0]);
  near(g.rear_axle_to_hinge + g.rear_overhang, bounds.at("rear").least[0]);
  near(0.5 * g.overall_width, bounds.at("front").greatest[1]);
  near(0.5 * g.overall_width, bounds.at("rear").least[1]);
  near(g.tyre_free_radius, bounds.at("left").greatest[2]);
  near(g.tyre_rolling_radius, bounds.at("left").least[2]);
  near(g.tyre_free_radius, bounds.at("right").greatest[0]);
  EXPECT_EQ(5u, bounds.size());
}

TEST(Urdf, TruckFileWithoutAKeyIsRefusedByName) {
  const Outcome generated =
      generate("--check --truck '" + changedTruck("  track: 2.278", "  trick: 2.278") + "'");
  EXPECT_EQ(generated.status, 1);
  EXPECT_NE(generated.output.find("changed_truck.yaml: no truck file: KeyError: 'track'"),
            std::string::npos)
      << generated.output;
}

// The text of the joint or link called `name`, up to its end.
std::string element(const std::string& urdf, const std::string& kind, const std::string& name) {
  const std::size_t start = urdf.find("<" + kind + " name=\"" + name + "\"");
  if (start == std::string::npos) return "";
  return urdf.substr(start, urdf.find("</" + kind + ">", start) - start);
}

TEST(Urdf, ArticulationJointHasTheTrucksHingeStopAndRate) {
  const std::string joint = element(read(kUrdf), "joint", "articulation_joint");
  EXPECT_NE(joint.find("type=\"revolute\""), std::string::npos);
  EXPECT_NE(joint.find("<origin xyz=\"-1.95 0 0\""), std::string::npos);
  EXPECT_NE(joint.find("<child link=\"rear_link\""), std::string::npos);
  EXPECT_NE(joint.find("<axis xyz=\"0 0 -1\""), std::string::npos);  // positive turns left
  EXPECT_NE(joint.find("lower=\"-0.7854\" upper=\"0.7854\""), std::string::npos);
  EXPECT_NE(joint.find("velocity=\"0.2618\""), std::string::npos);
}

TEST(Urdf, LaserSitsWhereTheTruckFileSays) {
  const std::string joint = element(read(kUrdf), "joint", "laser_joint");
  EXPECT_NE(joint.find("<origin xyz=\"1.6 0 1.5\" rpy=\"0 0 0\""), std::string::npos);
}

TEST(Urdf, IsAcceptedByTheUrdfParser) {
  if (run("command -v check_urdf").status != 0) {
    GTEST_SKIP() << "check_urdf (package liburdfdom-tools) is not installed";
  }
  const Outcome check = run("check_urdf '" + kUrdf + "'");
  EXPECT_EQ(check.status, 0) << check.output;
  EXPECT_NE(check.output.find("root Link: base_link"), std::string::npos) << check.output;
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
