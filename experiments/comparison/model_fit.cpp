#include "experiments/comparison/model_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/system/error.h"
#include "experiments/comparison/fairness.h"
#include "mpm/memory_need.h"
#include "mpm/scene/particle_materials.h"

namespace graupel::experiments {

namespace {

constexpr std::size_t most_misfits = 20;  ///< that are told one by one

void check_network(const graph::LearnedSimulator& network, const SceneTask& task) {
  network.check_scene(task.scene);
  if (task.stored && network.config().material_constants)
    mpm::network_materials(task.scene, *task.stored, task.stored->frames.front().position, "'" + task.source + "'");
}

/// The frames of all models but one are let go.
void check_memory(const mpm::SolverVariant& variant, const SceneTask& task, Device device) {
  if (variant.resolution >= 1) return;
  const double frames = static_cast<double>(task.frames + 1);
  const mpm::SimulationOptions options{.device = device, .precision = mpm::Precision::f32, .seed = task.seed};
  const Scene scene = mpm::variant_scene(task.scene, variant);
  mpm::check_variant_fits(task.scene, variant, options, frames * mpm::least_memory(scene, options).particles);
}

/// Whether the model runs on the scene; throws where it should and cannot.
bool runs_on(const ComparedModel& model, const SceneTask& task, OtherScenes other_scenes,
             const TrainingRuns* training_runs, Device device) {
  check_runs_on(model.choice, task.scene);
  if (model.network) check_network(*model.network, task);
  if (model.choice.kind == ModelKind::mpm) check_memory(model.choice.variant, task, device);
  if (runs_on_all_scenes(model.choice.kind)) return true;
  try {
    const ReducedRun runs_here(*model.reduced, task.scene, task.seed, {}, {.outside = OutsideRange::be_quiet});
  } catch (const ConfigError&) {
    if (other_scenes == OtherScenes::leave_out) return false;
    throw;
  }
  if (training_runs != nullptr) check_training_runs(*training_runs, *model.reduced, task);
  return true;
}

[[noreturn]] void refuse(const std::vector<std::string>& misfits) {
  std::string text = misfits.front();
  if (misfits.size() > 1) {
    text = fmt::format("{} pairs of scene and model do not go together:", misfits.size());
    for (std::size_t i = 0; i < std::min(misfits.size(), most_misfits); ++i) text += "\n  " + misfits[i];
    if (misfits.size() > most_misfits) text += fmt::format("\n  and {} more", misfits.size() - most_misfits);
  }
  throw ConfigError(text);
}

}  // namespace

std::vector<std::vector<ComparedModel>> fitting_models(const std::vector<SceneTask>& tasks,
                                                       const std::vector<ComparedModel>& models,
                                                       OtherScenes other_scenes, const TrainingRuns* training_runs,
                                                       Device device) {
  std::vector<std::vector<ComparedModel>> fitting(tasks.size());
  std::vector<std::string> misfits;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    std::set<std::string> told;  // parts of one network, and a model without its pull, fail alike
    for (const ComparedModel& model : models) try {
        if (runs_on(model, tasks[t], other_scenes, training_runs, device)) fitting[t].push_back(model);
      } catch (const Error& error) {
        if (error.code() != ExitCode::usage && error.code() != ExitCode::bad_input) throw;
        if (!model.choice.weights.empty() && !told.insert(model.choice.weights).second) continue;
        misfits.push_back(fmt::format("scene '{}' ('{}') and model '{}': {}", tasks[t].scene.name, tasks[t].source,
                                      model.choice.name, error.what()));
      }
  }
  if (!misfits.empty()) refuse(misfits);
  return fitting;
}

}  // namespace graupel::experiments
