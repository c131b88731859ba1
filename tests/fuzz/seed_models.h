// Reduced models of a dozen particles, one of every kind of fields and encoder.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rom/fields/mlp_fields.h"
#include "tests/rom/mode_model.h"
#include "tests/rom/random_network.h"
#include "tests/rom/swaying_model.h"

namespace graupel::fuzz {

/// A block of elastic jelly without walls nearby.
inline Scene seed_scene() {
  return io::parse_scene(R"({
    "domain": { "size": [0.88, 0.88, 0.88], "dx": 0.04, "walls": "stick" },
    "materials": { "jelly": { "preset": "jelly", "youngs_modulus": 12500 } },
    "sources": [ { "shape": "box", "size": [0.08, 0.04, 0.04], "position": [0.44, 0.44, 0.44], "material": "jelly" } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 2 },
    "transfer": { "scheme": "pic" }, "frame_time": 0.004, "frames": 4, "seed": 3, "gravity": [0, -4, 0] })",
                         "scene", "");
}

inline rom::MlpLayer seed_layer(int in, int out) {
  rom::MlpLayer layer;
  layer.in = in;
  layer.out = out;
  for (int i = 0; i < in * out; ++i)
    layer.weight.push_back(static_cast<float>(0.1 * rom::test::network_noise(static_cast<uint64_t>(i))));
  layer.bias.assign(static_cast<std::size_t>(out), 0.1f);
  return layer;
}

/// The paper's: networks for all fields, convolutions as encoder.
inline rom::ReducedModel seed_mlp_model() {
  using namespace rom;
  constexpr int latents = 2, width = 6;
  ReducedModel model = test::mode_model(seed_scene(), 3, latents);
  model.kind = ReducedKind::nsf;
  model.affine_kind = AffineKind::position;
  model.projection = ProjectionKind::position;
  Eigen::MatrixXd along_x_and_y = Eigen::MatrixXd::Zero(3, 3 + latents);
  along_x_and_y(0, 3) = along_x_and_y(1, 4) = 0.1;
  model.fields = std::make_shared<const MlpFields>(latents, model.reference, test::linear_network(along_x_and_y),
                                                   test::random_network(3 + latents, width, 6, 2),
                                                   test::random_network(3 + latents, width, 9, 3));
  const auto n = static_cast<int64_t>(model.reference.size() / 3);
  const std::vector<int64_t> lengths = ConvEncoder::lengths(n);
  std::vector<MlpLayer> convolutions;
  for (std::size_t l = 0; l + 1 < lengths.size(); ++l)
    convolutions.push_back(seed_layer(ConvEncoder::channels * ConvEncoder::kernel, ConvEncoder::channels));
  model.conv_encoder.emplace(n, convolutions,
                             seed_layer(static_cast<int>(ConvEncoder::channels * lengths.back()), ConvEncoder::hidden),
                             seed_layer(ConvEncoder::hidden, latents), Standardization{{0, 0, 0}, {1, 1, 1}});
  return model;
}

/// With all that a file may tell of its training.
inline rom::ReducedModel seed_factored_model() {
  rom::ReducedModel model = rom::test::swaying_model(rom::test::swaying_scene(", \"frames\": 4", "[0.04, 0.02, 0.02]"));
  model.training_latents = {0, 0, 0.1f, -0.1f, 0, 0, 0.2f, -0.1f};
  model.training_run = {0, 0, 1, 1};
  model.run_parameters = {30, 40};
  model.usual = {{0.1, 0.2, 0.3}, {0.1, 0.2, 0.3}};
  model.usual_error = 0.01;
  model.interpolation = {0.01, 0.1};
  model.singular_values["stress"] = {3, 2, 1};
  model.manifold_pull = 0.1;
  return model;
}

inline std::vector<std::pair<std::string, rom::ReducedModel>> seed_models() {
  std::vector<std::pair<std::string, rom::ReducedModel>> models;
  models.emplace_back("nsf_factored", seed_factored_model());
  models.emplace_back("nsf_mlp", seed_mlp_model());
  models.emplace_back("crom_modes", rom::test::mode_model(seed_scene(), 2, 4));
  models.emplace_back(
      "crom_mlp", rom::test::deformation_model(seed_scene(), rom::test::random_network(3 + 2, 6, 3, 4), {0.1, -0.1}));
  return models;
}

}  // namespace graupel::fuzz
