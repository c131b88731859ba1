// GNS in mixed precision on a GPU: gradient beside that of double precision, checkpoints, what is refused.
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/error.h"
#include "tests/gpu_only.h"
#include "tests/train/gns_cloud.h"
#include "tests/train/rounded_reference.h"
#include "train/networks/network_module.h"

namespace graupel::train {
namespace {

graph::GnsConfig wide_config(int64_t steps) {
  graph::GnsConfig config;
  config.message_passing = steps;
  config.radius = 0.08;
  return config;
}

/// Scenes with obstacle particles, one without neighbours; some 60 neighbours.
Batch three_scenes(const graph::GnsConfig& config) {
  return concatenate({random_cloud(config, 1, 500, 0.25, 90).scene, random_cloud(config, 2, 333, 0.2).scene,
                      random_cloud(config, 3, 5, 3, 2).scene});
}

TEST(RoundedReference, IsTheExactGradientOfGnsWhereNothingIsRounded) {
  graph::GnsConfig config = wide_config(2);
  config.latent = 16;
  const Batch batch = concatenate({random_cloud(config, 1, 60, 0.2, 9).scene, random_cloud(config, 3, 5, 3, 2).scene});
  NetworkModule exact(config, Device::cpu, 5, NumberType::f64);
  std::vector<double> expected;
  const double loss = exact.loss_and_gradient(batch, &expected);
  const RoundedReference reference = rounded_reference(config, 5, batch, {.rounds = false});
  EXPECT_NEAR(reference.loss, loss, 1e-12 * loss);
  expect_gradients_near(config, reference.gradient, expected, 1e-9);
}

TEST(FusedGns, GradientIsThatOfDoublePrecisionOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  check_mixed_gradient(wide_config(1), three_scenes(wide_config(1)));
  graph::GnsConfig config = wide_config(3);
  config.leaky_slope = 0.2;
  config.signed_distance = true;
  check_mixed_gradient(config, three_scenes(config));
}

TEST(FusedGns, GradientOfTheNetworkOfThePaperOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  check_mixed_gradient(wide_config(10), three_scenes(wide_config(10)));
}

TEST(FusedGns, CheckpointsChangeNoGradientOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const graph::GnsConfig config = wide_config(7);
  const Batch batch = three_scenes(config), other = concatenate({random_cloud(config, 9, 800, 0.2).scene});
  std::vector<double> expected, gradient, expected_other;
  NetworkModule keeps_all(config, Device::cuda, 5, NumberType::mixed);
  const double loss = keeps_all.loss_and_gradient(batch, &expected);
  keeps_all.loss_and_gradient(other, &expected_other);
  for (const int64_t layers : {1, 2, 3, 7, 20}) {
    NetworkModule module(config, Device::cuda, 5, NumberType::mixed, layers);
    EXPECT_EQ(module.loss_and_gradient(batch, &gradient), loss) << layers;
    EXPECT_EQ(gradient, expected) << layers;
    module.loss_and_gradient(other, &gradient);
    EXPECT_EQ(gradient, expected_other) << layers;
  }
}

TEST(FusedGns, SeveralHiddenLayersAreRefusedByName) {
  GRAUPEL_NEEDS_GPU();
  graph::GnsConfig config = wide_config(2);
  config.hidden_layers = 2;
  try {
    NetworkModule(config, Device::cuda, 1, NumberType::mixed);
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("mixed_precision=false"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(NetworkModule(config, Device::cuda, 1, NumberType::f32).is_mixed());
}

}  // namespace
}  // namespace graupel::train
