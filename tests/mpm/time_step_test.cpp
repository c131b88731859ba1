#include "mpm/solver/time_step.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/system/error.h"

namespace graupel::mpm {
namespace {

constexpr double dx = 0.01, frame = 1.0 / 60;

TEST(TimeStep, FixedStepsShareTheFrame) {
  TimeStep policy{.policy = StepPolicy::fixed, .substeps_per_frame = 54};
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {100, 100}), frame / 54);
}

TEST(TimeStep, StepsOfAFrameFollowItsFastestBodyAndNotItsWaves) {
  const TimeStep policy{.policy = StepPolicy::per_frame, .substeps_per_frame = 8, .courant = 0.25};
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {0.5, 100}), frame / 8);
  // (2 + 0.5 + 0.2) m/s cross 4.5 cells in the frame: 18 steps of a quarter.
  StateSpeeds fast{.speed = 2, .sound_speed = 100, .scripted = 0.5, .fall = 0.2};
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, fast), frame / 18);
  fast.speed = std::numeric_limits<double>::infinity();
  EXPECT_THROW(largest_step(policy, dx, frame, fast), DivergedError);
}

TEST(TimeStep, AdaptiveStepFollowsSpeedAndSoundUpToItsLimit) {
  TimeStep policy{.policy = StepPolicy::adaptive, .courant = 0.5, .max_step = 1e-3};
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {3, 17}), 0.5 * dx / 20);
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {0, 0}), 1e-3);
  policy.max_step = 1;
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {0, 0.01}), frame);
}

TEST(TimeStep, ScriptedBodiesCountAndTheLowerLimitHolds) {
  TimeStep policy{.policy = StepPolicy::adaptive, .courant = 0.5, .max_step = 1e-3};
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {3, 17, 0, 5}), 0.5 * dx / 25);
  policy.min_step = 4e-4;
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {3, 17, 0, 5}), 4e-4);
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {0, 1}), 1e-3);
  EXPECT_DOUBLE_EQ(suggested_step(dx, {0, 10, 0, 10}, 1e-3), 0.3 * dx / 20);
}

TEST(TimeStep, ViscosityLimitsTheStepAsExplicitDiffusionDoes) {
  const TimeStep policy{.policy = StepPolicy::adaptive, .courant = 0.5, .max_step = 1};
  EXPECT_DOUBLE_EQ(largest_step(policy, dx, frame, {0, 0, 0.1}), dx * dx / (6 * 0.1));
  const double wave = 0.5 * dx / 20, both = largest_step(policy, dx, frame, {3, 17, 0.1});
  EXPECT_DOUBLE_EQ(1 / both, 1 / wave + 6 * 0.1 / (dx * dx));
}

TEST(TimeStep, TheRestOfAFrameIsSharedEqually) {
  const TimeStep policy{.policy = StepPolicy::adaptive, .courant = 0.5, .max_step = 1e-3};
  EXPECT_DOUBLE_EQ(next_step(policy, dx, frame, {0, 0}, 2.5e-3), 2.5e-3 / 3);
  EXPECT_DOUBLE_EQ(next_step(policy, dx, frame, {0, 0}, 0.4e-3), 0.4e-3);
}

TEST(TimeStep, AnEndlessFrameIsReportedAsDiverged) {
  const TimeStep policy{.policy = StepPolicy::adaptive, .courant = 0.5, .max_step = 1};
  EXPECT_THROW(next_step(policy, dx, frame, {0, 1e9}, frame), DivergedError);
  EXPECT_THROW(next_step(policy, dx, frame, {0, std::numeric_limits<double>::infinity()}, frame), DivergedError);
}

TEST(TimeStep, AnEndlessFrameOfTheUsersOwnIsAMistakeOfItsKey) {
  const auto message = [](const TimeStep& policy) {
    try {
      next_step(policy, dx, frame, {1, 20}, frame);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message({.policy = StepPolicy::adaptive, .max_step = 1e-12}).find("max_step = 1e-12"), std::string::npos);
  EXPECT_NE(message({.policy = StepPolicy::adaptive, .courant = 1e-9}).find("courant = 1e-09"), std::string::npos);
}

TEST(TimeStep, SuggestionsAreFiniteAndSmaller) {
  EXPECT_DOUBLE_EQ(suggested_step(dx, {0, 20}, 1e-3), 0.3 * dx / 20);
  EXPECT_DOUBLE_EQ(suggested_step(dx, {0, 1e9}, 1e-3), 1e-3 / 8);
  EXPECT_DOUBLE_EQ(suggested_step(dx, {0, std::numeric_limits<double>::infinity()}, 1e-3), 1e-3 / 8);
  EXPECT_DOUBLE_EQ(suggested_step(dx, {0, 0}, 1e-3), 1e-3 / 8);
}

}  // namespace
}  // namespace graupel::mpm
