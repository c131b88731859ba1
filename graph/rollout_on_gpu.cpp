// Rollouts that run on a GPU. Scenes at rest stay there; of scenes that change the host sees to who takes part in the
// next bundle of frames and where obstacles are.
#include <algorithm>
#include <iterator>
#include <memory>
#include <numeric>
#include <utility>

#include "core/scene/particle_rows.h"
#include "graph/cpu/lap_timer.h"
#include "graph/cuda_simulator.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/learned_simulator.h"
#include "graph/rollout_parts.h"

namespace graupel::graph {

namespace {

using Frames = std::vector<std::vector<Vec3f>>;  ///< positions [frames][n]

/// The particles of a bundle on the GPU: those that are in the run when it begins.
struct BundleParticles {
  std::vector<int32_t> place;  ///< among those of the scene, ascending
  std::vector<int32_t> type, material;
  Frames history;

  void take(std::vector<int32_t> places, const std::vector<int32_t>& all_types,
            const std::vector<int32_t>& all_materials, const Frames& all_frames) {
    place = std::move(places);
    type = particle_rows(all_types, place);
    material = particle_rows(all_materials, place);
    history.clear();
    for (const std::vector<Vec3f>& frame : all_frames) history.push_back(particle_rows(frame, place));
  }
  /// Those of `present`, ascending, that are not among them.
  std::vector<int32_t> missing_of(const std::vector<int32_t>& present) const {
    std::vector<int32_t> missing;
    std::set_difference(present.begin(), present.end(), place.begin(), place.end(), std::back_inserter(missing));
    return missing;
  }
};

std::vector<int32_t> all_of(std::size_t n) {
  std::vector<int32_t> places(n);
  std::iota(places.begin(), places.end(), 0);
  return places;
}

/// Of the caller's options.
CudaLaws laws_of(const LearnedSimulator::RolloutOptions& options) {
  return {options.project, options.density_limit, options.free_flight, options.network};
}

FrameTiming timing_of(const CudaFrameTime& spent, double wall) {
  return {spent.features / 1e3, spent.hierarchy / 1e3, spent.network / 1e3, spent.projection / 1e3, wall};
}

}  // namespace

CudaSimulator& LearnedSimulator::gpu_simulator() const {
  if (!on_gpu_) on_gpu_ = std::make_shared<CudaSimulator>(*weights_);
  return *on_gpu_;
}

Trajectory LearnedSimulator::rollout_on_gpu(const Scene& scene, const Environment& environment,
                                            const std::vector<int32_t>& particle_type,
                                            const std::vector<int32_t>& material,
                                            const std::vector<std::vector<Vec3f>>& start,
                                            const RolloutOptions& options) const {
  CudaSimulator& simulator = gpu_simulator();
  simulator.start({&scene, &environment, &particle_type, &material, &start, laws_of(options)});
  Trajectory trajectory = empty_trajectory(scene, particle_type, weights_->file);
  std::vector<Vec3f> before = start.back();
  trajectory.frames.push_back(make_frame(options.start_time, scene.frame_time, start[start.size() - 2], before));
  for (int64_t frame = 1; frame <= options.frames; ++frame) {
    LapTimer whole;
    const bool goes_on = simulator.advance();
    const double wall = whole.lap();
    if (!goes_on) {
      trajectory.diverged_at_frame = frame;
      break;
    }
    std::vector<Vec3f> current = simulator.positions();
    const double time = options.start_time + static_cast<double>(frame) * scene.frame_time;
    trajectory.frames.push_back(make_frame(time, scene.frame_time, before, current));
    before = std::move(current);
    const CudaFrameTime spent = simulator.frame_time();
    if (options.progress) options.progress(frame, timing_of(spent, wall));
  }
  return trajectory;
}

Trajectory LearnedSimulator::rollout_changing_on_gpu(const Scene& scene, const Environment& environment,
                                                     const std::vector<int32_t>& particle_type,
                                                     const std::vector<int32_t>& material,
                                                     const std::vector<std::vector<Vec3f>>& start,
                                                     const RolloutOptions& options,
                                                     ParticleLifecycle& lifecycle) const {
  const auto needed = static_cast<std::size_t>(config().history) + 1;
  Frames history(start.end() - static_cast<std::ptrdiff_t>(needed), start.end());
  if (options.schedule != nullptr) add_past_of_born(scene, *options.schedule, options.start_time, history);
  CudaSimulator& simulator = gpu_simulator();
  const std::vector<Vec3f> matter = matter_at(start.back(), {}, lifecycle), fall = falling(scene, particle_type);
  MovingEnvironment moving_environment(environment);
  Trajectory trajectory = empty_trajectory(scene, particle_type, weights_->file);
  trajectory.frames.push_back(
      make_frame(options.start_time, scene.frame_time, history[needed - 2], history[needed - 1], lifecycle.active()));
  BundleParticles on_gpu;
  bool other_particles = true, has_begun = false;
  for (int64_t frame = 1; frame <= options.frames; ++frame) {
    LapTimer whole;
    const double from = options.start_time + static_cast<double>(frame - 1) * scene.frame_time,
                 to = options.start_time + static_cast<double>(frame) * scene.frame_time;
    if (other_particles && (frame - 1) % config().bundle == 0) {
      on_gpu.take(lifecycle.changes() ? lifecycle.present() : all_of(particle_type.size()), particle_type, material,
                  history);
      if (!on_gpu.place.empty())
        simulator.start({.scene = &scene,
                         .environment = &environment,
                         .particle_type = &on_gpu.type,
                         .material = &on_gpu.material,
                         .positions = &on_gpu.history,
                         .laws = laws_of(options),
                         .time = from,
                         .matter = &matter,
                         .continues = has_begun,
                         .brief = lifecycle.changes()});
      has_begun = has_begun || !on_gpu.place.empty();
      other_particles = false;
    }
    if (!on_gpu.place.empty() && !simulator.advance()) {
      trajectory.diverged_at_frame = frame;
      break;
    }
    const std::vector<Vec3f> moved = on_gpu.place.empty() ? std::vector<Vec3f>() : simulator.positions();
    std::vector<Vec3f> next = history.back();
    for (std::size_t k = 0; k < moved.size(); ++k) {
      const auto i = static_cast<std::size_t>(on_gpu.place[k]);
      if (!lifecycle.changes() || lifecycle.active()[i] != 0) next[i] = moved[k];
    }
    if (lifecycle.changes()) {
      const Environment& here = moving_environment.at(to);
      const SweptCollision way = here.swept_collision(Device::cpu);
      // What has appeared within the bundle falls until the next one.
      for (const int32_t particle : on_gpu.missing_of(lifecycle.present())) {
        const auto i = static_cast<std::size_t>(particle);
        next[i] += next[i] - history[needed - 2][i] + fall[i];
        if (options.project) way.follow(history.back()[i], next[i]);
      }
      std::rotate(history.begin(), history.begin() + 1, history.end());
      history.back() = std::move(next);
      const bool some_gone = lifecycle.leave(here, {}, history), some_new = lifecycle.appear(here, history, to);
      other_particles = other_particles || some_gone || some_new;
    } else {
      std::rotate(history.begin(), history.begin() + 1, history.end());
      history.back() = std::move(next);
    }
    const double wall = whole.lap();
    trajectory.frames.push_back(
        make_frame(to, scene.frame_time, history[needed - 2], history[needed - 1], lifecycle.active()));
    if (!options.progress) continue;
    options.progress(frame, timing_of(moved.empty() ? CudaFrameTime() : simulator.frame_time(), wall));
  }
  return trajectory;
}

std::vector<Vec3f> LearnedSimulator::one_step_on_gpu(const Scene& scene, const Environment& environment,
                                                     const std::vector<int32_t>& particle_type,
                                                     const std::vector<std::vector<Vec3f>>& positions,
                                                     const std::vector<int32_t>& material) const {
  const std::vector<int32_t> seen = seen_materials(environment, particle_type, material);
  if (!what_changes(environment).empty()) {
    FrameTiming spent;
    return std::move(predict(environment, particle_type, seen, positions, Device::cuda, spent).front());
  }
  CudaSimulator& simulator = gpu_simulator();
  simulator.start({&scene, &environment, &particle_type, &seen, &positions, {false, 0, false, true}});
  return simulator.accelerations();
}

}  // namespace graupel::graph
