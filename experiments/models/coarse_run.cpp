#include "experiments/models/coarse_run.h"

#include "core/system/stopwatch.h"
#include "nn/weights.h"

namespace graupel::experiments {

hybrid::CoarseModel read_coarse_model(const std::string& file) {
  return hybrid::CoarseModel::load(nn::read_safetensors(file));
}

TimedRun run_coarse_model(const hybrid::CoarseModel& model, const Scene& scene, MpmRunOptions options) {
  const double resolution = model.resolution(scene, options.device);
  Scene coarse = model.scene(scene, resolution);
  const int64_t most = 8 * coarse.time_step.substeps_per_frame;
  if (resolution == 1) options.tracers = nullptr;  // it moves the truth's particles
  double lost = 0;
  for (;;) {
    const Stopwatch watch;
    TimedRun result = run_scene(coarse, options);
    int64_t& substeps = coarse.time_step.substeps_per_frame;
    if (result.run.trajectory.diverged_at_frame < 0 || substeps >= most) {
      result.cost.search = lost;
      return result;
    }
    substeps += (substeps + 1) / 2;
    coarse.time_step.courant /= 1.5;
    lost += watch.seconds();
  }
}

}  // namespace graupel::experiments
