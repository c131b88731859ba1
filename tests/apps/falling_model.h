// A reduced-order model that is exact: sand that falls freely moves as a whole, x = X + q e_y, without stress and
// without a gradient of velocity. Its parameter, the friction angle, changes nothing.
#pragma once

#include <string>

#include "core/scene/scene.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
#include "nn/weights.h"
#include "rom/fields/factored_fields.h"
#include "rom/reduced_model.h"

namespace graupel::test {

constexpr int falling_steps = 20;               ///< a frame
constexpr double falling_reach = 0.02;          ///< of the training's latents, which are 0 and -0.01 [m]
constexpr double falling_training_low = -0.01;  ///< [m]

inline std::string falling_scene(double gravity = -9.8) {
  return "{\n"
         "  \"name\": \"falling\",\n"
         "  \"domain\": { \"dx\": 0.03125 },\n"
         "  \"gravity\": [0, " +
         std::to_string(gravity) +
         ", 0],\n"
         "  \"materials\": { \"sand\": { \"preset\": \"sand\", \"friction_angle\": 35 } },\n"
         "  \"sources\": [{ \"shape\": \"box\", \"size\": [0.1, 0.1, 0.1], \"position\": [0.5, 0.75, 0.5], "
         "\"material\": \"sand\" }],\n"
         "  \"time_step\": { \"policy\": \"fixed\", \"substeps_per_frame\": 20 },\n"
         "  \"frames\": 8\n}\n";
}

/// Modes that are 0 everywhere.
inline rom::ModeTable still_modes(const std::vector<int32_t>& particles, int components) {
  rom::ModeTable table;
  table.components = components;
  table.modes = 1;
  table.points = particles;
  table.mean.assign(particles.size() * static_cast<std::size_t>(components), 0);
  table.basis = table.mean;
  return table;
}

inline rom::ReducedModel falling_model(const Scene& scene) {
  const std::vector<Vec3d> start = mpm::sample_sources(scene, scene.seed).position;
  rom::ReducedModel model;
  rom::ModeTable deformation;
  deformation.components = 3;
  deformation.modes = 2;  // the second one is of no use
  for (std::size_t p = 0; p < start.size(); ++p) {
    deformation.points.push_back(static_cast<int32_t>(p));
    for (int d = 0; d < 3; ++d) {
      deformation.mean.push_back(static_cast<float>(start[p][d]));
      deformation.basis.insert(deformation.basis.end(), {d == 1 ? 1.0f : 0.0f, 0.0f});
    }
  }
  model.reference = deformation.mean;
  model.samples = model.encoder = deformation.points;
  model.clusters.count = static_cast<int64_t>(start.size());
  model.clusters.of_particle = deformation.points;
  const rom::CoefficientMap closure(1, 1, {0}, {1}, {0}, {0}, {0, 0});
  const rom::CoefficientMap nothing(2, 1, {0, 35}, {1, 1}, {0, 35}, {0}, {0, 0, 0});
  rom::ModeTable stress = still_modes(deformation.points, 6), affine = still_modes(deformation.points, 9);
  model.fields = std::make_shared<const rom::FactoredFields>(
      std::move(deformation), rom::ClosureBranch(1, closure), std::move(stress), rom::MapBranch(nothing),
      std::move(affine), std::make_shared<const rom::MapBranch>(nothing));
  model.affine_kind = rom::AffineKind::position;
  model.scene_json = io::scene_to_json(scene);
  model.parameters = {{"friction_angle", "degrees", {"materials.sand.friction_angle"}, 30, 40}};
  model.substeps_per_frame = falling_steps;
  model.frame_time = scene.frame_time;
  model.start_latent = {0};
  model.training_latents = {0, static_cast<float>(falling_training_low)};
  model.latent_scale = {1};
  model.latent_reach = falling_reach;
  return model;
}

}  // namespace graupel::test
