// Branches that are networks: derivative, storage, what is wrong with a file, and the GPU's refusal.
#include "rom/fields/mlp_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "rom/cuda/device_tables.h"
#include "rom/fields/factored_fields.h"
#include "tests/rom/random_network.h"
#include "tests/rom/swaying_model.h"

namespace graupel::rom {
namespace {

MlpMap some_map(int inputs, int outputs, uint64_t seed) {
  std::vector<double> linear;
  for (int i = 0; i < (1 + inputs) * outputs; ++i)
    linear.push_back(test::network_noise(70000 + 1000 * seed + static_cast<uint64_t>(i)));
  return {test::random_network(inputs, 20, outputs, seed), linear};
}

const std::vector<double> somewhere = {0.2, -0.1, 0.3, 0.05};

TEST(MlpMap, IsItsLinearPartAndItsNetwork) {
  const MlpMap map = some_map(4, 3, 1);
  Mlp::Rows y;
  map.network().evaluate(Eigen::Map<const Mlp::Rows>(somewhere.data(), 1, 4), y);
  double whole[3];
  map.evaluate(somewhere.data(), whole);
  for (int k = 0; k < 3; ++k) {
    const auto linear = [&](int row) {
      return static_cast<double>(static_cast<float>(test::network_noise(71000 + static_cast<uint64_t>(3 * row + k))));
    };
    double expected = y(0, k) + linear(0);
    for (std::size_t j = 0; j < 4; ++j)
      expected += linear(static_cast<int>(j) + 1) *
                  ((somewhere[j] - map.network().input().shift[j]) * map.network().input().scale[j]);
    EXPECT_NEAR(whole[k], expected, 1e-12);
  }
}

TEST(MlpMap, DerivativeIsThatOfFiniteDifferences) {
  const MlpMap map = some_map(4, 5, 2);
  std::vector<double> jacobian(5 * 3), plus(5), minus(5);
  map.derivative(somewhere.data(), 3, jacobian.data());
  constexpr double h = 1e-5;
  for (std::size_t j = 0; j < 3; ++j) {
    std::vector<double> up = somewhere, down = somewhere;
    up[j] += h;
    down[j] -= h;
    map.evaluate(up.data(), plus.data());
    map.evaluate(down.data(), minus.data());
    for (std::size_t k = 0; k < 5; ++k) EXPECT_NEAR(jacobian[3 * k + j], (plus[k] - minus[k]) / (2 * h), 1e-7);
  }
}

/// All branches of a model, as the sum of what is linear and of random networks.
ReducedModel with_networks(const Scene& scene) {
  ReducedModel model = test::swaying_model(scene);
  const auto& fields = dynamic_cast<const FactoredFields&>(*model.fields);
  const int r = model.latents();
  model.fields = std::make_shared<const FactoredFields>(
      fields.deformation(), ClosureBranch(r, some_map(r, 3, 3)), fields.stress(), MapBranch(some_map(r + 1, 70, 4)),
      fields.affine(), std::make_shared<const RateBranch>(r, some_map(r + 1, 4 * r, 5)));
  return model;
}

std::vector<double> all_coefficients(const ReducedModel& model) {
  const auto& fields = dynamic_cast<const FactoredFields&>(*model.fields);
  const LatentState state{{0.1, -0.2}, {0.5, 2}, {33}, 0, {}};
  std::vector<double> values;
  for (const Branch* branch : {static_cast<const Branch*>(&fields.deformation_branch()),
                               static_cast<const Branch*>(&fields.stress_branch()), &fields.affine_branch()}) {
    std::vector<double> a(static_cast<std::size_t>(branch->count()));
    branch->coefficients(state, a.data());
    values.insert(values.end(), a.begin(), a.end());
  }
  return values;
}

TEST(MlpMap, AllBranchesSurviveAFile) {
  const ReducedModel model = with_networks(test::swaying_scene());
  const nn::Weights weights = model.store(nn::DType::f32);
  EXPECT_EQ(weights.metadata.at("branch"), "mlp");
  const ReducedModel again = ReducedModel::load(weights);
  EXPECT_EQ(all_coefficients(again), all_coefficients(model));
  EXPECT_EQ(again.store(nn::DType::f32).metadata, weights.metadata);
  const auto& closure = dynamic_cast<const FactoredFields&>(*again.fields).deformation_branch();
  std::vector<double> slope(5 * 2);
  closure.jacobian(std::vector<double>{0.1, -0.2}.data(), slope.data());
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 2; ++j) EXPECT_EQ(slope[static_cast<std::size_t>(2 * k + j)], k == j ? 1 : 0);
}

TEST(MlpMap, FilesThatSayNothingHaveRadialBasisFunctions) {
  nn::Weights weights = test::swaying_model(test::swaying_scene()).store(nn::DType::f32);
  EXPECT_EQ(weights.metadata.at("branch"), "rbf");
  const std::vector<double> own = all_coefficients(ReducedModel::load(weights));
  weights.metadata.erase("branch");
  const ReducedModel old = ReducedModel::load(weights);
  EXPECT_EQ(all_coefficients(old), own);
  EXPECT_EQ(dynamic_cast<const FactoredFields&>(*old.fields).stress_branch().map().kind(), BranchKind::rbf);
}

TEST(MlpMap, NamesWhatIsWrongWithAFile) {
  nn::Weights weights = with_networks(test::swaying_scene()).store(nn::DType::f32);
  weights.file = "net.safetensors";
  const auto message = [&](const auto& damage) {
    nn::Weights damaged = weights;
    damage(damaged);
    try {
      ReducedModel::load(damaged);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  const std::string missing = message([](nn::Weights& w) { w.tensors.erase("stress.branch.linear"); });
  EXPECT_TRUE(has(missing, "net.safetensors") && has(missing, "'stress.branch.linear'")) << missing;
  const std::string layer = message([](nn::Weights& w) { w.tensors.erase("deformation.branch.layer0.weight"); });
  EXPECT_TRUE(has(layer, "'deformation.branch.layer0.weight'") && has(layer, "train it again")) << layer;
  const std::string shape = message([](nn::Weights& w) {
    w.tensors["affine.branch.linear"] = nn::Tensor::from_float({1, 2}, {1, 2});
  });
  EXPECT_TRUE(has(shape, "'affine.branch.linear'") && has(shape, "[1, 2]") && has(shape, "[4, 8]")) << shape;
  const std::string infinite = message([](nn::Weights& w) {
    w.tensors["deformation.branch.linear"] = nn::Tensor::from_float(std::vector<float>(9, INFINITY), {3, 3});
  });
  EXPECT_TRUE(has(infinite, "'deformation.branch.linear'") && has(infinite, "damaged")) << infinite;
  const std::string scale = message([](nn::Weights& w) {
    w.tensors["stress.branch.input.scale"] = nn::Tensor::from_float({1, 0, 1}, {3});
  });
  EXPECT_TRUE(has(scale, "'stress.branch.input.scale'") && has(scale, "allowed")) << scale;
  const std::string kind = message([](nn::Weights& w) { w.metadata["branch"] = "forest"; });
  EXPECT_TRUE(has(kind, "'forest', allowed: rbf, mlp")) << kind;
  const std::string other = message([](nn::Weights& w) { w.metadata["branch"] = "rbf"; });
  EXPECT_TRUE(has(other, "'deformation.branch.")) << other;
}

TEST(MlpMap, TheGpuRefusesIt) {
  const Scene scene = test::swaying_scene();
  const ReducedModel model = with_networks(scene);
  try {
    device::model_table(model, model.samples);
    FAIL() << "accepted networks for branches";
  } catch (const ConfigError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("branch=rbf"), std::string::npos) << text;
    EXPECT_NE(text.find("--device cpu"), std::string::npos) << text;
  }
  EXPECT_NO_THROW(device::model_table(test::swaying_model(scene), model.samples));
}

}  // namespace
}  // namespace graupel::rom
