// The verdict on reduced runs: silent on what is usual, not on what leaves it; and the share of foreign materials.
#include "rom/solver/error_indicator.h"

#include <gtest/gtest.h>

#include <cmath>

#include "rom/solver/material_difference.h"

namespace graupel::rom {
namespace {

/// Runs like those of a training: the residual is large in the first frames, and every run differs a little.
std::vector<ErrorIndicator> usual_run(int seed) {
  std::vector<ErrorIndicator> frames;
  for (int f = 0; f < 30; ++f) {
    const double wave = 1 + 0.3 * std::sin(f + 2.0 * seed);
    frames.push_back({(f < 2 ? 0.6 : 0.02) * wave, 0.1 * wave, 0.2 * wave});
  }
  return frames;
}

ErrorIndicatorRecord record_of(const TrustLevels& usual, const std::vector<ErrorIndicator>& run) {
  ErrorIndicatorRecord record(usual);
  for (const ErrorIndicator& frame : run) record.add(frame);
  return record;
}

class Trust : public testing::Test {
 protected:
  const TrustLevels usual_ = usual_levels({usual_run(0), usual_run(1), usual_run(2)});
};

TEST_F(Trust, IsSilentOnTheRunsThatItWasCalibratedOn) {
  for (int seed = 0; seed < 3; ++seed) {
    const ErrorIndicatorRecord record = record_of(usual_, usual_run(seed));
    EXPECT_LE(record.number(), 1) << seed;
    EXPECT_GT(record.number(), 0.3) << seed;
    EXPECT_EQ(record.verdict(), Verdict::ok) << seed;
  }
}

TEST_F(Trust, GrowsWithEachIndicator) {
  for (const auto indicator :
       {&ErrorIndicator::residual, &ErrorIndicator::down_weighted, &ErrorIndicator::latent_distance}) {
    std::vector<ErrorIndicator> run = usual_run(0);
    for (std::size_t f = 15; f < run.size(); ++f) run[f].*indicator = 2 * usual_[f].*indicator;
    EXPECT_EQ(record_of(usual_, run).verdict(), Verdict::doubtful);
    EXPECT_NEAR(record_of(usual_, run).number(), 2, 1e-9);
    for (std::size_t f = 15; f < run.size(); ++f) run[f].*indicator *= 5;
    EXPECT_EQ(record_of(usual_, run).verdict(), Verdict::do_not_trust);
  }
}

TEST_F(Trust, OneFrameAloneTellsLittle) {
  std::vector<ErrorIndicator> run = usual_run(1);
  run[20].residual = 2.5 * usual_[20].residual;
  EXPECT_EQ(record_of(usual_, run).verdict(), Verdict::ok);
}

TEST_F(Trust, LongerRunsAreHeldAgainstTheLastFrame) {
  std::vector<ErrorIndicator> run = usual_run(0);
  run.insert(run.end(), 20, usual_.back());
  EXPECT_EQ(record_of(usual_, run).verdict(), Verdict::ok);
  run.insert(run.end(), 20, {10 * usual_.back().residual, 0, 0});
  EXPECT_EQ(record_of(usual_, run).verdict(), Verdict::do_not_trust);
}

TEST_F(Trust, FailuresAndUnknownModels) {
  ErrorIndicatorRecord failed = record_of(usual_, usual_run(0));
  failed.diverged();
  EXPECT_EQ(failed.verdict(), Verdict::do_not_trust);
  EXPECT_EQ(record_of({}, usual_run(0)).verdict(), Verdict::unknown);
  EXPECT_TRUE(usual_levels({}).empty());
  ErrorIndicatorRecord foreign(usual_, 4 * ErrorIndicatorRecord::usual_material_difference);
  for (int f = 0; f < ErrorIndicatorRecord::window; ++f) foreign.add({});
  EXPECT_EQ(foreign.verdict(), Verdict::do_not_trust);
}

TEST_F(Trust, ModelsThatMissTheirOwnTrainingRunsAreNotTrusted) {
  const auto verdict_of = [&](double training_error) {
    ErrorIndicatorRecord record(usual_, 0, training_error);
    for (const ErrorIndicator& frame : usual_run(0)) record.add(frame);
    return record.verdict();
  };
  EXPECT_EQ(verdict_of(0.04), Verdict::ok);
  EXPECT_EQ(verdict_of(0.06), Verdict::doubtful);
  EXPECT_EQ(verdict_of(0.3), Verdict::do_not_trust);
}

/// What the error is at most says more than how usual the frames are; nothing is known of other scenes.
TEST_F(Trust, ABoundOnTheErrorDecides) {
  const auto verdict_of = [&](std::optional<double> bound, bool foreign = false) {
    ErrorIndicatorRecord record(usual_, 0, 0.3);
    for (const ErrorIndicator& frame : usual_run(0)) record.add(frame);
    record.set_bound(bound);
    if (foreign) record.foreign_scene();
    return record.verdict();
  };
  EXPECT_EQ(verdict_of({}), Verdict::do_not_trust);
  EXPECT_EQ(verdict_of(0.04), Verdict::ok);
  EXPECT_EQ(verdict_of(0.04, true), Verdict::doubtful);
  EXPECT_EQ(verdict_of(0.06), Verdict::doubtful);
  EXPECT_EQ(verdict_of(0.3), Verdict::do_not_trust);
  ErrorIndicatorRecord other_materials(usual_, 4 * ErrorIndicatorRecord::usual_material_difference);
  other_materials.set_bound(0.01);
  EXPECT_EQ(other_materials.verdict(), Verdict::do_not_trust);
}

/// Two materials, the second one in `share` of ten particles.
struct Body {
  Scene scene;
  mpm::SampledParticles particles;
  Body(int others, double stiffer, double denser = 1) {
    MaterialConfig jelly;
    jelly.model = MaterialModel::jelly;
    jelly.density = 1000;
    jelly.youngs_modulus = 1e5;
    jelly.poissons_ratio = 0.3;
    scene.materials["a"] = jelly;
    jelly.youngs_modulus *= stiffer;
    jelly.density *= denser;
    scene.materials["b"] = jelly;
    particles.material_names = {"a", "b"};
    for (int p = 0; p < 10; ++p) {
      particles.position.push_back({0.1 * p, 0, 0});
      particles.volume.push_back(1);
      particles.material.push_back(p < others ? 1 : 0);
    }
  }
};

TEST(MaterialDifference, IsTheShareOfTheBodyThatAnswersOtherwise) {
  const auto difference = [](const Body& a, const Body& b) {
    return material_difference(a.scene, a.particles, b.scene, b.particles);
  };
  EXPECT_EQ(difference(Body(0, 10), Body(0, 10)), 0);
  EXPECT_EQ(difference(Body(4, 1), Body(0, 1)), 0);                // another name for the same material
  EXPECT_NEAR(difference(Body(4, 10), Body(0, 10)), 0.36, 1e-9);   // 4 of 10 particles, nine tenths of the stress
  EXPECT_NEAR(difference(Body(5, 1, 2), Body(0, 1)), 0.25, 1e-9);  // half of the density of half of the body
  EXPECT_NEAR(difference(Body(4, 10), Body(2, 10)), 0.18, 1e-9);
}

}  // namespace
}  // namespace graupel::rom
