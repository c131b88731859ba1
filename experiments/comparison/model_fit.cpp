#include "experiments/comparison/model_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/system/error.h"
#include "experiments/comparison/fairness.h"
#include "mpm/memory_need.h"
#include "mpm/scene/particle_materials.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

namespace {

constexpr std::size_t most_misfits = 20;  ///< that are told one by one

void check_network(const graph::LearnedSimulator& network, const SceneTask& task) {
  network.check_scene(task.scene);
  if (task.stored && network.config().material_constants)
    mpm::network_materials(task.scene, *task.stored, task.stored->frames.front().position, "'" + task.source + "'");
}

/// A stored truth begins where MPM does, which makes the scene's particles anew.
void check_start(const SceneTask& task, const mpm::SampledParticles& made) {
  constexpr double most = 0.1;  // of a cell; a reduced model starts near the scene, not on it
  const ParticleFrame& first = task.stored->frames.front();
  if (made.position.size() != first.position.size()) return;  // other particles: stored_truth.h
  for (std::size_t i = 0; i < made.position.size(); ++i) {
    if (!first.is_active(i) || (!made.birth_time.empty() && made.birth_time[i] > 0)) continue;
    const double distance = norm(first.position[i].cast<double>() - made.position[i]);
    if (distance <= most * task.scene.domain.dx) continue;
    throw InputError(fmt::format(
        "the stored run does not begin with its scene: particle {} lies {:.3g} m from where the sources put it "
        "(allowed: {} dx), so MPM would be held against another run. Name one from the scene's start, as 'graupel "
        "simulate' stores it and 'rollout' without --start truth:N",
        i, distance, most));
  }
}

/// The run that is the truth, or is timed beside it.
void check_mpm(const SceneTask& task) {
  const mpm::PreparedScene runs_here(task.scene, {.precision = mpm::Precision::f32, .seed = task.seed});
  if (task.stored) check_start(task, runs_here.particles);
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

/// Runs a check. Whether it failed by a mistake of the user's, which is then among `misfits`.
template <typename Check>
bool fails(const std::string& where, std::vector<std::string>& misfits, const Check& check) {
  try {
    check();
    return false;
  } catch (const ConfigError& error) {
    misfits.push_back(where + error.what());
  } catch (const InputError& error) {
    misfits.push_back(where + error.what());
  }
  return true;
}

[[noreturn]] void refuse(const std::vector<std::string>& misfits) {
  if (misfits.size() == 1) throw ConfigError(misfits.front());
  std::string text = fmt::format("{} scenes, or pairs of scene and model, cannot be run:", misfits.size());
  for (std::size_t i = 0; i < std::min(misfits.size(), most_misfits); ++i) text += "\n  " + misfits[i];
  if (misfits.size() > most_misfits) text += fmt::format("\n  and {} more", misfits.size() - most_misfits);
  throw ConfigError(text);
}

}  // namespace

std::vector<std::vector<ComparedModel>> fitting_models(const std::vector<SceneTask>& tasks,
                                                       const std::vector<ComparedModel>& models,
                                                       const CompareOptions& options, const TrainingRuns* training_runs,
                                                       Device device) {
  std::vector<std::vector<ComparedModel>> fitting(tasks.size());
  std::vector<std::string> misfits;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const SceneTask& task = tasks[t];
    const std::string scene = fmt::format("scene '{}' ('{}')", task.scene.name, task.source);
    const bool runs_mpm = !options.one_step_only || !task.stored;
    if (runs_mpm && fails(scene + ": ", misfits, [&] { check_mpm(task); })) continue;
    std::set<std::string> told;  // parts of one network, and a model without its pull, fail alike
    for (const ComparedModel& model : models) {
      const std::string& weights = model.choice.weights;
      if (told.contains(weights)) continue;
      const auto check = [&] {
        if (runs_on(model, task, options.other_scenes, training_runs, device)) fitting[t].push_back(model);
      };
      if (fails(fmt::format("{} and model '{}': ", scene, model.choice.name), misfits, check) && !weights.empty())
        told.insert(weights);
    }
  }
  if (!misfits.empty()) refuse(misfits);
  return fitting;
}

}  // namespace graupel::experiments
