#include "train/coarse/coarse_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "core/math/random.h"
#include "core/parallel/parallel_tasks.h"
#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "mpm/fast_step.h"
#include "mpm/scene/categories/category_scene.h"
#include "mpm/scene_variants.h"

namespace graupel::train {

namespace {

constexpr double floor_displacement = 1e-4;  ///< [dx]
constexpr int density_cell = 4;              ///< [dx]

using Frames = std::vector<std::vector<std::vector<Vec3f>>>;  // [scenes][frames looked at][particles]

struct BatchRun {
  Frames positions;
  std::vector<bool> diverged;
};

constexpr const char* stopped_text = "stopped before the search began";

BatchRun run_batch(const std::vector<mpm::PreparedScene>& scenes, const CoarseSceneOptions& options) {
  BatchRun run{Frames(scenes.size()), std::vector<bool>(scenes.size(), false)};
  if (scenes.empty()) return run;
  const auto batch = mpm::SceneBatch::create(scenes);
  for (int64_t f = 1; f <= options.frames; ++f) {
    if (!batch->advance_frame(options.should_stop)) throw StoppedError(ExitCode::interrupted, stopped_text);
    if (f % options.stride != 0) continue;
    std::vector<ParticleFrame> frames = batch->frames({});
    for (std::size_t s = 0; s < scenes.size(); ++s) run.positions[s].push_back(std::move(frames[s].position));
  }
  for (std::size_t s = 0; s < scenes.size(); ++s) run.diverged[s] = batch->divergence(static_cast<int>(s)).has_value();
  return run;
}

/// Share of the particles in each cell of `density_cell` dx, spread over the eight nearest cells.
std::vector<float> density_of(const Scene& fine, const std::vector<Vec3f>& position) {
  const double cell = density_cell * fine.domain.dx;
  int n[3];
  for (int d = 0; d < 3; ++d) n[d] = static_cast<int>(std::ceil(fine.domain.size[d] / cell)) + 2;
  std::vector<float> share(static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1] * n[2]), 0.0f);
  const float each = 1.0f / static_cast<float>(position.size());
  for (const Vec3f& x : position) {
    int base[3];
    float w[3][2];
    for (int d = 0; d < 3; ++d) {
      const double local = (static_cast<double>(x[d]) - fine.domain.origin[d]) / cell + 0.5;
      base[d] = std::clamp(static_cast<int>(std::floor(local)), 0, n[d] - 2);
      w[d][1] = static_cast<float>(std::clamp(local - base[d], 0.0, 1.0));
      w[d][0] = 1 - w[d][1];
    }
    for (int k = 0; k < 8; ++k) {
      const int a = k >> 2, b = (k >> 1) & 1, c = k & 1;
      const auto at = static_cast<std::size_t>(((base[0] + a) * n[1] + base[1] + b) * n[2] + base[2] + c);
      share[at] += each * w[0][a] * w[1][b] * w[2][c];
    }
  }
  return share;
}

/// Errors of a run of the truth's particles `which` (empty: all).
RunErrors errors_of(const CoarseScene& scene, const std::vector<std::vector<Vec3f>>& run,
                    const std::vector<std::size_t>& which) {
  const auto& truth = scene.truth;
  RunErrors errors;
  for (std::size_t f = 0; f < truth.size(); ++f) {
    double position = 0;
    for (std::size_t p = 0; p < run[f].size(); ++p)
      position += static_cast<double>(norm2(run[f][p] - truth[f][which.empty() ? p : which[p]]));
    errors.position += position / static_cast<double>(run[f].size() * truth.size());
    const std::vector<float> own = density_of(scene.scene, run[f]);
    double difference = 0;
    for (std::size_t c = 0; c < own.size(); ++c) difference += std::abs(own[c] - scene.density[f][c]);
    errors.density += difference / static_cast<double>(truth.size());
  }
  errors.diverged = !std::isfinite(errors.position);
  return errors;
}

/// The scene with its particles given as points.
Scene as_points(const Scene& scene, const mpm::SampledParticles& particles) {
  std::vector<std::vector<Vec3d>> points(scene.sources.size());
  for (std::size_t p = 0; p < particles.position.size(); ++p)
    points[static_cast<std::size_t>(particles.source[p])].push_back(particles.position[p]);
  return mpm::scene_of_points(scene, std::move(points));
}

/// Particles, of all, that a grid of `ratio` times the spacing with `share` of the particles a cell moves.
std::vector<std::size_t> thinned(const Scene& scene, const mpm::SampledParticles& particles, double ratio,
                                 double share = 1) {
  const double group = std::max(1.0, ratio * ratio * ratio / share);
  std::vector<std::size_t> picked;
  const std::size_t n = particles.position.size();
  for (std::size_t first = 0, end = 0; first < n; first = end) {
    const int32_t source = particles.source[first];
    while (end < n && particles.source[end] == source) ++end;
    for (const std::size_t p : mpm::thinned_points(scene, static_cast<std::size_t>(source), end - first, group))
      picked.push_back(first + p);
  }
  return picked;
}

/// The scene with its particles floor_displacement away in random directions.
Scene displaced(const Scene& scene, mpm::SampledParticles particles) {
  const Random random(scene.seed, RandomPurpose::metric_subset);
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    Vec3d direction;
    double unused;
    random.normal(p, 0, direction[0], direction[1]);
    random.normal(p, 1, direction[2], unused);
    Vec3d& x = particles.position[p];
    x += normalized(direction) * (floor_displacement * scene.domain.dx);
    for (int d = 0; d < 3; ++d) x[d] = std::clamp(x[d], scene.wall_low()[d], scene.wall_high()[d]);
  }
  return as_points(scene, particles);
}

}  // namespace

std::vector<CoarseScene> make_coarse_scenes(const CategoryRecipe& recipe, const CoarseSceneOptions& options) {
  std::vector<Scene> scenes;
  for (int64_t i = 0; i < options.count; ++i) {
    Scene scene = mpm::draw_scene(recipe, options.seed, options.split, i);
    scene.seed = mpm::sampling_seed(options.seed, options.split, i, 0);
    if (scene.emitters.empty() && scene.sinks.empty() && !scene.has_moving_obstacles()) scenes.push_back(scene);
  }
  const auto stop_if_asked = [&] {
    if (options.should_stop()) throw StoppedError(ExitCode::interrupted, stopped_text);
  };
  const std::size_t n = scenes.size();
  options.message(fmt::format("{} scenes: fine runs", n));
  const auto prepared = [&](const std::function<Scene(std::size_t)>& make) {
    std::vector<std::unique_ptr<mpm::PreparedScene>> made(n);
    for_each_task(n, num_threads(), [&](std::size_t s) {
      stop_if_asked();
      const Scene scene = make(s);
      made[s] = std::make_unique<mpm::PreparedScene>(
          scene, mpm::SimulationOptions{.device = options.device, .seed = scene.seed});
    });
    std::vector<mpm::PreparedScene> all;
    all.reserve(made.size());
    for (auto& one : made) all.push_back(std::move(*one));
    return all;
  };
  const auto fine = prepared([&](std::size_t s) { return scenes[s]; });
  const BatchRun truth = run_batch(fine, options);
  const BatchRun moved =
      run_batch(prepared([&](std::size_t s) { return displaced(scenes[s], fine[s].particles); }), options);

  options.message("MPM on 2 dx: largest steps");
  std::vector<int64_t> substeps(n);
  const BatchRun opponent = run_batch(
      prepared([&](std::size_t s) {
        const Scene scene = mpm::on_coarser_grid(as_points(scenes[s], fine[s].particles), 2);
        Scene fast = scene;
        try {
          fast = mpm::find_fast_step(scene, {.device = Device::cpu, .seed = scene.seed}, options.frames, stop_if_asked)
                     .scene;
        } catch (const DivergedError&) {
        }
        substeps[s] = fast.time_step.substeps_per_frame;
        return fast;
      }),
      options);

  std::vector<std::vector<mpm::PreparedScene>> coarse;  // [resolutions][scenes]
  hybrid::CoarseModel sampling;
  sampling.particle_share = options.particle_share;
  for (const double resolution : options.resolutions)
    coarse.push_back(prepared([&](std::size_t s) {
      return mpm::on_coarser_grid(as_points(scenes[s], fine[s].particles), resolution,
                                  sampling.share(scenes[s], resolution));
    }));
  std::vector<CoarseScene> made;
  for (std::size_t s = 0; s < n; ++s) {
    if (truth.diverged[s] || moved.diverged[s] || opponent.diverged[s]) continue;
    CoarseScene one;
    one.scene = scenes[s];
    one.opponent_substeps = substeps[s];
    for (std::size_t r = 0; r < coarse.size(); ++r) {
      one.coarse.push_back(std::move(coarse[r][s]));
      one.picked.push_back(thinned(scenes[s], fine[s].particles, options.resolutions[r],
                                   sampling.share(scenes[s], options.resolutions[r])));
    }
    one.truth = truth.positions[s];
    for (const auto& frame : one.truth) one.density.push_back(density_of(scenes[s], frame));
    one.floor = errors_of(one, moved.positions[s], {});
    one.opponent = errors_of(one, opponent.positions[s], thinned(scenes[s], fine[s].particles, 2));
    made.push_back(std::move(one));
  }
  return made;
}

std::vector<std::vector<RunErrors>> run_coarse_models(const std::vector<hybrid::CoarseModel>& models,
                                                      const std::vector<const CoarseScene*>& scenes,
                                                      const CoarseSceneOptions& options) {
  std::vector<mpm::PreparedScene> runs;
  std::vector<std::size_t> grid;  // of each run, in the order of the resolutions
  for (const hybrid::CoarseModel& model : models)
    for (const CoarseScene* scene : scenes) {
      const double resolution = model.resolution(scene->scene, options.target);
      const auto found = std::find(options.resolutions.begin(), options.resolutions.end(), resolution);
      GRAUPEL_ASSERT(found != options.resolutions.end());
      grid.push_back(static_cast<std::size_t>(found - options.resolutions.begin()));
      runs.push_back(scene->coarse[grid.back()]);  // particles and obstacles stay, the constants are the model's
      runs.back().scene = model.scene(scene->scene, resolution);
    }
  const BatchRun run = run_batch(runs, options);
  std::vector<std::vector<RunErrors>> errors(models.size(), std::vector<RunErrors>(scenes.size()));
  for_each_task(runs.size(), num_threads(), [&](std::size_t k) {
    const CoarseScene& scene = *scenes[k % scenes.size()];
    RunErrors& own = errors[k / scenes.size()][k % scenes.size()];
    own.diverged = run.diverged[k];
    if (!own.diverged) own = errors_of(scene, run.positions[k], scene.picked[grid[k]]);
  });
  return errors;
}

}  // namespace graupel::train
