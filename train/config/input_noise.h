// One particle of a training sample, for kernels of any device: its history with noise, the features that the network
// sees and the accelerations that it is to predict.
//
// A network that predicts k frames at once is to make the first one from what it sees, noise and all, and then go on as
// the data do: a_1 leads to the true velocity of the next frame (with noise alone; see disturb and push_forward), so
// that a_j = x^{n+j} - 2 x^{n+j-1} + x^{n+j-2} of the data for j > 1. `Truth` gives the particle's true positions:
// truth(j) of frame n + j, n the newest one.
#pragma once

#include "core/math/random.h"
#include "graph/features/feature_row.h"
#include "graph/features/swept_collision.h"

namespace graupel::train {

struct SampleRules {
  graph::FeatureRules features;
  int bundle = 1;  ///< k
  uint64_t seed = 0;
  double noise_std = 0;  ///< [m/frame]
  // What the target takes in a frame, the first one of k:
  float push_recovery = 0;           ///< fraction of the way back to the true position
  float push_velocity_recovery = 0;  ///< the same of the true velocity
  float wave_recovery = 0;           ///< fraction of a wave's displacement
};

/// Longitudinal waves, amplitude cos(vector . x + phase) along the vector: what is too dense or too thin somewhere.
struct Waves {
  static constexpr int count = 3;
  Vec3f vector[count];  ///< [rad/m]
  float phase[count];
  float amplitude[count] = {0, 0, 0};  ///< [m] or [m/frame]; the vector's length times it is the strain

  GRAUPEL_HD Vec3f at(const Vec3f& x) const {
    Vec3f sum = Vec3f::zero();
    for (int i = 0; i < count; ++i)
      if (amplitude[i] != 0) sum += normalized(vector[i]) * (amplitude[i] * std::cos(dot(vector[i], x) + phase[i]));
    return sum;
  }
};

/// One scene of a batch.
struct SampleScene {
  int64_t first = 0;    ///< its first particle in the batch
  uint64_t stream = 0;  ///< of its random numbers
  AxisMap symmetry;     ///< the scene as the network sees it
  Waves displacement;   ///< [m] of the whole history
  Waves drift;          ///< [m/frame] by which the history moves
  graph::EnvironmentView environment;
};

/// Random-walk noise of GNS (Sanchez-Gonzalez et al. 2020, section 4.3) on velocities + 1 positions of particle p,
/// newest last; see add_random_walk. Returns the noise of the newest position.
GRAUPEL_HD inline Vec3f add_noise(const Random& random, double noise_std, int velocities, uint64_t p, Vec3f* position) {
  if (!(noise_std > 0)) return Vec3f::zero();
  const double increment = noise_std / std::sqrt(static_cast<double>(velocities));
  const auto draws = static_cast<uint64_t>(3 * velocities + 3) / 4;  // of four normal numbers each
  double normal[4] = {};
  Vec3d velocity_noise = Vec3d::zero(), position_noise = Vec3d::zero();
  for (int j = 0; j < velocities; ++j) {
    for (int d = 0; d < 3; ++d) {
      const int number = 3 * j + d;
      if (number % 4 == 0)
        for (int pair = 0; pair < 2; ++pair)
          random.normal(p * draws + static_cast<uint64_t>(number / 4), pair, normal[2 * pair], normal[2 * pair + 1]);
      velocity_noise[d] += increment * normal[number % 4];
    }
    position_noise += velocity_noise;
    position[j + 1] = (position[j + 1].cast<double>() + position_noise).cast<float>();
  }
  return position_noise.cast<float>();
}

/// Moves the history by waves: all of it by the displacement, older frames back by the drift. Rollouts get too dense in
/// places, which no frame of the data shows; the target's next position gains the displacement less what is to be
/// recovered of it, and nothing of the drift. Returns what `next` gains.
GRAUPEL_HD inline Vec3f add_waves(const SampleScene& scene, float recovery, int history, Vec3f* position) {
  const Vec3f x = position[history], displacement = scene.displacement.at(x), drift = scene.drift.at(x);
  for (int t = 0; t <= history; ++t) position[t] += displacement - drift * static_cast<float>(history - t);
  return displacement * (1 - recovery);
}

/// The acceleration x^{n+1} - 2 x^n + x^{n-1} [m/frame^2].
GRAUPEL_HD inline Vec3f acceleration_at(const Vec3f& next, const Vec3f& current, const Vec3f& before) {
  const Vec3d x = current.cast<double>();
  return ((next.cast<double>() - x) - (x - before.cast<double>())).cast<float>();
}

/// Adds waves and noise to a particle's history + 1 frames, newest last, and to what follows from them to its next one.
/// In the plane none of them leads out of it.
GRAUPEL_HD inline void disturb(const SampleRules& rules, const SampleScene& scene, uint64_t p, Vec3f* position,
                               Vec3f& next) {
  const int history = rules.features.history;
  const float z = next[2];
  next += add_waves(scene, rules.wave_recovery, history, position);
  next +=
      add_noise(Random(rules.seed, RandomPurpose::training_noise, scene.stream), rules.noise_std, history, p, position);
  if (!rules.features.plane) return;
  next[2] = z;
  for (int t = 0; t <= history; ++t) position[t][2] = z;
}

GRAUPEL_HD inline void write_target(const SampleRules& rules, const SampleScene& scene, const Vec3f& acceleration,
                                    float* target) {
  const Vec3f turned = scene.symmetry.apply(acceleration);
  const graph::Normalization& statistics = rules.features.normalization;
  for (int d = 0; d < 3; ++d)
    target[d] = (turned[d] - statistics.acceleration_mean[d]) / statistics.acceleration_std[d];
}

/// Features [rules.features.width] and normalised accelerations [3 k] of a particle of a `material`
/// (graph::write_feature_row), from history + 1 frames, newest last, and its next one. Returns where the grid has it.
template <typename Truth>
GRAUPEL_HD inline Vec3f write_sample(const SampleRules& rules, const SampleScene& scene, int32_t material,
                                     const Vec3f* position, const Vec3f& next, const Truth& truth, float* feature_row,
                                     float* target) {
  const int history = rules.features.history;
  write_target(rules, scene, acceleration_at(next, position[history], position[history - 1]), target);
  for (int j = 2; j <= rules.bundle; ++j)
    write_target(rules, scene, acceleration_at(truth(j), truth(j - 1), truth(j - 2)), target + 3 * (j - 1));
  graph::write_feature_row(rules.features, scene.environment, scene.symmetry, material, position, feature_row);
  return scene.symmetry.apply(position[history]);
}

/// Both at once, for particle p; `position` is changed. Kinematic particles stay where the data have them.
template <typename Truth>
GRAUPEL_HD inline Vec3f write_disturbed_sample(const SampleRules& rules, const SampleScene& scene, uint64_t p,
                                               bool is_kinematic, int32_t material, Vec3f* position, const Truth& truth,
                                               float* feature_row, float* target) {
  Vec3f next = truth(1);
  if (!is_kinematic) disturb(rules, scene, p, position, next);
  return write_sample(rules, scene, material, position, next, truth, feature_row, target);
}

/// A frame of the network's own: from the acceleration that it predicts (turned, normalised by `normalization`) to the
/// history moved on by one frame, whose true position is `truth`. The network moves on from the true positions where it
/// has left them by more than `farthest`, and where particles are kinematic.
GRAUPEL_HD inline void move_on(const SampleRules& rules, const SampleScene& scene, const graph::SweptCollision& way,
                               bool is_kinematic, const graph::Normalization& normalization, const float* predicted,
                               const Vec3f& truth, Vec3f* position) {
  constexpr float farthest = 0.1f;  // [m]
  const int history = rules.features.history;
  const Vec3f acceleration = graph::real_acceleration(normalization, rules.features.plane, predicted);
  Vec3f x = position[history] + (position[history] - position[history - 1]) + scene.symmetry.undo(acceleration);
  way.follow(position[history], x);
  if (rules.features.plane) x[2] = truth[2];
  if (is_kinematic || !(norm2(x - truth) <= farthest * farthest)) x = truth;
  for (int t = 0; t < history; ++t) position[t] = position[t + 1];
  position[history] = x;
}

/// The k frames of the network's own that it predicts at once (pushforward; Brandstetter, Worrall and Welling 2022);
/// `truth` is that of the newest frame after them. Returns the next position that the network should make then: that of
/// the true acceleration, and fractions of the way back to the true velocity and position. The whole way back would ask
/// for what no state tells: most of a velocity's error cannot be seen in it.
template <typename Truth>
GRAUPEL_HD inline Vec3f push_forward(const SampleRules& rules, const SampleScene& scene,
                                     const graph::SweptCollision& way, bool is_kinematic,
                                     const graph::Normalization& normalization, const float* predicted,
                                     const Truth& truth, Vec3f* position) {
  const int history = rules.features.history;
  for (int j = 1; j <= rules.bundle; ++j)
    move_on(rules, scene, way, is_kinematic, normalization, predicted + 3 * (j - 1), truth(j - rules.bundle), position);
  const Vec3f x = position[history], current = truth(0);
  const Vec3f velocity = x - position[history - 1], true_velocity = current - truth(-1);
  return x + (truth(1) - current) + (velocity - true_velocity) * (1 - rules.push_velocity_recovery) +
         (current - x) * rules.push_recovery;
}

}  // namespace graupel::train
