// Training samples: which frame of which trajectory, the noise on its history, and the network's view of it.
// Everything random depends on (seed, step, scene in the batch) alone.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/random.h"
#include "train/config/input_noise.h"
#include "train/config/train_config.h"
#include "train/data/batch.h"
#include "train/data/data_set.h"

namespace graupel::train {

/// One frame of one trajectory; the targets are the frames after it.
struct SampleKey {
  int trajectory = 0;
  int64_t frame = 0;
};

/// Stream of the random numbers of one scene of one batch.
uint64_t stream_of(int64_t step, int64_t slot);
/// Predictions that the network itself makes before the target of batch number `step`, of a bundle of frames each: 1 to
/// config.push_steps, each as likely, in config.push_share of the batches, else none.
int64_t pushes_of(const TrainConfig& config, int64_t step);
/// Uniform over trajectories, then over their frames that `ahead` more frames than the next one follow. Where no
/// particle counts in that frame and the next `bundle` ones (TrajectoryInfo::counts), the next frame in which some do,
/// the first one after the last. There must be one (DataSplit::check_samples).
SampleKey draw_sample(const DataSplit& split, uint64_t seed, int64_t step, int64_t slot, int64_t ahead = 0,
                      int64_t bundle = 1);
/// `count` samples spread evenly over all frames of a split in which particles count; the same for the same split.
std::vector<SampleKey> spread_samples(const DataSplit& split, int64_t count);
/// Every `stride`-th frame of every trajectory, where particles count.
std::vector<SampleKey> strided_samples(const DataSplit& split, int64_t stride);

/// Random-walk noise of GNS (Sanchez-Gonzalez et al. 2020, section 4.3) on `history` + 1 positions, newest last: each
/// of the m velocities gains an increment of standard deviation noise_std / sqrt(m), increments add up along the
/// history, so that the newest velocity's noise has noise_std; positions gain the sum, the oldest one none. Returns the
/// noise of the newest positions, which the target's next position gains too: the target then undoes the noise of the
/// velocity.
std::vector<Vec3f> add_random_walk(std::vector<std::vector<Vec3f>>& positions, double noise_std, const Random& random);

/// The acceleration x^{n+1} - 2 x^n + x^{n-1} [m/frame^2], from the next positions and a history (newest last).
std::vector<Vec3f> acceleration_of(const std::vector<Vec3f>& next, const std::vector<std::vector<Vec3f>>& history);

/// What the network sees of a history of particles, without target; HGN's grid starts at `origin`. `environment` is
/// that of the frame to come.
SceneGraph scene_graph(const NetworkConfig& config, const graph::Normalization& normalization,
                       const graph::Environment& environment, const ParticleKinds& particles,
                       const std::vector<std::vector<Vec3f>>& history, const Vec3d& origin);
/// Origin of the grid in evaluation and rollouts (graph::Environment::grid_origin).
Vec3d grid_origin(const TrajectoryInfo& trajectory, const NetworkConfig& config);

/// Scene number `slot` of batch number `step` of a run: which sample, and how the network sees its scene.
struct SampleDraw {
  SampleKey key;
  uint64_t stream = 0;
  double time = 0;  ///< [s] of the frame after the sample's, in which the network sees the environment
  AxisMap symmetry;
  Vec3d low, high;  ///< [m] the domain, turned; along z two layers of cells about the plane of two dimensions
  Vec3d origin;     ///< [m] of the grid, jittered
  Waves displacement, drift;
};
SampleDraw draw_training_sample(const DataSplit& split, const TrainConfig& config, int64_t step, int64_t slot);
SampleRules sample_rules(const TrainConfig& config, const graph::Normalization& normalization);

/// The scenes of a batch that one of several ranks takes: `first`, `first` + `stride` ...
struct BatchShard {
  int64_t first = 0, stride = 1;
};

/// Batch number `step` of a run, or a rank's shard of it. What a scene is depends on its place in the whole batch
/// alone.
Batch training_batch(const DataSplit& split, const TrainConfig& config, const graph::Normalization& normalization,
                     int64_t step, BatchShard shard = {});

}  // namespace graupel::train
