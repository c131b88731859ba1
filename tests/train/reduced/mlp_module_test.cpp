// The libtorch twin of the paper's networks computes what rom/ computes, and its gradients are those of its loss.
#include <gtest/gtest.h>

#include <cmath>

#include "rom/networks/conv_encoder.h"
#include "rom/networks/mlp_points.h"
#include "tests/train/gradient_check.h"
#include "tests/train/reduced/mlp_data.h"
#include "train/reduced/mlp/mlp_batches.h"

namespace graupel::train {
namespace {

constexpr int64_t snapshots = mlp_snapshots, points = mlp_points;

MlpBatch all_rows() {
  MlpBatch batch;
  for (int64_t i = 0; i < snapshots; ++i) batch.snapshots.push_back(i);
  for (int64_t i = 0; i < points; ++i) batch.points.push_back(i);
  return batch;
}

rom::Mlp engine_of(const MlpShape& shape, const nn::Weights& weights) {
  const auto same = [](int n) {
    const auto count = static_cast<std::size_t>(n);
    return rom::Standardization{std::vector<double>(count, 0.0), std::vector<double>(count, 1.0)};
  };
  return {rom::Mlp::load_layers(weights, "", shape.inputs(), shape.width, shape.outputs), same(shape.inputs()),
          same(shape.outputs)};
}

/// Largest difference of libtorch and the engine, over the size of the values.
template <typename T>
double parity(const MlpShape& shape) {
  const MlpModule module = module_of(shape, sizeof(T) == 8 ? NumberType::f64 : NumberType::f32);
  const rom::Mlp engine = engine_of(shape, module.state(MlpArray::weights));
  std::vector<int> order;
  for (int c = 0; c < shape.outputs; ++c) order.push_back(c);
  const rom::MlpPoints<T> bound(engine, noise(points * 3, 1), order);
  const auto width = static_cast<std::size_t>(shape.latents + shape.parameters);
  const std::vector<float> states = noise(snapshots * width, 2);
  const std::vector<double> expected = module.predict(all_rows());
  std::vector<T> tiles(80 * static_cast<std::size_t>(shape.outputs));
  double worst = 0, size = 0;
  for (std::size_t s = 0; s < snapshots; ++s) {
    const std::vector<double> state(states.begin() + static_cast<std::ptrdiff_t>(s * width),
                                    states.begin() + static_cast<std::ptrdiff_t>((s + 1) * width));
    bound.evaluate(state, tiles.data());
    for (std::size_t p = 0; p < points; ++p)
      for (std::size_t c = 0; c < order.size(); ++c) {
        const double want = expected[(s * points + p) * order.size() + c],
                     got = static_cast<double>(tiles[(p / 16 * order.size() + c) * 16 + p % 16]);
        worst = std::max(worst, std::abs(want - got));
        size = std::max(size, std::abs(want));
      }
  }
  return worst / size;
}

TEST(MlpParity, AllThreeNetworks) {
  for (const MlpShape& shape : {MlpShape{6, 0, 144, 3}, MlpShape{6, 1, 384, 6}, MlpShape{6, 1, 100, 9}}) {
    EXPECT_LT(parity<float>(shape), 1e-5) << shape.width;
    EXPECT_LT(parity<double>(shape), 1e-12) << shape.width;
  }
}

TEST(MlpParity, ConvolutionalEncoder) {
  const MlpShape shape{4, 0, 12, 3, 1000};
  const MlpModule module = module_of(shape, NumberType::f64);
  const nn::Weights weights = module.state(MlpArray::weights);
  nn::Weights file;
  for (const auto& [name, tensor] : weights.tensors)
    if (name.starts_with("encoder.")) file.tensors[name] = tensor;
  file.tensors["encoder.position.shift"] = nn::Tensor::from_float({0, 0, 0}, {3});
  file.tensors["encoder.position.scale"] = nn::Tensor::from_float({1, 1, 1}, {3});
  const rom::ConvEncoder encoder = rom::ConvEncoder::load(file, "encoder", 1000, 4);
  nn::Weights stored;
  encoder.store(stored, "encoder");
  const rom::ConvEncoder again = rom::ConvEncoder::load(stored, "encoder", 1000, 4);
  const std::vector<float> channels = noise(snapshots * 3 * 1000, 4);
  for (int64_t s = 0; s < snapshots; ++s) {
    std::vector<double> position(3000);
    for (std::size_t p = 0; p < 1000; ++p)
      for (std::size_t c = 0; c < 3; ++c)
        position[3 * p + c] = static_cast<double>(channels[static_cast<std::size_t>(s) * 3000 + 1000 * c + p]);
    const std::vector<double> expected = module.encode({s}), latent = encoder.encode(position);
    ASSERT_EQ(latent.size(), 4u);
    for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(latent[j], expected[j], 1e-12);
    EXPECT_EQ(again.encode(position), latent);
  }
}

void check_gradient(const MlpShape& shape) {
  MlpModule module = module_of(shape, NumberType::f64);
  MlpBatch batch;
  batch.snapshots = {0, 3, 4};
  batch.points = {5, 6, 66, 5};
  expect_slope_of_loss(module, batch);
}

TEST(MlpGradient, IsTheSlopeOfTheLoss) { check_gradient({4, 1, 20, 6}); }
TEST(MlpGradient, GoesThroughTheEncoder) { check_gradient({2, 0, 20, 3, 300}); }

TEST(MlpBatches, HaveEverySnapshotOnceAnEpoch) {
  MlpBatches batches(1, 0, 10, 1000, 4, 50);
  std::vector<int> seen(10, 0);
  for (int64_t step = 0; step < 5; ++step) {  // two epochs
    const MlpBatch batch = batches.batch(step);
    ASSERT_EQ(batch.snapshots.size(), 4u);
    ASSERT_EQ(batch.points.size(), 50u);
    for (const int64_t s : batch.snapshots) ++seen[static_cast<std::size_t>(s)];
    for (const int64_t p : batch.points) EXPECT_TRUE(p >= 0 && p < 1000);
  }
  EXPECT_EQ(seen, std::vector<int>(10, 2));
  MlpBatches again(1, 0, 10, 1000, 4, 50), other(1, 1, 10, 1000, 4, 50);
  EXPECT_EQ(again.batch(3).points, batches.batch(3).points);
  EXPECT_EQ(again.batch(3).snapshots, batches.batch(3).snapshots);
  EXPECT_NE(other.batch(3).points, batches.batch(3).points);
  EXPECT_EQ(MlpBatches(1, 0, 10, 3, 4, 50).batch(7).points, (std::vector<int64_t>{0, 1, 2}));
}

}  // namespace
}  // namespace graupel::train
