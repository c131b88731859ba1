// Files of reduced models: what no training writes is refused, and takes no memory that the file does not bear out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "rom/networks/tensors.h"
#include "swaying_model.h"

namespace graupel::rom {
namespace {

nn::Weights stored() {
  nn::Weights weights = test::swaying_model(test::swaying_scene()).store(nn::DType::f32);
  weights.file = "a.safetensors";
  return weights;
}

template <typename Change>
std::string error_of(Change change) {
  nn::Weights weights = stored();
  change(weights);
  try {
    ReducedModel::load(weights);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string error_of_setting(const std::string& key, const nlohmann::json& value) {
  return error_of([&](nn::Weights& weights) {
    nlohmann::json settings = nlohmann::json::parse(weights.metadata.at("settings"));
    settings[nlohmann::json::json_pointer(key)] = value;
    weights.metadata["settings"] = settings.dump();
  });
}

TEST(ReducedModelFile, SettingsOutOfRangeAreRefused) {
  EXPECT_EQ(error_of([](nn::Weights&) {}), "");
  EXPECT_EQ(error_of_setting("/step_factor", 2), "");
  EXPECT_EQ(error_of_setting("/frame_time", 1e5),
            "'a.safetensors' has frame_time 100000 in its settings (allowed: 1e-09 to 1000). Train the model again");
  for (const char* key : {"/substeps_per_frame", "/frame_time", "/step_factor"})
    for (const double value : {0.0, -1.0, 1e18, 1e300})
      EXPECT_THAT(error_of_setting(key, value), testing::HasSubstr(std::string(key + 1) + " ")) << value;
  for (const double value : {0.0, -1.0, 1e300})  // distances are in units of it
    EXPECT_THAT(error_of_setting("/latent_reach", value), testing::HasSubstr("(allowed: 1e-30 to 1e+30)")) << value;
  EXPECT_THAT(error_of_setting("/parameters/0/keys", nlohmann::json::array()),
              testing::HasSubstr("no keys of its parameter 'friction_angle'"));
  EXPECT_THAT(error_of_setting("/manifold_pull", 2), testing::HasSubstr("manifold_pull 2"));
  EXPECT_THAT(error_of_setting("/parameters/0/high", 29),
              testing::HasSubstr("the high end of friction_angle 29 in its settings (allowed: 30 to"));
  EXPECT_THAT(error_of_setting("/projection", "sideways"), testing::HasSubstr("projection 'sideways'"));
  EXPECT_THAT(error_of_setting("/stepfactor", 1),
              testing::HasSubstr("'stepfactor' in its settings, which is not known"));
}

TEST(ReducedModelFile, UnknownTensorsAreRefused) {
  EXPECT_THAT(error_of([](nn::Weights& w) { w.tensors["stres.singular"] = nn::Tensor::from_float({1}, {1}); }),
              testing::HasSubstr("has the tensor 'stres.singular', which no such model has"));
}

TEST(ReducedModelFile, ClustersAndPointsThatTheFileDoesNotBearOutAreRefused) {
  for (const int32_t cluster : {1 << 30, std::numeric_limits<int32_t>::max()})
    EXPECT_THAT(error_of([&](nn::Weights& w) {
                  std::vector<int32_t> clusters = get_indices(w, "clusters");
                  clusters[1] = cluster;
                  w.tensors["clusters"] = index_tensor(clusters);
                }),
                testing::HasSubstr("among its clusters (allowed: 0 to"));
  EXPECT_THAT(error_of([](nn::Weights& w) {
                w.tensors["deformation.mean"] = {.dtype = nn::DType::f32, .shape = {int64_t(1) << 40, 0}, .bytes = {}};
              }),
              testing::HasSubstr("'deformation.mean' has another shape"));
  EXPECT_THAT(error_of([](nn::Weights& w) {
                std::vector<int32_t> points = get_indices(w, "stress.points");
                std::swap(points.front(), points.back());
                w.tensors["stress.points"] = index_tensor(points);
              }),
              testing::HasSubstr("are not in order"));
}

}  // namespace
}  // namespace graupel::rom
