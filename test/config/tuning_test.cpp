// What a request may change of a running stage, and what it may not.
#include "tunnel_pilot/config/tuning.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace tunnel_pilot::config {
namespace {

const std::vector<double> kStart = {7.0, 0.2};

Tuning speedAndMargin() {
  return {{{"speed", "m/s", 0.1, 15.0, true}, {"margin", "m", 0.0, 2.0, false}}, kStart};
}

void expectRefused(const Tuning::Request& request, bool only_tighten, const std::string& words) {
  Tuning tuning = speedAndMargin();
  const auto why = tuning.change(request, only_tighten);
  ASSERT_TRUE(why.has_value());
  EXPECT_NE(std::string::npos, why->find(words)) << *why;
  EXPECT_EQ(kStart, tuning.values());
}

TEST(Tuning, ChangesWhatIsAskedForAndNothingElse) {
  Tuning tuning = speedAndMargin();
  EXPECT_FALSE(tuning.change({{"margin", 0.1}}, false));
  EXPECT_EQ((std::vector<double>{7.0, 0.1}), tuning.values());
}

TEST(Tuning, UnknownNameIsRefused) { expectRefused({{"spede", 1.0}}, false, "spede"); }

TEST(Tuning, NameThatStandsTwiceIsRefused) {
  expectRefused({{"speed", 1.0}, {"speed", 2.0}}, false, "twice");
}

TEST(Tuning, ValueOutOfRangeIsRefusedWithUnitAndRange) {
  expectRefused({{"speed", 15.1}}, false, "speed: 15.1 is not in [0.1, 15] m/s");
}

TEST(Tuning, ValueThatIsNoNumberIsRefused) {
  expectRefused({{"speed", std::numeric_limits<double>::quiet_NaN()}}, false, "not in");
}

TEST(Tuning, OneBadValueSpoilsTheWholeRequest) {
  expectRefused({{"speed", 3.0}, {"margin", 5.0}}, false, "margin");
}

TEST(Tuning, UnderWayAHigherSpeedIsRefused) { expectRefused({{"speed", 7.1}}, true, "looser"); }

TEST(Tuning, UnderWayASmallerMarginIsRefused) { expectRefused({{"margin", 0.19}}, true, "looser"); }

TEST(Tuning, UnderWayOneLooserValueSpoilsTheTighterOne) {
  expectRefused({{"speed", 3.0}, {"margin", 0.1}}, true, "margin");
}

TEST(Tuning, UnderWayTighterAndUnchangedValuesAreTaken) {
  Tuning tuning = speedAndMargin();
  EXPECT_FALSE(tuning.change({{"speed", 3.0}, {"margin", 0.2}}, true));
  EXPECT_EQ((std::vector<double>{3.0, 0.2}), tuning.values());
}

// P2
TEST(Tuning, TenThousandRandomRequestsLeaveValuesInRangeThatNeverLoosenUnderWay) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const double bad[] = {std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::infinity(), -1.0, 1e300};
  const char* names[] = {"speed", "margin", "unknown", ""};
  Tuning tuning = speedAndMargin();
  int taken = 0;
  for (int i = 0; i < 10000; ++i) {
    Tuning::Request request;
    for (int k = engine() % 4; k > 0; --k) {
      const double value =
          uniform(engine) < 0.05 ? bad[engine() % 4] : 16.0 * uniform(engine) * uniform(engine);
      request.emplace_back(names[engine() % (uniform(engine) < 0.1 ? 4 : 2)], value);
    }
    const bool only_tighten = uniform(engine) < 0.5;
    const std::vector<double> before = tuning.values();
    taken += tuning.change(request, only_tighten) ? 0 : 1;
    const std::vector<double>& after = tuning.values();
    ASSERT_TRUE(after[0] >= 0.1 && after[0] <= 15.0 && after[1] >= 0.0 && after[1] <= 2.0) << i;
    ASSERT_TRUE(!only_tighten || (after[0] <= before[0] && after[1] >= before[1])) << i;
  }
  EXPECT_GT(taken, 1000);
}

}  // namespace
}  // namespace tunnel_pilot::config
