// One-step and rollout errors of a network on a split, beside two baselines that know nothing: no acceleration, and
// free fall (a = g dt^2).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "train/data/data_set.h"
#include "train/data/sampling.h"
#include "train/networks/network_module.h"

namespace graupel::train {

/// Where a particle is, by its true motion.
enum class Region {
  airborne,       ///< true acceleration within 5% of gravity's
  near_obstacle,  ///< not airborne, closer than 2 dx to an obstacle or a wall
  bulk            ///< the rest
};
inline constexpr Region all_regions[] = {Region::airborne, Region::near_obstacle, Region::bulk};
const char* name_of(Region region);

enum class Predictor { network, zero, ballistic };
inline constexpr Predictor all_predictors[] = {Predictor::network, Predictor::zero, Predictor::ballistic};
const char* name_of(Predictor predictor);

/// Sums of squared errors of the acceleration of the next frame, over axes and particles that move by themselves.
struct SquaredErrors {
  std::array<double, 3> raw{};         ///< by predictor [m^2/frame^4]
  std::array<double, 3> normalized{};  ///< by predictor, in standard deviations of the training accelerations
  int64_t particles = 0;

  void add(const SquaredErrors& other);
  /// Means over particles.
  double raw_mse(Predictor predictor) const;
  double normalized_mse(Predictor predictor) const;
};

struct OneStepErrors {
  std::array<SquaredErrors, 3> region;
  int64_t samples = 0;
  SquaredErrors all() const;
};

struct EvaluationOptions {
  StateArray which = StateArray::ema;
  int64_t batch_scenes = 16;
  int threads = 1;
  std::function<bool()> should_stop = {};  ///< asked between batches and frames; the errors are then of those before
};

OneStepErrors evaluate_one_step(const NetworkModule& module, const graph::Normalization& normalization,
                                const DataSplit& split, const std::vector<SampleKey>& samples,
                                const EvaluationOptions& options);

/// Rolls out the first `scenes` trajectories from their first frame for `frames` frames, with the network evaluated
/// once a bundle of frames, as graph::LearnedSimulator does without its corrections. Mean over particles, where rollout
/// and data have them in the run, and frames of |x - x_true|^2 [m^2]; infinite when a rollout blows up.
double evaluate_rollout(const NetworkModule& module, const graph::Normalization& normalization, const DataSplit& split,
                        int64_t scenes, int64_t frames, const EvaluationOptions& options);

}  // namespace graupel::train
