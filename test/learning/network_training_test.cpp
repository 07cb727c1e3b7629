#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tunnel_pilot/learning/input_projection.h"
#include "tunnel_pilot/learning/network_trainer.h"
#include "tunnel_pilot/learning/recipe.h"
#include "tunnel_pilot/learning/teacher.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/diverged.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

const std::string kSource = TUNNEL_PILOT_SOURCE_DIR;

geometry::Path lineOf(double curvature) {
  return geometry::buildPath({{120.0, curvature, curvature}}, {}, 0.25);
}

simulation::Setup setup() {
  return simulation::loadSetup(simulation::loadScenario(kSource + "/scenarios/unseen_drifts.yaml"));
}

TeacherParameters judgement(double beyond = 0.0) {
  return {setup().pilot.preview_driver.weights, beyond};
}

Teacher teacher(double beyond = 0.0) {
  const simulation::Setup s = setup();
  return {judgement(beyond), s.pilot.preview_driver, s.truck.geometry};
}

TruckBesideLine truckAt(double offset, double heading_error) {
  TruckBesideLine truck;
  truck.station = 20.0;
  truck.offset = offset;
  truck.heading_error = heading_error;
  truck.speed = 3.0;
  return truck;
}

// Scans of a straight wall pair are made up: the label is a linear function of the walls' distances.
DataSet madeUp(std::size_t count, std::uint64_t seed) {
  simulation::Random random(seed, simulation::Stream::kScene);
  DataSet examples;
  for (std::size_t i = 0; i < count; ++i) {
    const double offset = random.uniform(-1.0, 1.0);
    Example example;
    for (std::size_t b = 0; b < drivers::LidarInputs::kBeams; ++b) {
      const double angle = (static_cast<double>(b) - 380.0) * 0.25 * M_PI / 180.0;
      const double wall = angle > 0.0 ? 2.5 - offset : 2.5 + offset;
      example.ranges.push_back(
          static_cast<float>(std::min(39.0, wall / std::max(std::abs(std::sin(angle)), 1e-3))));
    }
    example.speed = 3.0F;
    example.label = static_cast<float>(-0.2 * offset);
    example.tunnel = static_cast<std::uint32_t>(i);
    examples.push_back(std::move(example));
  }
  return examples;
}

NetworkDesign smallDesign(bool gaussian) {
  return {true, NetworkDesign::Truck::kNone, {}, {6}, neural::Activation::kTanh, gaussian, 1.0};
}

TrainingOptions quickTraining() {
  TrainingOptions options;
  options.epochs = 60;
  options.rate = 0.02;
  options.components = 20;
  return options;
}

double lastRms(neural::NetworkFile& network, const TrainingOptions& options) {
  double rms = 0.0;
  trainNetwork(network, madeUp(600, 1), madeUp(200, 2), options,
               [&](const TrainingProgress& now) { rms = now.validation_rms; });
  return rms;
}

TEST(Teacher, InTheMiddleOfAStraightDemandsNothing) {
  EXPECT_NEAR(teacher().command(lineOf(0.0), truckAt(0.0, 0.0), {}), 0.0, 1e-6);
}

TEST(Teacher, LeftOfTheLineDemandsARightTurn) {
  EXPECT_LT(teacher().command(lineOf(0.0), truckAt(0.4, 0.0), {}), -0.01);
}

// As onto a line 0.06 m on the other side.
TEST(Teacher, LeadsWhatIsFarFromTheLineAcrossIt) {
  const double onto = teacher().command(lineOf(0.0), truckAt(0.46, 0.0), {});
  EXPECT_NEAR(teacher(0.06).command(lineOf(0.0), truckAt(0.40, 0.0), {}), onto, 1e-9);
}

TEST(Teacher, LeadsWhatIsNearOntoTheLine) {
  const double onto = teacher().command(lineOf(0.0), truckAt(0.05, 0.0), {});
  EXPECT_NEAR(teacher(0.06).command(lineOf(0.0), truckAt(0.05, 0.0), {}), onto, 1e-12);
}

TEST(Teacher, InTheMirrorDemandsTheOpposite) {
  Teacher t = teacher(0.06);
  const double left = t.command(lineOf(0.04), truckAt(0.3, -0.1), {});
  const double right = t.command(lineOf(-0.04), truckAt(-0.3, 0.1), {});
  EXPECT_NEAR(left, -right, 1e-6);
}

TEST(Teacher, ATruckThatTurnsLessIsDemandedMore) {
  Teacher t = teacher();
  TruckBesideLine truck = truckAt(0.0, 0.0);
  truck.articulation = 0.2;
  const double usual = t.command(lineOf(0.04), truck, {1.0, 0.0});
  EXPECT_GT(t.command(lineOf(0.04), truck, {0.8, 0.0}), usual + 0.005);
}

// A plan that has not settled lets go in the middle of such a turn.
TEST(Teacher, TurnsATruckThatHeadsAwayWithoutAPause) {
  const simulation::Setup s = setup();
  Teacher t(loadRecipe(kSource + "/recipes/lidar_driver.yaml").teacher, s.pilot.preview_driver,
            s.truck.geometry);
  TruckBesideLine truck = truckAt(-0.737, -0.366519);
  truck.speed = 2.0;
  const double moment = 0.05;  // [s]
  double time = 0.0;
  for (; truck.heading_error < 0.0 && time < 4.0; time += moment) {
    const double demand = t.command(lineOf(0.0), truck, {});
    if (time > 0.3) {
      EXPECT_GT(demand - truck.articulation, 0.06) << "after " << time << " s";
    }
    truck = t.steered(lineOf(0.0), truck, {}, demand, moment);
  }
  EXPECT_LT(time, 2.0);
}

TEST(Teacher, MovesATruckAlongTheLineAtItsSpeed) {
  const TruckBesideLine moved = teacher().movedOn(lineOf(0.0), truckAt(0.1, 0.0), {}, 0.5);
  EXPECT_NEAR(moved.station, 21.5, 1e-3);
  EXPECT_NEAR(moved.offset, 0.1, 1e-3);
}

TEST(InputProjection, TheUnfoldedLayerSaysOfRawInputsWhatTheInnerSaysOfComponents) {
  const Eigen::MatrixXf inputs = 0.3F * Eigen::MatrixXf::Random(40, 200).array() + 0.5F;
  const InputProjection projection(inputs, 36, 10);
  ASSERT_EQ(projection.size(), 14U);
  neural::Network inner({neural::Layer::dense(14, 5, neural::Activation::kTanh),
                         neural::Layer::dense(5, 3, neural::Activation::kSigmoid)});
  inner.randomise(3);
  neural::Network outer({neural::Layer::dense(40, 5, neural::Activation::kTanh),
                         neural::Layer::dense(5, 3, neural::Activation::kSigmoid)});
  projection.unfold(inner, outer);
  const Eigen::MatrixXf components = projection.project(inputs);
  neural::BatchPass inner_pass(inner), outer_pass(outer);
  for (std::size_t lane = 0; lane < neural::BatchPass::kLanes; ++lane) {
    const auto column = static_cast<Eigen::Index>(lane);
    for (Eigen::Index r = 0; r < 14; ++r) {
      inner_pass.input(static_cast<std::size_t>(r))[lane] = static_cast<double>(components(r, column));
    }
    for (Eigen::Index r = 0; r < 40; ++r) {
      outer_pass.input(static_cast<std::size_t>(r))[lane] = static_cast<double>(inputs(r, column));
    }
  }
  inner_pass.forward();
  outer_pass.forward();
  for (std::size_t o = 0; o < 3; ++o) {
    for (std::size_t lane = 0; lane < neural::BatchPass::kLanes; ++lane) {
      EXPECT_NEAR(outer_pass.output(o)[lane], inner_pass.output(o)[lane], 1e-5);
    }
  }
}

TEST(InputProjection, AnInputThatNeverVariedGetsNoWeight) {
  Eigen::MatrixXf inputs = 0.3F * Eigen::MatrixXf::Random(40, 200).array() + 0.5F;
  inputs.row(38).setConstant(0.7F);
  const InputProjection projection(inputs, 36, 10);
  neural::Network inner({neural::Layer::dense(14, 5, neural::Activation::kTanh)});
  inner.randomise(3);
  neural::Network outer({neural::Layer::dense(40, 5, neural::Activation::kTanh)});
  projection.unfold(inner, outer);
  for (std::size_t h = 0; h < 5; ++h) {
    EXPECT_EQ(outer.parameters()[h * 40 + 38], 0.0);
    EXPECT_NE(outer.parameters()[h * 40 + 39], 0.0);
  }
}

TEST(DataSet, TunnelsOfAnotherSetGetNumbersOfTheirOwn) {
  DataSet all(3), other(2);
  all[2].tunnel = 4;
  other[1].tunnel = 1;
  append(all, other);
  ASSERT_EQ(all.size(), 5U);
  EXPECT_EQ(all[3].tunnel, 5U);
  EXPECT_EQ(all[4].tunnel, 6U);
}

TEST(NetworkTrainer, ADenseNetworkLearnsWhatTheWallsTell) {
  neural::NetworkFile network = makeNetwork(smallDesign(true), "made up");
  EXPECT_LT(lastRms(network, quickTraining()), 0.02);  // of labels with 0.115 rad RMS
}

TEST(NetworkTrainer, SoDoesASingleOutput) {
  neural::NetworkFile network = makeNetwork(smallDesign(false), "made up");
  EXPECT_LT(lastRms(network, quickTraining()), 0.01);
}

TEST(NetworkTrainer, SoDoesAConvolution) {
  NetworkDesign design = smallDesign(true);
  design.convolutions = {{4, 9, 8}, {4, 5, 4}};
  neural::NetworkFile network = makeNetwork(design, "made up");
  network.network.randomise(1);
  TrainingOptions options = quickTraining();
  options.epochs = 30;
  EXPECT_LT(lastRms(network, options), 0.03);
}

TEST(NetworkTrainer, GivesTheSameParametersTwice) {
  neural::NetworkFile a = makeNetwork(smallDesign(true), "made up");
  neural::NetworkFile b = a;
  TrainingOptions options = quickTraining();
  options.epochs = 3;
  lastRms(a, options);
  lastRms(b, options);
  EXPECT_EQ(a.network.parameters(), b.network.parameters());
}

TEST(NetworkTrainer, StopsWhenTheTunnelsHeldOutGetNoBetter) {
  neural::NetworkFile network = makeNetwork(smallDesign(true), "made up");
  DataSet nonsense = madeUp(200, 2);  // held out: the opposite of what is learned
  for (Example& example : nonsense) example.label = -example.label;
  TrainingOptions options = quickTraining();
  options.patience = 3;
  int epochs = 0;
  trainNetwork(network, madeUp(600, 1), nonsense, options,
               [&](const TrainingProgress& now) { epochs = now.epoch; });
  EXPECT_LT(epochs, 30);
}

TEST(NetworkTrainer, ALabelThatIsNoNumberIsSaidAndChangesNothing) {
  neural::NetworkFile network = makeNetwork(smallDesign(false), "made up");
  network.network.randomise(5);
  const std::vector<double> before = network.network.parameters();
  DataSet examples = madeUp(100, 1);
  examples[17].label = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(trainNetwork(network, examples, madeUp(50, 2), quickTraining(), [](const auto&) {}),
               neural::Diverged);
  EXPECT_EQ(network.network.parameters(), before);
}

TEST(NetworkTrainer, NeedsExamplesAndOthersHeldOut) {
  neural::NetworkFile network = makeNetwork(smallDesign(true), "made up");
  EXPECT_THROW(trainNetwork(network, {}, madeUp(5, 1), quickTraining(), [](const auto&) {}),
               std::invalid_argument);
  EXPECT_THROW(trainNetwork(network, madeUp(5, 1), {}, quickTraining(), [](const auto&) {}),
               std::invalid_argument);
}

TEST(SceneSampler, GivesTheSameScenesTwice) {
  const simulation::Setup s = setup();
  const std::string world = kSource + "/worlds/random_drift.yaml";
  const DataSet a = sampleScenes(world, 1001, 40, s, judgement(), {});
  const DataSet b = sampleScenes(world, 1001, 40, s, judgement(), {});
  ASSERT_EQ(a.size(), 40U);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].label, b[i].label);
    EXPECT_EQ(a[i].articulation_ahead, b[i].articulation_ahead);
  }
}

TEST(SceneSampler, DrivesWithinWhatTheGovernorAllows) {
  SceneSpread fast;
  fast.speed_min = fast.speed_max = 9.0;
  for (const Example& example :
       sampleScenes(kSource + "/worlds/random_drift.yaml", 1002, 60, setup(), judgement(), fast)) {
    EXPECT_LT(example.speed, 7.2F);
  }
}

TEST(Recipe, ThePapersNetworkHasThePapersSizesAndTheArticulation) {
  const Recipe recipe = loadRecipe(kSource + "/recipes/lidar_761_5_31.yaml");
  const neural::NetworkFile network = makeNetwork(recipe.design, recipe.name);
  EXPECT_EQ(network.network.parameters().size(), 762U * 5 + 5 + 5 * 31 + 31);
}

TEST(Recipe, AllShippedOnesLoad) {
  for (const char* name :
       {"lidar_driver", "lidar_761_5_31", "lidar_single_output", "lidar_convolution"}) {
    const Recipe recipe = loadRecipe(kSource + "/recipes/" + name + ".yaml");
    EXPECT_EQ(recipe.name, name);
    EXPECT_NO_THROW(makeNetwork(recipe.design, recipe.name));
  }
}

TEST(Recipe, ASmallOneIsFollowedToTheSameNetworkWithAnyNumberOfThreads) {
  const Recipe recipe = loadRecipe(kSource + "/test/learning/small_recipe.yaml");
  const auto quiet = [](const std::string&) {};
  neural::NetworkFile one = follow(recipe, nullptr, 1, quiet);
  const neural::NetworkFile two = follow(recipe, nullptr, 2, quiet);
  EXPECT_EQ(one.network.parameters(), two.network.parameters());
  ASSERT_TRUE(one.domain.has_value());
  EXPECT_NE(one.training.find("small_recipe"), std::string::npos);
}

TEST(Recipe, OfRecordedTunnelsEveryFifthIsHeldOutWhateverTheirNumbers) {
  Recipe recipe = loadRecipe(kSource + "/test/learning/small_recipe.yaml");
  recipe.training.epochs = 1;
  DataSet recorded = madeUp(600, 1);
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    recorded[i].tunnel = static_cast<std::uint32_t>(7 + 5 * (i % 6));
  }
  std::string first;
  follow(recipe, &recorded, 1, [&](const std::string& line) { first = first.empty() ? line : first; });
  EXPECT_EQ(first, "400 examples, 200 more held out");
}

TEST(Recipe, RecordedDrivesOfOneTunnelAreRefusedWithAdvice) {
  const Recipe recipe = loadRecipe(kSource + "/test/learning/small_recipe.yaml");
  DataSet recorded = madeUp(240, 1);
  for (Example& example : recorded) example.tunnel = 3;
  try {
    follow(recipe, &recorded, 1, [](const std::string&) {});
    FAIL() << "nothing is held out";
  } catch (const config::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("--tunnel-length"), std::string::npos) << error.what();
  }
}

TEST(Recipe, AConvolutionBeginsFromRandomWeightsAndLearns) {
  Recipe recipe = loadRecipe(kSource + "/test/learning/small_recipe.yaml");
  recipe.design.convolutions = {{4, 9, 8}, {4, 5, 4}};
  recipe.rounds = 0;
  recipe.training.epochs = 20;
  std::vector<std::string> told;
  const neural::NetworkFile network =
      follow(recipe, nullptr, 2, [&](const std::string& line) { told.push_back(line); });
  const double first = std::stod(told[1].substr(told[1].find("loss ") + 5));
  const double last = std::stod(told.back().substr(told.back().find("loss ") + 5));
  EXPECT_LT(last, 0.6 * first);
  EXPECT_NE(network.network.parameters()[0], 0.0);
}

TEST(Recipe, ASmallOneTeachesTheNetworkToSteerBack) {
  const Recipe recipe = loadRecipe(kSource + "/test/learning/small_recipe.yaml");
  std::vector<std::string> told;
  neural::NetworkFile network =
      follow(recipe, nullptr, 2, [&](const std::string& line) { told.push_back(line); });
  ASSERT_FALSE(told.empty());
  const drivers::LidarDriverParameters parameters = setup().pilot.lidar_driver;
  drivers::LidarDriver driver(parameters, setup().truck.geometry, network);
  double explained = 0.0;
  double all = 0.0;
  std::vector<float> values(network.network.inputs());
  drivers::LidarInputs inputs(network.inputs, network.name);
  neural::Inference inference(network.network);
  std::vector<float> outputs(31);
  for (const Example& example : sampleScenes(kSource + "/worlds/random_drift.yaml", 1003, 200, setup(),
                                             judgement(), recipe.scenes[0].spread)) {
    ASSERT_TRUE(inputs.fill(example.ranges, truckInputsOf(example), values.data()));
    inference.run(values.data(), outputs.data());
    const double error =
        driver.code()->decode(outputs.data()).value - static_cast<double>(example.label);
    explained += error * error;
    all += static_cast<double>(example.label * example.label);
  }
  EXPECT_LT(std::sqrt(explained / all), 0.6);
}

}  // namespace
}  // namespace tunnel_pilot::learning
