// A small reduced-order model with everything that a step reads: two latents that carry a body along x and y, modes
// that follow them by a closure, smooth stress and affine velocity that depend on the latents and the parameter,
// clusters.
#pragma once

#include <cmath>
#include <numeric>
#include <string>

#include "core/math/random.h"
#include "io/scene/scene_reader.h"
#include "rom/fields/factored_fields.h"
#include "rom/reduced_model.h"

namespace graupel::rom::test {

/// A block of sand that flies along x and falls; `more` are further keys.
inline Scene swaying_scene(const std::string& more = "", const std::string& size = "[0.04, 0.06, 0.04]") {
  return io::parse_scene(R"({
    "domain": { "size": [0.5, 0.5, 0.5], "dx": 0.02, "walls": "stick" },
    "gravity": [0, -4, 0],
    "materials": { "sand": { "preset": "nsf_sand", "friction_angle": 30 } },
    "sources": [ { "shape": "box", "size": )" +
                             size + R"(, "position": [0.25, 0.152, 0.25], "material": "sand",
                   "velocity": [0.6, -0.3, 0] } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 2 },
    "frame_time": 0.008, "seed": 3)" +
                             more + "}",
                         "scene", "");
}

/// A map whose centres and weights are random but of one size.
inline CoefficientMap random_map(int inputs, int outputs, double size, uint64_t seed) {
  const Random random(seed, RandomPurpose::test);
  constexpr int count = 19;
  uint64_t next = 0;
  const auto draw = [&](std::size_t n, double most) {
    std::vector<double> values(n);
    for (double& v : values) v = random.uniform(next++, 0, -most, most);
    return values;
  };
  const auto n = static_cast<std::size_t>(inputs), m = static_cast<std::size_t>(outputs);
  std::vector<double> scale(n, 10.0);
  return {
      inputs, outputs, draw(n, 0.02), scale, draw(count * n, 0.1), draw(count * m, size / 10), draw((1 + n) * m, size)};
}

/// Modes that wave through the body, largest value 1.
inline ModeTable waving_modes(const std::vector<Vec3d>& x, const std::vector<int32_t>& points, int components,
                              int modes, double mean) {
  ModeTable table;
  table.components = components;
  table.modes = modes;
  table.points = points;
  for (const int32_t p : points)
    for (int c = 0; c < components; ++c) {
      const Vec3d& at = x[static_cast<std::size_t>(p)];
      table.mean.push_back(static_cast<float>(mean * std::cos(40 * at[c % 3] + c)));
      for (int k = 0; k < modes; ++k)
        table.basis.push_back(static_cast<float>(std::sin(30 * at[(c + k) % 3] + 17 * at[1] + k)));
    }
  return table;
}

inline ReducedModel swaying_model(const Scene& scene) {
  const mpm::SampledParticles sampled = mpm::sample_sources(scene, scene.seed);
  const std::vector<Vec3d>& x = sampled.position;
  std::vector<int32_t> all(x.size());
  std::iota(all.begin(), all.end(), 0);
  constexpr int latents = 2;
  ReducedModel model;
  ModeTable deformation = waving_modes(x, all, 3, 5, 0);
  std::vector<Vec3f> reference;
  for (std::size_t p = 0; p < x.size(); ++p) {
    reference.push_back(x[p].cast<float>());
    for (int c = 0; c < 3; ++c) {
      deformation.mean[3 * p + static_cast<std::size_t>(c)] = reference.back()[c];
      for (int k = 0; k < latents; ++k)
        deformation.basis[(3 * p + static_cast<std::size_t>(c)) * 5 + static_cast<std::size_t>(k)] = c == k ? 1 : 0;
    }
  }
  model.reference = deformation.mean;
  model.clusters = make_clusters(reference, std::vector<int32_t>(x.size(), 0), 3);
  const std::vector<int32_t> chosen = model.clusters.representatives();
  std::vector<int32_t> points = chosen;
  std::sort(points.begin(), points.end());
  for (std::size_t i = 0; i < all.size(); i += 5) model.samples.push_back(all[i]);
  for (std::size_t i = 0; i < all.size(); i += 3) model.encoder.push_back(all[i]);
  // The closure is 0 and flat at the start, so that the body starts in its reference shape.
  CoefficientMap closure = random_map(latents, 3, 2e-3, 11);
  model.fields = std::make_shared<const FactoredFields>(
      std::move(deformation), ClosureBranch(latents, std::move(closure)), waving_modes(x, points, 6, 70, 0.2),
      MapBranch(random_map(latents + 1, 70, 0.01, 12)), waving_modes(x, points, 9, 4, 0.1),
      std::make_shared<const RateBranch>(latents, random_map(latents + 1, 4 * latents, 0.5, 13)));
  model.affine_kind = AffineKind::rate;
  model.scene_json = io::scene_to_json(scene);
  model.parameters = {{"friction_angle", "degrees", {"materials.sand.friction_angle"}, 30, 40}};
  model.substeps_per_frame = 2;
  model.frame_time = scene.frame_time;
  model.start_latent = {0, 0};
  model.training_latents = {0, 0, 0.1f, -0.1f};
  model.latent_scale = {1, 1};
  model.latent_reach = 0.1;
  return model;
}

}  // namespace graupel::rom::test
