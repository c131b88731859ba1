// A small comparison with every metric, curve, picture and track, made by formula.
#pragma once

#include "compare/comparison.h"
#include "compare/pictures/contact_sheet.h"
#include "compare/pictures/png.h"
#include "compare/pictures/raster.h"
#include "tests/compare/synthetic_run.h"

namespace graupel::compare {

inline ModelResult synthetic_result(const std::string& model, const Scene& scene,
                                    const sparsegrid::ObstacleSet& obstacles, const Backdrop& backdrop,
                                    const ParticleRun& truth, const ParticleRun& run) {
  ModelResult result;
  result.model = model;
  Evaluation evaluation = evaluate_rollout(scene, obstacles, truth, run);
  result.values = evaluation.values;
  result.materials = evaluation.materials;
  result.curves = evaluation.curves;
  for (const MetricValues& more :
       {one_step_values(OneStepError{}), cost_values(RunCost{.frame = 0.001}, run.size(), 0.01),
        floor_values(evaluation, evaluation),
        MetricValues{{"loses_to_coarse", 0},
                     {"ratio_position_mse_all", 0.5},
                     {"ratio_sinkhorn", 0.25},
                     {"ratio_density_error", 1},
                     {"ratio_frame_ms", 6.4}}})
    result.values.insert(more.begin(), more.end());
  for (auto& [key, value] : result.values)
    if (!(value >= 0)) value = 0;
  result.values["one_step_normalized"] = 0.25;
  result.one_step_source = "own rollout";
  const auto frames = picture_frames(run.predicted());
  result.picture = encode_png(picture_row(backdrop, run, frames, model));
  result.track = make_track(scene, run, model, {run.size(), 1});
  return result;
}

inline Comparison make_synthetic_comparison() {
  const Scene scene = scene_with_sphere();
  const sparsegrid::ObstacleSet obstacles(scene);
  const Backdrop backdrop = make_backdrop(scene, obstacles, 160, 120);
  auto points = block(7, {0.2f, 0.6f, 0.2f}, 0.2f);
  const auto second = block(7, {0.6f, 0.6f, 0.6f}, 0.2f);
  std::vector<int32_t> type(points.size(), 5);
  type.insert(type.end(), second.size(), 6);
  points.insert(points.end(), second.begin(), second.end());
  const auto truth = make_run(points, type, 20, [](const Vec3f& x, std::size_t f) {
    return Vec3f{x[0], std::max(0.1f, x[1] - 0.002f * static_cast<float>(f * f)), x[2]};
  });
  const auto other = make_run(points, type, 20, [](const Vec3f& x, std::size_t f) {
    return Vec3f{x[0] + 0.004f * static_cast<float>(f), x[1] - 0.01f * static_cast<float>(f), x[2]};
  });
  Comparison comparison;
  comparison.command = "graupel compare --scenes a.json --models mpm,<b>&\"c\"";
  comparison.version = "graupel test";
  comparison.machine = "a machine";
  comparison.groups = {MetricGroup::rollout, MetricGroup::one_step, MetricGroup::cost, MetricGroup::floors,
                       MetricGroup::ratios};
  SceneResult result;
  result.source = "scenes/falling.json";
  result.opponent = "mpm:coarse:fast";
  result.particles = truth.size();
  result.frames = truth.predicted();
  result.frame_time = scene.frame_time;
  result.low = scene.domain.origin;
  result.size = scene.domain.size;
  result.up = up_axis(scene);
  result.picture = encode_png(picture_row(backdrop, truth, picture_frames(20), "truth"));
  result.truth = make_track(scene, truth, "truth", {truth.size(), 1});
  result.obstacles = make_player_obstacles(scene, obstacles, 4000);
  result.models.push_back(synthetic_result("mpm", scene, obstacles, backdrop, truth, truth));
  result.models.push_back(synthetic_result("models/<net>.safetensors", scene, obstacles, backdrop, truth, other));
  RivalRun rival{"mpm:coarse:fast", result.models[1].values, result.models[1].curves};
  for (const char* key : {"position_mse_all", "sinkhorn", "density_error"}) rival.values[key] /= 2;
  for (double& error : rival.curves.position) error /= 4;
  for (double& error : rival.curves.density) error /= 2;
  result.rivals = {rival};
  result.mpm_frame_ms = result.opponent_frame_ms = 1;
  result.true_energy = result.models[0].curves.kinetic_energy;
  result.floor_position = result.models[1].curves.position;
  result.floor_density = result.models[1].curves.density;
  comparison.scenes.push_back(result);
  return comparison;
}

/// The same scene `scenes` times, under the names "falling 0", ...
inline Comparison synthetic_comparison(int scenes = 1) {
  static const Comparison one = make_synthetic_comparison();
  Comparison comparison = one;
  comparison.scenes.resize(static_cast<std::size_t>(scenes), one.scenes[0]);
  for (int k = 0; k < scenes; ++k) comparison.scenes[static_cast<std::size_t>(k)].name = "falling " + std::to_string(k);
  return comparison;
}

}  // namespace graupel::compare
