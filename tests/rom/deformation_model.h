// Models of the deformation alone, for tests: networks that are exactly linear, smooth modes, and elastic blocks.
#pragma once

#include <numeric>
#include <string>

#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
#include "rom/deformation/mlp_deformation.h"
#include "rom/fields/deformation_fields.h"
#include "rom/reduced_model.h"

namespace graupel::rom::test {

/// y = A z exactly (to rounding), A [outputs, inputs], inputs within [-1, 1]: all hidden units stay on the linear
/// branch.
inline Mlp linear_network(const Eigen::MatrixXd& matrix) {
  const int inputs = static_cast<int>(matrix.cols()), outputs = static_cast<int>(matrix.rows());
  constexpr float lift = 2;
  std::vector<MlpLayer> layers;
  for (int l = 0; l < Mlp::layer_count; ++l) {
    MlpLayer layer;
    layer.in = inputs;
    layer.out = l == Mlp::hidden_layers ? outputs : inputs;
    layer.weight.assign(static_cast<std::size_t>(layer.in * layer.out), 0);
    layer.bias.assign(static_cast<std::size_t>(layer.out), 0);
    for (int o = 0; o < layer.out; ++o)
      for (int i = 0; i < layer.in; ++i)
        layer.weight[static_cast<std::size_t>(o * layer.in + i)] =
            l == Mlp::hidden_layers ? static_cast<float>(matrix(o, i)) : (o == i ? 1.0f : 0.0f);
    if (l == 0) layer.bias.assign(layer.bias.size(), lift);
    if (l == Mlp::hidden_layers)
      for (int o = 0; o < layer.out; ++o) {
        double sum = 0;  // of the weights as they are stored
        for (int i = 0; i < layer.in; ++i)
          sum += static_cast<double>(layer.weight[static_cast<std::size_t>(o * layer.in + i)]);
        layer.bias[static_cast<std::size_t>(o)] = static_cast<float>(-static_cast<double>(lift) * sum);
      }
    layers.push_back(layer);
  }
  const auto ones = [](int n) {
    Standardization s;
    s.shift.assign(static_cast<std::size_t>(n), 0);
    s.scale.assign(static_cast<std::size_t>(n), 1);
    return s;
  };
  return {std::move(layers), ones(inputs), ones(outputs)};
}

/// u = q: rigid translations.
inline Eigen::MatrixXd translation() {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(3, 6);
  matrix.rightCols(3).setIdentity();
  return matrix;
}

/// A block of jelly in the air, without walls nearby; `more` are further keys.
inline Scene jelly_block(const std::string& gravity, const std::string& more = "") {
  return io::parse_scene(R"({
    "domain": { "size": [1, 1, 1], "dx": 0.04, "walls": "stick" },
    "materials": { "jelly": { "preset": "jelly", "youngs_modulus": 12500, "poissons_ratio": 0.3 } },
    "sources": [ { "shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.5, 0.5, 0.5], "material": "jelly" } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 4 },
    "transfer": { "scheme": "pic" }, "frame_time": 0.01, "frames": 4, "seed": 3, "gravity": )" +
                             gravity + more + "}",
                         "scene", "");
}

/// A model of all particles of the scene as samples, with these latents.
inline ReducedModel deformation_model(const Scene& scene, std::shared_ptr<const Deformation> map,
                                      std::vector<double> rest) {
  const mpm::SampledParticles sampled = mpm::sample_sources(scene, scene.seed);
  ReducedModel model;
  model.kind = ReducedKind::crom;
  for (const Vec3d& x : sampled.position)
    for (int d = 0; d < 3; ++d) model.reference.push_back(static_cast<float>(x[d]));
  const auto n = static_cast<int64_t>(sampled.position.size());
  model.clusters.count = n;
  model.clusters.of_particle.resize(sampled.position.size());
  std::iota(model.clusters.of_particle.begin(), model.clusters.of_particle.end(), 0);
  model.samples = model.encoder = model.clusters.of_particle;
  model.start_latent = rest;
  model.fields = std::make_shared<const DeformationFields>(model.reference, std::move(map));
  model.projection = ProjectionKind::position_velocity;
  model.scene_json = io::scene_to_json(scene);
  model.substeps_per_frame = scene.time_step.substeps_per_frame;
  model.frame_time = scene.frame_time;
  model.training_latents.assign(rest.begin(), rest.end());
  model.latent_scale.assign(rest.size(), 1);
  model.latent_reach = 1;
  return model;
}
inline ReducedModel deformation_model(const Scene& scene, Mlp displacement, const std::vector<double>& rest) {
  return deformation_model(scene, std::make_shared<const MlpDeformation>(std::move(displacement), rest), rest);
}

}  // namespace graupel::rom::test
