#include "tunnel_pilot/learning/preview_training.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/preview_network.h"

namespace tunnel_pilot::learning {
namespace {

constexpr PreviewTruck kTruck{5.12, 0.262, 1.2};
const std::string kScenarios = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/scenarios/";

PreviewTrainingOptions smallTraining() {
  PreviewTrainingOptions options;
  options.scenarios = {kScenarios + "lane_change_double.yaml"};
  options.imitation_steps = 4000;
  options.rounds = 1;
  options.drives = 1;
  options.validation_drives = 2;
  return options;
}

TEST(PreviewLaw, OnAnArcItAsksForTheArcsArticulation) {
  // At rest on an arc of lateral acceleration a: f_e = a T_p^2 / 2, y'' = a, u = C_0 a.
  const double a = 0.8;
  EXPECT_NEAR(previewLaw(kTruck, {0.5 * a * 1.44, a, 0.0, 0.0}), 5.12 / std::pow(15.0 / 3.6, 2) * a,
              1e-12);
}

TEST(PreviewLaw, SteersBackEarlierTheLongerTheHingeWillTurn) {
  // Drifting to the right of a straight path in a hard right bend.
  PreviewTruck slow = kTruck;
  slow.max_rate = 0.1;
  const drivers::PreviewInputs inputs{0.0, -0.4, -0.05, -0.02};
  EXPECT_GT(previewLaw(slow, inputs), previewLaw(kTruck, inputs) + 0.01);
}

TEST(PreviewTraining, ImitatesThePreviewLaw) {
  drivers::PreviewNetwork network(imitatePreviewLaw(kTruck, 1, PreviewTrainingOptions().imitation_steps),
                                  {});
  for (const drivers::PreviewInputs& inputs : {drivers::PreviewInputs{0.4, 0.0, 0.0, 0.0},
                                               {0.0, 0.6, 0.0, 0.0},
                                               {0.0, 0.0, 0.3, 0.0},
                                               {0.0, 0.0, 0.0, -0.1},
                                               {0.6, 0.8, 0.1, -0.1}}) {
    EXPECT_NEAR(network.run(inputs), previewLaw(kTruck, inputs), 0.03);
  }
}

TEST(PreviewTraining, ASmallTrainingDrivesAndComesOutTheSameTwice) {
  std::vector<PreviewTrainingProgress> told;
  const auto once = [&] {
    return trainPreviewNetwork(
        smallTraining(), [&](const PreviewTrainingProgress& progress) { told.push_back(progress); });
  };
  const neural::NetworkFile first = once();
  ASSERT_EQ(told.size(), 2U);
  EXPECT_LT(told[0].worst, 1.5);          // the imitation alone drives the lane change
  EXPECT_NE(told[1].cost, told[0].cost);  // drives have changed the weights
  EXPECT_EQ(once().network.parameters(), first.network.parameters());
}

TEST(PreviewTraining, RefusesWhatIsNoLaneChange) {
  PreviewTrainingOptions options = smallTraining();
  options.scenarios = {kScenarios + "default_drift.yaml"};
  EXPECT_THROW(trainPreviewNetwork(options, [](const PreviewTrainingProgress&) {}), config::ConfigError);
  options.scenarios.clear();
  EXPECT_THROW(trainPreviewNetwork(options, [](const PreviewTrainingProgress&) {}), config::ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::learning
