// The bound on a run's error from the interpolation of training runs holds where these bend, in and out of their range.
#include "rom/interpolation_bound.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/rom/deformation_model.h"

namespace graupel::rom {
namespace {

constexpr int frames = 6;

/// How far the body has moved along x in a frame.
double path(double parameter, double frame) { return 0.02 * frame * (1 + 0.02 * parameter * parameter); }

/// A block that moves as a whole; one latent for each axis, runs of these parameters.
ReducedModel moving_model(const std::vector<float>& parameters) {
  const Scene scene = test::jelly_block("[0, 0, 0]");
  ReducedModel model = test::deformation_model(scene, test::linear_network(test::translation()), {0, 0, 0});
  model.parameters = {{"p", "", {"gravity.0"}, 0, 1}};
  model.run_parameters = parameters;
  model.training_latents.clear();
  for (std::size_t run = 0; run < parameters.size(); ++run)
    for (int f = 0; f < frames; ++f) {
      const auto x = static_cast<float>(path(static_cast<double>(parameters[run]), f));
      model.training_latents.insert(model.training_latents.end(), {x, 0, 0});
      model.training_run.push_back(static_cast<int32_t>(run));
    }
  if (const auto curvature = interpolation_curvature(model)) model.interpolation = {0, *curvature};
  return model;
}

/// Of a run that goes `wrong` times as far as the truth.
double bound_of(const ReducedModel& model, double parameter, double wrong) {
  auto bound = InterpolationBound::of(model, parameter);
  for (int f = 1; f < frames; ++f) bound->add({wrong * path(parameter, f), 0, 0}, f * model.frame_time);
  return bound->value().value();
}

TEST(InterpolationBound, CurvatureIsThatOfTheTrainingRuns) {
  const ReducedModel model = moving_model({3, 0, 2, 1});  // in no order
  ASSERT_TRUE(model.interpolation);
  EXPECT_NEAR(model.interpolation->curvature, 0.04 / 1.02, 1e-3);  // of the run at 1, over its displacement
  const ReducedModel uneven = moving_model({0, 1, 3});
  EXPECT_NEAR(uneven.interpolation->curvature, 0.04 / 1.02, 1e-3);
}

TEST(InterpolationBound, HoldsInAndOutOfTheRange) {
  const ReducedModel model = moving_model({0, 1, 2, 3});
  for (const double parameter : {0.0, 0.3, 1.5, 2.9, 4.0, 6.0, -2.0})
    for (const double wrong : {1.0, 0.9, 1.02, 1.3}) {
      const double error = std::abs(wrong - 1), bound = bound_of(model, parameter, wrong);
      EXPECT_GE(bound, error - 1e-4) << parameter << ' ' << wrong;
      if (parameter >= 0 && parameter <= 3) {
        EXPECT_LE(bound, error + 0.02) << parameter << ' ' << wrong;
      }
    }
  EXPECT_GT(bound_of(model, 6, 1), 0.3) << "nobody knows how the runs go on";
}

TEST(InterpolationBound, CountsWhatTheModesMiss) {
  ReducedModel model = moving_model({0, 1, 2});
  const double without = bound_of(model, 0.5, 1);
  model.interpolation->reconstruction = 0.03;
  EXPECT_NEAR(bound_of(model, 0.5, 1), without + 0.03, 1e-9);
}

TEST(InterpolationBound, IsUnknownWithoutALine) {
  EXPECT_FALSE(interpolation_curvature(moving_model({0, 1})));
  EXPECT_FALSE(InterpolationBound::of(moving_model({0, 1}), 0.5));
  EXPECT_FALSE(interpolation_curvature(moving_model({0, 1, 1}))) << "two runs of one parameter";
  ReducedModel other_lengths = moving_model({0, 1, 2});
  other_lengths.training_run.back() = 3;
  EXPECT_FALSE(interpolation_curvature(other_lengths));
  ReducedModel two = moving_model({0, 1, 2});
  two.parameters.push_back(two.parameters.front());
  EXPECT_FALSE(InterpolationBound::of(two, 0.5));

  const ReducedModel model = moving_model({0, 1, 2});
  auto bound = InterpolationBound::of(model, 0.5);
  ASSERT_TRUE(bound);
  EXPECT_FALSE(bound->value()) << "before the first frame";
  bound->add({path(0.5, 1.5), 0, 0}, 1.5 * model.frame_time);  // between two snapshots
  EXPECT_LT(bound->value().value(), 0.03);
  bound->add({path(0.5, frames), 0, 0}, frames * model.frame_time);
  EXPECT_FALSE(bound->value()) << "beyond the time of the training";
}

TEST(InterpolationBound, IsInTheFile) {
  ReducedModel model = moving_model({0, 1, 2});
  model.interpolation->reconstruction = 0.01;
  const ReducedModel stored = ReducedModel::load(model.store(nn::DType::f32));
  ASSERT_TRUE(stored.interpolation);
  EXPECT_EQ(stored.interpolation->curvature, model.interpolation->curvature);
  EXPECT_EQ(stored.interpolation->reconstruction, 0.01);
  model.interpolation.reset();
  EXPECT_FALSE(ReducedModel::load(model.store(nn::DType::f32)).interpolation);
}

}  // namespace
}  // namespace graupel::rom
