#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/learning/human_drives.h"
#include "tunnel_pilot/simulation/scenario.h"

namespace tunnel_pilot::learning {
namespace {

HumanHabit withoutWeave() {
  HumanHabit habit;
  habit.weave = 0.0;
  return habit;
}

geometry::Path bend(double curvature) {
  return geometry::buildPath({{40.0, 0.0, 0.0},
                              {10.0, 0.0, curvature},
                              {20.0, curvature, curvature},
                              {10.0, curvature, 0.0},
                              {60.0, 0.0, 0.0}},
                             {}, 0.25);
}

TEST(HumanLine, LiesInsideOfBendsOnEitherSide) {
  for (const double curvature : {1.0 / 14.0, -1.0 / 14.0}) {
    const geometry::Path line = bend(curvature);
    const geometry::Path his = humanLine(line, withoutWeave(), 1000);
    const double middle = line.project(geometry::Point(his.at(60.0).x, his.at(60.0).y)).lateral_offset;
    EXPECT_NEAR(middle * std::copysign(1.0, curvature),
                withoutWeave().most * std::tanh(withoutWeave().cut / withoutWeave().most), 0.01);
    EXPECT_NEAR(line.project(geometry::Point(his.at(10.0).x, his.at(10.0).y)).lateral_offset, 0.0, 1e-3);
  }
}

TEST(HumanLine, TurnsInBeforeTheBend) {
  const geometry::Path line = bend(1.0 / 14.0);
  const geometry::Path his = humanLine(line, withoutWeave(), 1000);
  EXPECT_GT(line.project(geometry::Point(his.at(40.0).x, his.at(40.0).y)).lateral_offset, 0.03);
}

TEST(HumanLine, WandersDifferentlyWithEachSeedAndNeverTooFar) {
  const geometry::Path line = bend(1.0 / 14.0);
  HumanHabit habit;
  double difference = 0.0;
  const geometry::Path a = humanLine(line, habit, 1000);
  const geometry::Path b = humanLine(line, habit, 1001);
  for (double s = 5.0; s < 130.0; s += 1.0) {
    const double left = line.project(geometry::Point(a.at(s).x, a.at(s).y)).lateral_offset;
    EXPECT_LT(std::abs(left), habit.most);
    difference = std::max(
        difference, std::abs(left - line.project(geometry::Point(b.at(s).x, b.at(s).y)).lateral_offset));
  }
  EXPECT_GT(difference, 0.1);
}

class HumanDrives : public ::testing::Test {
 protected:
  const simulation::Scenario scenario_ =
      simulation::loadScenario(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/scenarios/unseen_drifts.yaml");
  const simulation::Setup setup_ = simulation::loadSetup(scenario_);
};

TEST_F(HumanDrives, HeCutsBendsBothWaysWithoutTouchingAWall) {
  double inside = 0.0;
  for (const bool reversed : {false, true}) {
    const HumanDrive drive = driveAsHuman(scenario_, setup_, {1000, reversed}, HumanHabit(), 4);
    EXPECT_EQ(drive.metrics.at("contacts"), 0.0);
    EXPECT_GT(drive.metrics.at("distance"), 150.0);
    EXPECT_GT(drive.lessons.size(), 400U);
    inside += 0.5 * drive.metrics.at("inside_mean");
  }
  EXPECT_GT(inside, 0.20);
  EXPECT_LT(inside, 0.36);
}

// The correction points out of the bends, on the mean: he is inside.
TEST_F(HumanDrives, CorrectedLabelsSteerOutOfHisCut) {
  const HumanDrive drive = driveAsHuman(scenario_, setup_, {1002, false}, withoutWeave(), 4);
  double outwards = 0.0;
  int count = 0;
  for (const Lesson& lesson : drive.lessons) {
    if (!lesson.correction || std::abs(lesson.example.label) < 0.15F) continue;
    outwards -= static_cast<double>(*lesson.correction * std::copysign(1.0F, lesson.example.label));
    ++count;
  }
  ASSERT_GT(count, 50);
  EXPECT_GT(outwards / count, 0.02);
}

TEST_F(HumanDrives, ADriveIsTheSameEachTime) {
  const HumanDrive a = driveAsHuman(scenario_, setup_, {1001, false}, HumanHabit(), 50);
  const HumanDrive b = driveAsHuman(scenario_, setup_, {1001, false}, HumanHabit(), 50);
  ASSERT_EQ(a.lessons.size(), b.lessons.size());
  for (std::size_t i = 0; i < a.lessons.size(); ++i) {
    EXPECT_EQ(a.lessons[i].example.label, b.lessons[i].example.label);
    EXPECT_EQ(a.lessons[i].correction, b.lessons[i].correction);
  }
}

TEST_F(HumanDrives, OnlyOpenDrivesAreHis) {
  simulation::Scenario turn = scenario_;
  turn.experiment = simulation::SteadyTurnExperiment{};
  EXPECT_THROW(driveAsHuman(turn, setup_, {1000, false}, HumanHabit(), 1), std::invalid_argument);
}

TEST(ExamplesOf, CorrectedOnesLeaveOutWhatCouldNotBe) {
  std::vector<Lesson> lessons(2);
  lessons[0].example.label = 0.1F;
  lessons[1].example.label = 0.2F;
  lessons[1].correction = -0.05F;
  EXPECT_EQ(examplesOf(lessons, false).size(), 2U);
  EXPECT_EQ(examplesOf(lessons, false)[1].label, 0.2F);
  ASSERT_EQ(examplesOf(lessons, true).size(), 1U);
  EXPECT_FLOAT_EQ(examplesOf(lessons, true)[0].label, 0.15F);
}

TEST(ExamplesOf, CorrectedOnesAreAsManyInsideAsOutsideOfBends) {
  std::vector<Lesson> lessons;
  for (int i = 0; i < 1000; ++i) {
    Lesson lesson;
    const float side = i % 2 == 0 ? 1.0F : -1.0F;
    lesson.example.label = 0.3F * side;
    lesson.correction = 0.0F;
    lesson.offset = (i < 700 ? 0.3F : -0.3F) * side;
    lesson.example.speed = lesson.offset * side;
    lessons.push_back(lesson);
  }
  int inside = 0, outside = 0;
  for (const Example& example : examplesOf(lessons, true)) ++(example.speed > 0.0F ? inside : outside);
  EXPECT_EQ(outside, 300);
  EXPECT_NEAR(inside, 300, 1);
  EXPECT_EQ(examplesOf(lessons, false).size(), 1000U);
}

}  // namespace
}  // namespace tunnel_pilot::learning
