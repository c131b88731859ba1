// The paper's networks as fields: derivatives, both precisions, files, and rollouts of a network that is exact.
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "mpm/simulation.h"
#include "rom/fields/mlp_fields.h"
#include "rom/networks/mlp_points.h"
#include "rom/reduced_solver.h"
#include "tests/apps/falling_model.h"
#include "tests/rom/random_network.h"

namespace graupel::rom {
namespace {

using test::random_network;

double noise(uint64_t i) { return test::network_noise(i); }

Mlp::Rows random_rows(Eigen::Index rows, Eigen::Index columns) {
  Mlp::Rows z(rows, columns);
  for (Eigen::Index i = 0; i < z.size(); ++i) z.data()[i] = 0.7 * noise(static_cast<uint64_t>(9000 + i));
  return z;
}

TEST(Mlp, DerivativesAreTheSlopesOfTheValues) {
  const Mlp net = random_network(10, 24, 6, 1);  // X, r = 6, one parameter
  const Mlp::Rows z = random_rows(5, 10);
  Mlp::Rows y, jacobian, plain;
  net.evaluate(z, y, jacobian);
  net.evaluate(z, plain);
  EXPECT_EQ(y, plain);
  constexpr double h = 1e-5;
  for (Eigen::Index i = 0; i < z.cols(); ++i) {
    Mlp::Rows up = z, down = z, at_up, at_down;
    up.col(i).array() += h;
    down.col(i).array() -= h;
    net.evaluate(up, at_up);
    net.evaluate(down, at_down);
    const Mlp::Rows slope = (at_up - at_down) / (2 * h);
    for (Eigen::Index r = 0; r < z.rows(); ++r)
      for (Eigen::Index c = 0; c < 6; ++c)
        EXPECT_NEAR(jacobian(6 * r + c, i), slope(r, c), 1e-7 * (1 + std::abs(slope(r, c))))
            << i << " " << r << " " << c;
  }
}

TEST(Mlp, ForwardAndReverseDerivativesAgree) {
  const Mlp net = random_network(7, 24, 32, 6);
  const Mlp::Rows z = random_rows(1, 7);
  Mlp::Rows y, jacobian, forward, slopes;
  net.evaluate(z, y, jacobian);
  net.tangents(z, 6, forward, slopes);
  ASSERT_EQ(slopes.rows(), 6);
  EXPECT_LT((forward - y).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((slopes.transpose() - jacobian.leftCols(6)).cwiseAbs().maxCoeff(), 1e-12);
}

/// Widths that are no multiple of the kernel's panels, and more points than a block.
TEST(Mlp, PointsInTilesAgreeWithRows) {
  const Mlp net = random_network(3 + 4 + 1, 50, 6, 2);
  const std::vector<int> order = {0, 3, 5, 1, 2, 4};
  std::vector<float> points;
  for (int i = 0; i < 3 * 139; ++i) points.push_back(static_cast<float>(noise(static_cast<uint64_t>(i))));
  const std::vector<double> state = {0.3, -0.5, 0.9, 0.1, -0.7};
  Mlp::Rows z(139, 8), y;
  for (Eigen::Index r = 0; r < 139; ++r)
    for (Eigen::Index i = 0; i < 8; ++i)
      z(r, i) = i < 3 ? static_cast<double>(points[static_cast<std::size_t>(3 * r + i)])
                      : state[static_cast<std::size_t>(i - 3)];
  net.evaluate(z, y);
  std::vector<float> single(144 * 6, -1), some(3 * 16 * 6, -1);
  std::vector<double> twice(144 * 6, -1);
  MlpPoints<float>(net, points, order).evaluate(state, single.data());
  MlpPoints<double>(net, points, order).evaluate(state, twice.data());
  MlpPoints<float>(net, points, order).evaluate(state, {1, 5, 8}, some.data());
  for (std::size_t i = 0; i < 96; ++i) {
    EXPECT_EQ(some[i], single[96 + i]);
    EXPECT_EQ(some[96 + i], single[5 * 96 + i]);
    EXPECT_EQ(some[2 * 96 + i], single[8 * 96 + i]);
  }
  for (int64_t slot = 0; slot < 144; ++slot)
    for (int64_t c = 0; c < 6; ++c) {
      const auto at = static_cast<std::size_t>((slot / 16 * 6 + c) * 16 + slot % 16);
      const double expected = slot < 139 ? y(slot, order[static_cast<std::size_t>(c)]) : 0;
      EXPECT_NEAR(static_cast<double>(single[at]), expected, 2e-5) << slot << " " << c;
      EXPECT_NEAR(twice[at], expected, 1e-12) << slot << " " << c;
    }
}

TEST(Mlp, SurvivesAFileAndNamesWhatIsWrong) {
  const Mlp net = random_network(8, 16, 9, 3);
  nn::Weights weights;
  weights.file = "net.safetensors";
  net.store(weights, "affine");
  const Mlp again = Mlp::load(weights, "affine", 8, 9);
  const Mlp::Rows z = random_rows(3, 8);
  Mlp::Rows y, stored;
  net.evaluate(z, y);
  again.evaluate(z, stored);
  EXPECT_EQ(y, stored);
  const auto message = [&](const auto& damage) {
    nn::Weights damaged = weights;
    damage(damaged);
    try {
      Mlp::load(damaged, "affine", 8, 9);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  const std::string missing = message([](nn::Weights& w) { w.tensors.erase("affine.layer3.bias"); });
  EXPECT_TRUE(has(missing, "net.safetensors") && has(missing, "'affine.layer3.bias'")) << missing;
  const std::string first = message([](nn::Weights& w) { w.tensors.erase("affine.layer0.weight"); });
  EXPECT_TRUE(has(first, "net.safetensors") && has(first, "'affine.layer0.weight'")) << first;
  const std::string shape = message([](nn::Weights& w) {
    w.tensors["affine.layer2.weight"] = nn::Tensor::from_float(std::vector<float>(16 * 15), {16, 15});
  });
  EXPECT_TRUE(has(shape, "'affine.layer2.weight'") && has(shape, "[16, 15]") && has(shape, "[16, 16]")) << shape;
  const std::string infinite = message([](nn::Weights& w) {
    w.tensors["affine.layer5.bias"] = nn::Tensor::from_float(std::vector<float>(9, INFINITY), {9});
  });
  EXPECT_TRUE(has(infinite, "'affine.layer5.bias'") && has(infinite, "damaged")) << infinite;
  const std::string zero = message(
      [](nn::Weights& w) { w.tensors["affine.output.scale"] = nn::Tensor::from_float(std::vector<float>(9), {9}); });
  EXPECT_TRUE(has(zero, "'affine.output.scale'") && has(zero, "allowed")) << zero;
  const std::string wide = message([](nn::Weights& w) {
    w.tensors["affine.layer0.weight"] = nn::Tensor::from_float({}, {0, 8});
  });
  EXPECT_TRUE(has(wide, "0 hidden units")) << wide;
}

TEST(ConvEncoder, HasAsManyConvolutionsAsItsParticlesNeed) {
  EXPECT_EQ(ConvEncoder::lengths(12), (std::vector<int64_t>{12}));
  EXPECT_EQ(ConvEncoder::lengths(13), (std::vector<int64_t>{13, 2}));
  EXPECT_EQ(ConvEncoder::lengths(10000), (std::vector<int64_t>{10000, 2499, 624, 155, 38, 9}));
}

/// Moves by q along y, exactly: hidden units that stay above 0, where ELU is the identity, carry q + 1.
Mlp sliding(int inputs, int outputs, float slope) {
  std::vector<MlpLayer> layers;
  for (int l = 0; l < Mlp::layer_count; ++l) {
    MlpLayer layer;
    layer.in = l == 0 ? inputs : 2;
    layer.out = l == Mlp::hidden_layers ? outputs : 2;
    layer.weight.assign(static_cast<std::size_t>(layer.in * layer.out), 0.0f);
    layer.bias.assign(static_cast<std::size_t>(layer.out), 0.0f);
    layers.push_back(layer);
  }
  layers[0].weight[3] = 1;
  layers[0].bias[0] = 1;
  for (std::size_t l = 1; l < Mlp::hidden_layers; ++l) layers[l].weight[0] = 1;
  if (slope != 0) {
    layers[5].weight[2] = slope;
    layers[5].bias[1] = -slope;
  }
  const auto ones = [](int n) { return std::vector<double>(static_cast<std::size_t>(n), 1.0); };
  const auto zeros = [](int n) { return std::vector<double>(static_cast<std::size_t>(n), 0.0); };
  return {std::move(layers), {zeros(inputs), ones(inputs)}, {zeros(outputs), ones(outputs)}};
}

ReducedModel falling_networks(const Scene& scene) {
  ReducedModel model = graupel::test::falling_model(scene);
  model.fields =
      std::make_shared<const MlpFields>(1, model.reference, sliding(4, 3, 1), sliding(5, 6, 0), sliding(4, 9, 0));
  return model;
}

Scene falling_scene() { return io::parse_scene(graupel::test::falling_scene(), "falling", ""); }

template <typename T>
double fall(const ReducedModel& model, int frames) {
  const Scene scene = falling_scene();
  ReducedSolver<T> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {35}, {});
  for (int f = 0; f < frames; ++f) solver.advance_frame();
  const ParticleFrame frame = solver.frame();
  double sum = 0;
  for (std::size_t p = 0; p < frame.position.size(); ++p)
    sum += static_cast<double>(frame.position[p][1] - model.reference[3 * p + 1]);
  return sum / static_cast<double>(frame.position.size());
}

TEST(MlpFields, ARolloutFollowsTheLawOfFalling) {
  const ReducedModel model = falling_networks(falling_scene());
  const int n = 3 * graupel::test::falling_steps;
  const double dt = 1.0 / 60 / graupel::test::falling_steps, law = -9.8 * dt * dt * n * (n + 1) / 2;
  EXPECT_NEAR(fall<double>(model, 3), law, 1e-6);
  EXPECT_NEAR(fall<float>(model, 3), law, 1e-4);
}

TEST(MlpFields, SurviveAFile) {
  const ReducedModel model = falling_networks(falling_scene());
  nn::Weights weights = model.store(nn::DType::f32);
  EXPECT_EQ(weights.metadata.at("field"), "mlp");
  EXPECT_EQ(fall<double>(ReducedModel::load(weights), 2), fall<double>(model, 2));
  weights.metadata["field"] = "grid";
  try {
    ReducedModel::load(weights);
    FAIL() << "accepted fields of an unknown kind";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("'grid', allowed: factored, mlp"), std::string::npos) << error.what();
  }
}

TEST(MlpFields, AFileWithoutAKindIsFactored) {
  nn::Weights weights = graupel::test::falling_model(falling_scene()).store(nn::DType::f32);
  weights.metadata.erase("field");
  EXPECT_STREQ(ReducedModel::load(weights).fields->kind(), "factored");
}

/// g, its velocity along the latent, and the samples' derivatives are one function.
TEST(MlpFields, PositionsVelocitiesAndSamplesAgree) {
  const std::vector<float> reference = {0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f, 0.7f, 0.8f, 0.9f};
  const MlpFields fields(2, reference, random_network(5, 20, 3, 4), random_network(6, 20, 6, 5),
                         random_network(5, 20, 9, 6));
  const std::vector<int32_t> points = {2, 0};
  LatentState state{{0.3, -0.2}, {1.5, -2.5}, {35}, 0, {}};
  const auto samples = fields.bind_samples(points);
  Eigen::VectorXd x;
  Eigen::MatrixXd jacobian;
  samples->evaluate(state.latent.data(), x);
  samples->jacobian(state.latent.data(), jacobian);
  const auto positions = fields.bind_positions_f64(points);
  std::vector<double> position(48), velocity(48), later(48);
  positions->decode(state, position.data(), velocity.data());
  const Eigen::VectorXd rate = jacobian * Eigen::Vector2d(1.5, -2.5);
  for (int s = 0; s < 2; ++s)
    for (int d = 0; d < 3; ++d) {
      EXPECT_NEAR(position[static_cast<std::size_t>(16 * d + s)], x[3 * s + d], 1e-12);
      EXPECT_NEAR(velocity[static_cast<std::size_t>(16 * d + s)], rate[3 * s + d], 1e-10);
    }
  state.last_step = 1e-5;
  state.previous = {0.3 - 1.5e-5, -0.2 + 2.5e-5};
  positions->decode(state, later.data(), velocity.data());
  for (int s = 0; s < 2; ++s)
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(velocity[static_cast<std::size_t>(16 * d + s)], rate[3 * s + d], 1e-3);
}

}  // namespace
}  // namespace graupel::rom
