#include "tunnel_pilot/drivers/lidar_driver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "random_network.h"
#include "tunnel_pilot/drivers/inverse_ranges.h"
#include "tunnel_pilot/perception/scan_filter.h"

namespace tunnel_pilot::neural {

struct InferenceAccess {
  static float& parameter(Inference& inference, std::size_t i) { return inference.parameters_[i]; }
};

}  // namespace tunnel_pilot::neural

namespace tunnel_pilot::drivers {

struct WatchedInferenceAccess {
  static float& parameter(WatchedInference& watched, std::size_t i) {
    return neural::InferenceAccess::parameter(watched.inference_, i);
  }
};

struct LidarDriverAccess {
  static float& parameter(LidarDriver& driver, std::size_t i) {
    return WatchedInferenceAccess::parameter(driver.inference_, i);
  }
};

namespace {

using Refusal = LidarDriver::Refusal;

const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

LidarDriverParameters parameters() {
  return loadLidarDriver(config::loadFile(kConfig + "lidar_driver.yaml"), kConfig);
}

LidarDriver driverOf(const neural::NetworkFile& network) {
  return {parameters(), vehicle::loadTruck(kConfig + "truck.yaml").geometry, network};
}

// A straight drift 5.0 m wide that ends in a face 30 m ahead, `left` of its middle.
geometry::Scan driftScan(double time, double first_degrees, double step_degrees, int beams,
                         double left = 0.0) {
  geometry::Scan scan;
  scan.stamp = fromSeconds(time);
  scan.angle_min = first_degrees * M_PI / 180.0;
  scan.angle_increment = step_degrees * M_PI / 180.0;
  scan.range_min = 0.1;
  scan.range_max = 40.0;
  for (int i = 0; i < beams; ++i) {
    const double angle = scan.angle(static_cast<std::size_t>(i));
    const double side = (std::sin(angle) > 0.0 ? 2.5 - left : 2.5 + left) / std::abs(std::sin(angle));
    const double face = std::cos(angle) > 0.0 ? 30.0 / std::cos(angle) : side;
    scan.ranges.push_back(static_cast<float>(std::min(side, face)));
  }
  return scan;
}

geometry::Scan nativeScan(double time, double left = 0.0) {
  return driftScan(time, -95.0, 0.25, 761, left);
}

Motion motionAt(double time) {
  Motion motion;
  motion.stamp = fromSeconds(time);
  motion.pose = {2.5 * time, 0.0, 0.0};
  motion.speed = 2.5;
  return motion;
}

Proposal proposeAt(LidarDriver& driver, double time) {
  return driver.propose(nativeScan(time), motionAt(time + 0.03), fromSeconds(time + 0.04));
}

TEST(LidarDriver, CarriesTheScansStampAndAsksForItsConfiguredSpeed) {
  LidarDriver driver = driverOf(randomNetwork());
  const Proposal proposal = proposeAt(driver, 1.0);
  ASSERT_TRUE(proposal.valid);
  EXPECT_EQ(proposal.stamp, fromSeconds(1.0));
  EXPECT_DOUBLE_EQ(proposal.speed, parameters().speed);
  EXPECT_GT(proposal.confidence, 0.0);
  EXPECT_EQ(driver.outputs().size(), 31U);
  EXPECT_EQ(driver.refusal(), Refusal::kNone);
}

TEST(LidarDriver, AnOldScanIsRefused) {
  LidarDriver driver = driverOf(randomNetwork());
  const double late = 1.0 + parameters().max_scan_age + 0.01;
  EXPECT_FALSE(driver.propose(nativeScan(1.0), motionAt(late), fromSeconds(late)).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kScanAge);
}

TEST(LidarDriver, AScanFromTheFutureIsRefused) {
  LidarDriver driver = driverOf(randomNetwork());
  EXPECT_FALSE(driver.propose(nativeScan(1.0), motionAt(0.9), fromSeconds(0.99)).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kScanAge);
}

TEST(LidarDriver, MotionThatIsNoNumberIsRefused) {
  LidarDriver driver = driverOf(randomNetwork());
  Motion motion = motionAt(1.03);
  motion.yaw_rate = kNaN;
  EXPECT_FALSE(driver.propose(nativeScan(1.0), motion, fromSeconds(1.04)).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kMotion);
}

TEST(LidarDriver, AScanWithoutAReturnOrOfAnotherSizeIsRefused) {
  LidarDriver driver = driverOf(randomNetwork());
  geometry::Scan scan = nativeScan(1.0);
  scan.ranges.pop_back();
  EXPECT_FALSE(driver.propose(scan, motionAt(1.03), fromSeconds(1.04)).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kScan);
  scan.ranges.assign(761, std::numeric_limits<float>::infinity());
  EXPECT_FALSE(driver.propose(scan, motionAt(1.03), fromSeconds(1.04)).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kScan);
}

// What a truck that stands straight is told to do when the network answers `answer` [rad], whatever it
// sees.
double commandFor(double answer, double small_lead_share) {
  neural::NetworkFile network = randomNetwork();
  network.output.small_lead_share = small_lead_share;
  std::vector<double>& p = network.network.parameters();
  std::fill(p.begin(), p.end(), 0.0);
  neural::GaussianCode(31, network.output.first, network.output.spacing, network.output.width)
      .encode(answer, &p[p.size() - 31]);
  LidarDriverParameters exact = parameters();
  exact.mirror = false;
  exact.steering.dead_band = 0.0;
  exact.steering.boost = 0.0;
  LidarDriver driver(exact, vehicle::loadTruck(kConfig + "truck.yaml").geometry, network);
  return proposeAt(driver, 1.0).articulation_angle;
}

TEST(LidarDriver, OfASmallLeadOnlyAShareIsCommandedAndOfTheLargestAll) {
  const double most = parameters().steering.lead;
  EXPECT_NEAR(commandFor(0.02, 1.0), 0.02, 1e-4);
  EXPECT_NEAR(commandFor(0.002, 0.3), 0.3 * 0.002, 1e-4);
  EXPECT_NEAR(commandFor(-0.5 * most, 0.3), -0.65 * 0.5 * most, 1e-4);
  EXPECT_NEAR(commandFor(most, 0.3), most, 1e-4);
  EXPECT_NEAR(commandFor(0.2, 0.3), most, 1e-9);
}

TEST(LidarDriver, ANetworkForOtherInputsOrOutputsIsRefused) {
  neural::NetworkFile network = randomNetwork();
  network.inputs[1].meaning = "payload";
  EXPECT_THROW(driverOf(network), config::ConfigError);
  network = randomNetwork();
  network.output.meaning = "speed";
  EXPECT_THROW(driverOf(network), config::ConfigError);
}

// ---- scans unlike those of the training (RELIABILITY N3)

// A domain in which a scan of `centre` lies in the middle and every feature may vary by about a tenth.
neural::InputDomain domainAround(const geometry::Scan& centre) {
  std::vector<float> inverse;
  EXPECT_TRUE(invertRanges(centre.ranges, inverse));
  const ScanDomain::Features middle = ScanDomain::features(inverse);
  std::mt19937 random(4);
  std::normal_distribution<double> normal(0.0, 0.1);
  std::vector<ScanDomain::Features> examples(2000, middle);
  for (ScanDomain::Features& example : examples) {
    for (double& feature : example) feature += normal(random);
  }
  return ScanDomain::fit(examples);
}

Proposal proposeForeignAt(LidarDriver& driver, double time) {
  geometry::Scan foreign = nativeScan(time);
  for (float& range : foreign.ranges) range *= 3.0F;
  return driver.propose(foreign, motionAt(time + 0.03), fromSeconds(time + 0.04));
}

TEST(LidarDriver, IsAsSureOfAFamiliarScanAsWithoutADomainAndLessOfAForeignOne) {
  neural::NetworkFile network = randomNetwork();
  LidarDriver without = driverOf(network);
  network.domain = domainAround(nativeScan(1.0));
  LidarDriver with = driverOf(network);
  EXPECT_EQ(proposeAt(with, 1.0).confidence, proposeAt(without, 1.0).confidence);
  const double later = 1.1 + parameters().bridge_time;
  const Proposal proposal = proposeForeignAt(with, later);
  EXPECT_TRUE(proposal.valid);
  EXPECT_LT(proposal.confidence, 0.25 * proposeForeignAt(without, later).confidence);
}

TEST(LidarDriver, AForeignScanIsBridgedForAMomentWithTheLastSureAnswer) {
  neural::NetworkFile network = randomNetwork();
  network.domain = domainAround(nativeScan(1.0));
  LidarDriver driver = driverOf(network);
  const Proposal sure = proposeAt(driver, 1.0);
  ASSERT_GT(sure.confidence, parameters().sure);
  const double last = 0.99 * parameters().bridge_time;
  EXPECT_EQ(proposeForeignAt(driver, 1.0 + last).confidence, sure.confidence);
  EXPECT_LT(proposeForeignAt(driver, 1.01 + parameters().bridge_time).confidence, sure.confidence);
}

TEST(LidarDriver, ANetworkWithADomainOfOtherFeaturesIsRefused) {
  neural::NetworkFile network = randomNetwork();
  network.domain = domainAround(nativeScan(1.0));
  network.domain->meaning = "other";
  EXPECT_THROW(driverOf(network), config::ConfigError);
}

// ---- a network that answers what cannot be (RELIABILITY N1)

// Outputs of 3 and more, which are no probabilities, unless the truck is articulated.
neural::NetworkFile wildNetwork() {
  neural::NetworkFile network = randomNetwork();
  std::vector<double>& p = network.network.parameters();
  for (std::size_t i = p.size() - 31; i < p.size(); ++i) p[i] += 3.0;
  return network;
}

TEST(LidarDriver, OutputsOutOfRangeAreRefusedAndAfterThreeTheNetworkIsNoLongerListenedTo) {
  LidarDriver driver = driverOf(wildNetwork());
  for (const Refusal expected : {Refusal::kOutputs, Refusal::kOutputs, Refusal::kGivenUp}) {
    EXPECT_FALSE(proposeAt(driver, 1.0).valid);
    EXPECT_EQ(driver.refusal(), expected);
  }
}

TEST(WatchedInference, OutputsThatAreNoNumbersAreRefused) {
  WatchedInference inference(randomNetwork().network);
  std::vector<float> input(762, 0.1F);
  std::vector<float> output(31);
  ASSERT_EQ(inference.run(input.data(), output.data(), Stamp(0)), WatchedInference::Health::kGood);
  input[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(inference.run(input.data(), output.data(), Stamp(0)),
            WatchedInference::Health::kOutputRefused);
}

// Refuses outputs where `bad` says so, one run after the other; how often it had given up.
int runsGivenUp(WatchedInference& inference, const std::vector<bool>& bad) {
  int count = 0;
  std::vector<float> output(31);
  for (const bool is_bad : bad) {
    const std::vector<float> input(762, is_bad ? std::numeric_limits<float>::quiet_NaN() : 0.1F);
    const auto health = inference.run(input.data(), output.data(), Stamp(0));
    if (health == WatchedInference::Health::kGivenUp) ++count;
  }
  return count;
}

TEST(WatchedInference, ThreeRefusedOfTenGiveUpAndThreeOfElevenDoNot) {
  std::vector<bool> bad(20, false);
  bad[0] = bad[5] = bad[9] = true;
  WatchedInference within(randomNetwork().network);
  EXPECT_EQ(runsGivenUp(within, bad), 11);
  bad[9] = false;
  bad[10] = true;
  WatchedInference beyond(randomNetwork().network);
  EXPECT_EQ(runsGivenUp(beyond, bad), 0);
}

TEST(WatchedInference, AResetListensAgain) {
  WatchedInference inference(randomNetwork().network);
  EXPECT_EQ(runsGivenUp(inference, {true, true, true, false}), 2);
  inference.reset();
  EXPECT_EQ(runsGivenUp(inference, {false, true, true, false}), 0);
}

// ---- a network whose parameters are spoilt in memory (RELIABILITY N4)

void flipBit(float& value, int bit) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  bits ^= 1U << static_cast<unsigned>(bit);
  std::memcpy(&value, &bits, sizeof value);
}

TEST(LidarDriver, AFlippedBitIsFoundWithinAMinuteAndEndsItForGood) {
  LidarDriver driver = driverOf(randomNetwork());
  ASSERT_TRUE(proposeAt(driver, 1.0).valid);
  flipBit(LidarDriverAccess::parameter(driver, 100), 20);
  EXPECT_TRUE(proposeAt(driver, 60.9).valid);
  EXPECT_FALSE(proposeAt(driver, 61.1).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kCorrupted);
  driver.reset();
  EXPECT_FALSE(proposeAt(driver, 61.2).valid);
  EXPECT_EQ(driver.refusal(), Refusal::kCorrupted);
}

TEST(LidarDriver, AFlippedBitIsFoundInEveryLayerAndBias) {
  const std::size_t parameters = randomNetwork().network.parameters().size();
  int flipped = 0;
  for (std::size_t i = 0; i < parameters; i += 97) {
    LidarDriver driver = driverOf(randomNetwork());
    proposeAt(driver, 1.0);
    float& parameter = LidarDriverAccess::parameter(driver, i);
    if (parameter == 0.0F) continue;  // what only fills a vector up
    ++flipped;
    flipBit(parameter, 22);
    EXPECT_FALSE(proposeAt(driver, 61.1).valid) << i;
  }
  EXPECT_GT(flipped, 30);
}

TEST(LidarDriver, AHealthyNetworkPassesItsChecksForHours) {
  LidarDriver driver = driverOf(randomNetwork());
  for (double time = 1.0; time < 7200.0; time += 30.0) EXPECT_TRUE(proposeAt(driver, time).valid);
}

// ---- other lidars than the network's

struct Lidar {
  const char* name;
  double first, step;  // [deg]
  int beams;
};

class OtherLidar : public testing::TestWithParam<Lidar> {};

std::optional<Proposal> throughFilter(const geometry::Scan& scan) {
  perception::ScanFilter filter(
      perception::loadScanFilter(config::loadFile(kConfig + "scan_filter.yaml")));
  const auto& result = filter.filter(scan, {}, scan.stamp + std::chrono::milliseconds(10));
  if (!result.accepted) return std::nullopt;
  LidarDriver driver = driverOf(randomNetwork());
  const double time = toSeconds(scan.stamp);
  return driver.propose(result.network_scan, motionAt(time + 0.03), fromSeconds(time + 0.04));
}

TEST_P(OtherLidar, GivesNearlyTheSameProposal) {
  const Lidar& lidar = GetParam();
  const auto native = throughFilter(nativeScan(1.0, 0.4));
  const auto other = throughFilter(driftScan(1.0, lidar.first, lidar.step, lidar.beams, 0.4));
  const auto elsewhere = throughFilter(nativeScan(1.0, -0.4));
  ASSERT_TRUE(native && other && elsewhere);
  ASSERT_TRUE(native->valid && other->valid && elsewhere->valid);
  const double difference = std::abs(other->articulation_angle - native->articulation_angle);
  EXPECT_LT(difference, 0.002);
  EXPECT_LT(difference, 0.1 * std::abs(elsewhere->articulation_angle - native->articulation_angle))
      << "0.8 m further right";
}

INSTANTIATE_TEST_SUITE_P(Lidars, OtherLidar,
                         testing::Values(Lidar{"half_degree", -95.0, 0.5, 381},
                                         Lidar{"third_of_a_degree", -95.0, 1.0 / 3.0, 571},
                                         Lidar{"view_of_270_degrees", -135.0, 0.25, 1081},
                                         Lidar{"view_of_180_degrees", -90.0, 0.25, 721}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(LidarDriver, ALidarThatSeesLessThanNinetyDegreesToEitherSideGivesNoProposal) {
  EXPECT_FALSE(throughFilter(driftScan(1.0, -89.0, 0.25, 713)));
}

}  // namespace
}  // namespace tunnel_pilot::drivers
