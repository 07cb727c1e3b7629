#include "tunnel_pilot/vehicle/truck_parameters.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "truck_file.h"

namespace tunnel_pilot::vehicle {
namespace {

using config::ConfigError;

// What loadTruck says of the shipped file after `edit` was done to its YAML.
std::string refusal(const std::function<void(YAML::Node&)>& edit) {
  YAML::Node yaml = YAML::LoadFile(truckFile());
  edit(yaml);
  try {
    loadTruck(config::Node(yaml, "truck.yaml"));
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "(accepted)";
}

TEST(TruckFile, ShippedFileHasThePapersTruck) {
  const TruckParameters truck = shippedTruck();
  EXPECT_DOUBLE_EQ(truck.geometry.front_axle_to_hinge + truck.geometry.rear_axle_to_hinge, 5.12);
  EXPECT_DOUBLE_EQ(truck.geometry.track, 2.278);
  EXPECT_DOUBLE_EQ(truck.empty.front + truck.empty.rear, 28800.0);
  EXPECT_DOUBLE_EQ(truck.loaded.front + truck.loaded.rear, 63800.0);
  EXPECT_NEAR(truck.drive.max_speed, 35.0 / 3.6, 1e-4);
  EXPECT_NEAR(truck.geometry.max_articulation, 45.0 * kDegree, 1e-6);
  EXPECT_NEAR(truck.steering.max_rate, 15.0 * kDegree, 1e-6);
}

TEST(TruckFile, UnknownKeyIsRefusedByName) {
  EXPECT_EQ(refusal([](YAML::Node& y) { y["tyre"]["colour"] = 1; }),
            "truck.yaml: 'tyre.colour' is unknown");
  EXPECT_EQ(refusal([](YAML::Node& y) { y["wings"] = 2; }), "truck.yaml: 'wings' is unknown");
}

TEST(TruckFile, MissingKeyIsRefusedByName) {
  EXPECT_EQ(refusal([](YAML::Node& y) { y["steering"].remove("dead_time"); }),
            "truck.yaml: 'steering.dead_time' is missing");
  EXPECT_EQ(refusal([](YAML::Node& y) { y.remove("loaded"); }), "truck.yaml: 'loaded' is missing");
}

TEST(TruckFile, MistypedValueIsRefusedWithUnitAndRange) {
  EXPECT_EQ(refusal([](YAML::Node& y) { y["steering"]["lag"] = "quick"; }),
            "truck.yaml: 'steering.lag' must be a number [s] in [0.01, 2]");
  EXPECT_EQ(refusal([](YAML::Node& y) { y["geometry"] = 3; }),
            "truck.yaml: 'geometry' must be a map of keys");
}

TEST(TruckFile, ValueOutOfRangeIsRefusedWithUnitAndRange) {
  EXPECT_EQ(refusal([](YAML::Node& y) { y["geometry"]["front_axle_to_hinge"] = -1.95; }),
            "truck.yaml: 'geometry.front_axle_to_hinge' = -1.95 must be a number [m] in [0.5, 10]");
  EXPECT_EQ(refusal([](YAML::Node& y) { y["tyre"]["friction"] = ".nan"; }),
            "truck.yaml: 'tyre.friction' = .nan must be a number [1] in [0.05, 1.5]");
}

TEST(TruckFile, EveryNumberIsRequiredAndRefusedOutOfRange) {
  const YAML::Node shipped = YAML::LoadFile(truckFile());
  int numbers = 0;
  for (const auto& section : shipped) {
    if (!section.second.IsMap()) continue;
    for (const auto& entry : section.second) {
      const std::string in = section.first.Scalar();
      const std::string key = entry.first.Scalar();
      EXPECT_EQ(refusal([&](YAML::Node& y) { y[in].remove(key); }),
                "truck.yaml: '" + in + "." + key + "' is missing");
      EXPECT_NE(refusal([&](YAML::Node& y) { y[in][key] = 1e12; }).find("'" + in + "." + key + "' = "),
                std::string::npos);
      ++numbers;
    }
  }
  EXPECT_GT(numbers, 50);
}

// roslaunch reads the file with Python's YAML 1.1, for which 1e6 without a sign and a point is text.
TEST(TruckFile, NumbersMeanTheSameToPython) {
  for (const auto& section : YAML::LoadFile(truckFile())) {
    if (!section.second.IsMap()) continue;
    for (const auto& entry : section.second) {
      const std::string value = entry.second.Scalar();
      const std::size_t e = value.find('e');
      EXPECT_NE(value.find('.'), std::string::npos) << entry.first.Scalar();
      if (e == std::string::npos) continue;
      EXPECT_NE(std::string("+-").find(value.at(e + 1)), std::string::npos) << entry.first.Scalar();
    }
  }
}

TEST(TruckFile, IdleCannotSteerFasterThanWorkingSpeed) {
  EXPECT_NE(refusal([](YAML::Node& y) { y["steering"]["idle_rate"] = 0.3; }).find("steering.idle_rate"),
            std::string::npos);
}

TEST(TruckFile, TruckThatWouldTipOverAnAxleIsRefused) {
  EXPECT_EQ(refusal([](YAML::Node& y) { y["loaded"]["rear_cg_offset"] = 9.0; }),
            "truck.yaml: 'loaded' leaves less than the unsprung mass on the front axle: masses or CG "
            "offsets are wrong");
}

TEST(TruckFile, FileThatIsNotThereIsRefusedByName) {
  try {
    loadTruck(std::string("/nowhere/truck.yaml"));
    FAIL();
  } catch (const ConfigError& e) {
    EXPECT_STREQ(e.what(), "/nowhere/truck.yaml: is not a file");
  }
}

TEST(AxleLoads, CarryTheWholeWeightAndBalanceAboutTheHinge) {
  const TruckParameters truck = shippedTruck();
  const AxleLoads axles = staticAxleLoads(truck, Load::kLoaded);
  EXPECT_NEAR(axles.front + axles.rear, 63800.0 * kGravity, 1e-6);
  // Moments of weights and axle loads about the hinge cancel.
  const double moment =
      axles.front * 1.95 - axles.rear * 3.17 - 27500.0 * kGravity * 1.75 + 36300.0 * kGravity * 2.6;
  EXPECT_NEAR(moment, 0.0, 1e-6);
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
