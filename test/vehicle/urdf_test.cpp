// The committed URDF against the truck file.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "truck_file.h"

namespace tunnel_pilot::vehicle {
namespace {

const std::string kSource = TUNNEL_PILOT_SOURCE_DIR;
const std::string kUrdf = kSource + "/urdf/tunnel_pilot.urdf";

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

Outcome generate(const std::string& truck) {
  return run("/usr/bin/python3 '" + kSource + "/scripts/generate_urdf' --output - --truck '" + truck +
             "'");
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

TEST(Urdf, CommittedFileIsWhatTheTruckFileGives) {
  const Outcome generated = generate(truckFile());
  ASSERT_EQ(generated.status, 0) << generated.output;
  EXPECT_TRUE(generated.output == read(kUrdf)) << "run scripts/generate_urdf and commit " << kUrdf;
}

TEST(Urdf, FollowsTheTruckFile) {
  const Outcome generated =
      generate(changedTruck("front_axle_to_hinge: 1.95", "front_axle_to_hinge: 2.05"));
  EXPECT_EQ(generated.status, 0);
  EXPECT_NE(generated.output, read(kUrdf));
  EXPECT_NE(generated.output.find("<origin xyz=\"-2.05 0 0\""), std::string::npos);
}

TEST(Urdf, TruckFileWithoutAKeyIsRefusedByName) {
  const Outcome generated = generate(changedTruck("  track: 2.278", "  trick: 2.278"));
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
