#include "experiments/rollout/coarse_rollout.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "core/system/human_time.h"
#include "experiments/models/coarse_run.h"
#include "experiments/process/process.h"
#include "experiments/rollout/rollout_input.h"

namespace graupel::experiments {

void rollout_coarse(const RolloutOptions& options, Device device) {
  const hybrid::CoarseModel model = read_coarse_model(options.weights);
  const auto [scene, seed] = scene_and_seed(options);
  for (const std::string& line : model.unlike_training(scene)) warn("outside the training: " + line);
  const StartState start = start_of(scene, seed);
  MpmRunOptions run{.device = device,
                    .seed = seed,
                    .frames = options.frames >= 0 ? options.frames : scene.frames,
                    .label = fmt::format("rollout {} ({} particles)", scene.name, start.position.size()),
                    .tracers = &start};
  const double spacing = model.scene(scene, model.resolution(scene, device)).domain.dx / scene.domain.dx;
  TimedRun timed = run_coarse_model(model, scene, run);
  Trajectory& trajectory = timed.run.trajectory;
  trajectory.scene_json = scene.source;
  trajectory.made_by = options.weights;
  if (trajectory.diverged_at_frame >= 0)
    trajectory.frames.resize(static_cast<std::size_t>(trajectory.diverged_at_frame));
  write_positions(options.output, trajectory);
  std::fprintf(stderr, "%s: %zu particles on a grid of %.4g times the spacing, %zu frames, %s a frame (median)\n",
               options.output.c_str(), trajectory.particle_count(), model.resolution(scene, device),
               trajectory.frames.size() - 1, human_time(timed.cost.frame).c_str());
  options.common.write_json({{"output", options.output},
                             {"particles", trajectory.particle_count()},
                             {"moved_particles", timed.moved},
                             {"resolution", spacing},
                             {"frames", trajectory.frames.size() - 1},
                             {"seconds_per_frame", timed.cost.frame},
                             {"substeps_per_frame", timed.cost.substeps},
                             {"diverged_at_frame", trajectory.diverged_at_frame}});
  if (trajectory.diverged_at_frame >= 0)
    throw DivergedError(fmt::format("the rollout diverged at frame {}; the frames before it are in '{}'",
                                    trajectory.diverged_at_frame, options.output));
}

}  // namespace graupel::experiments
