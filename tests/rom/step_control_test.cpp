// Which steps of a reduced run are taken back, and when they grow again.
#include "rom/solver/step_control.h"

#include <gtest/gtest.h>

namespace graupel::rom {
namespace {

constexpr double negligible = 0.01;

TEST(StepControl, KeepsStepsLikeThoseBefore) {
  StepControl control(2);
  for (int i = 0; i < 40; ++i) {
    EXPECT_TRUE(control.keep(1 + 0.02 * i, negligible, 0));  // grows slowly
    EXPECT_EQ(control.length(), 4);
  }
  EXPECT_TRUE(control.keep(2.0, negligible, 0.05));
}

TEST(StepControl, TakesBackJumpsUntilTheShortestStep) {
  StepControl control(2);
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(control.keep(1, negligible, 0));
  EXPECT_FALSE(control.keep(3, negligible, 0));
  EXPECT_EQ(control.length(), 2);
  EXPECT_FALSE(control.keep(3, negligible, 0));
  EXPECT_EQ(control.length(), 1);
  EXPECT_FALSE(control.can_halve());
  EXPECT_TRUE(control.keep(3, negligible, 0));  // no way out
  control.lengthen_if_due();
  EXPECT_EQ(control.length(), 1) << "a bad step is not among the good ones";
}

TEST(StepControl, LengthensAfterGoodSteps) {
  StepControl control(1);
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(control.keep(1, negligible, 0));
  ASSERT_FALSE(control.keep(9, negligible, 0));
  int steps = 0;
  while (control.length() == 1 && steps < 100) {
    ASSERT_TRUE(control.keep(1, negligible, 0));
    ++steps;
    control.lengthen_if_due();
  }
  EXPECT_EQ(control.length(), control.longest());
  EXPECT_GE(steps, 2);
  EXPECT_LT(steps, 20);
}

TEST(StepControl, LostSamplesAndFailuresCountFromTheStart) {
  StepControl control(3);
  EXPECT_TRUE(control.keep(100, negligible, 0)) << "nothing is usual yet";
  EXPECT_FALSE(control.keep(1, negligible, 0.1));
  control.halve();
  EXPECT_EQ(control.length(), 2);
}

TEST(StepControl, WhatIsNegligibleIsKept) {
  StepControl control(1);
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(control.keep(1e-6, negligible, 0));
  EXPECT_TRUE(control.keep(0.9 * negligible, negligible, 0));
  StepControl never(0);
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(never.keep(1, negligible, 0));
  EXPECT_TRUE(never.keep(1e6, negligible, 1));
}

}  // namespace
}  // namespace graupel::rom
