// Scenes that a coarse MPM model is trained and judged on: where the particles of the fine run are, and how far two
// fine runs and the coarse solver's own constants are off.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/recipes/category_recipe.h"
#include "hybrid/coarse_model.h"
#include "mpm/scene/scene_recipe.h"
#include "mpm/simulation.h"

namespace graupel::train {

/// Errors of a run against the fine one, means over the frames that are looked at.
struct RunErrors {
  double position = 0;  ///< mean squared distance of the particles [m^2]
  double density = 0;   ///< sum |m - m'| over cells of 4 dx, over the mass
  bool diverged = false;
};

struct CoarseScene {
  Scene scene;                                   ///< the fine one
  std::vector<mpm::PreparedScene> coarse;        ///< [resolutions], constants and step to be filled in
  std::vector<std::vector<std::size_t>> picked;  ///< [resolutions][coarse particles], the fine one's number of each
  std::vector<std::vector<Vec3f>> truth;         ///< [frames looked at][fine particles] [m]
  std::vector<std::vector<float>> density;       ///< [frames looked at][cells], share of the mass in each
  RunErrors floor;                               ///< of a fine run whose particles start 1e-4 dx off
  RunErrors opponent;                            ///< of MPM on 2 dx at its largest stable step
  int64_t opponent_substeps = 1;
};

struct CoarseSceneOptions {
  mpm::Split split = mpm::Split::train;
  int64_t count = 64;  ///< scenes of the recipe that are drawn
  uint64_t seed = 0;
  int64_t frames = 120;  ///< horizon
  int64_t stride = 10;   ///< frames between those looked at
  std::vector<double> resolutions = hybrid::CoarseModel().resolutions;
  /// hybrid::CoarseModel's, of all models that run on the scenes.
  std::map<MaterialModel, double> particle_share = {};
  Device target = Device::cpu;  ///< whose cost chooses the grid
  Device device = Device::cpu;
  std::function<void(const std::string&)> message = [](const std::string&) {};
  std::function<bool()> should_stop = [] { return false; };
};

/// Scenes without emitters, sinks and moving obstacles among those drawn, and whose runs do not diverge. Throws Error
/// (ExitCode::interrupted) once should_stop().
std::vector<CoarseScene> make_coarse_scenes(const CategoryRecipe& recipe, const CoarseSceneOptions& options);

/// Runs of each model on each scene, [models][scenes], all in one batch.
std::vector<std::vector<RunErrors>> run_coarse_models(const std::vector<hybrid::CoarseModel>& models,
                                                      const std::vector<const CoarseScene*>& scenes,
                                                      const CoarseSceneOptions& options);

}  // namespace graupel::train
