#include "train/sampling.h"

#include <algorithm>
#include <cmath>

#include "train/symmetry.h"

namespace graupel::train {

namespace {

/// Stream of the random numbers of one scene of one batch.
uint64_t stream_of(int64_t step, int64_t slot) {
  return (static_cast<uint64_t>(step) << 16) | static_cast<uint64_t>(slot);
}

/// Frames of a trajectory that have a next one.
int64_t usable(const TrajectoryInfo& trajectory) { return trajectory.frames - 1; }

void set_target(SceneGraph& graph, const graph::Normalization& normalization, const std::vector<Vec3f>& acceleration) {
  graph.target.reserve(3 * acceleration.size());
  for (const Vec3f& a : acceleration)
    for (int d = 0; d < 3; ++d)
      graph.target.push_back((a[d] - normalization.acceleration_mean[d]) / normalization.acceleration_std[d]);
}

/// Turns features and positions, from which the hierarchy is built, and the target's accelerations.
void turn_sample(const Symmetry& symmetry, const graph::HgnConfig& config, const graph::Normalization& normalization,
                 std::vector<float>& features, std::vector<Vec3f>& now, std::vector<Vec3f>& acceleration) {
  apply_to_features(symmetry, config, normalization, features);
  for (Vec3f& x : now) x = symmetry.apply(x);
  for (Vec3f& a : acceleration) a = symmetry.apply(a);
}

SceneGraph training_graph(const DataSplit& split, const TrainConfig& config, const graph::Normalization& normalization,
                          int64_t step, int64_t slot) {
  const SampleKey key = draw_sample(split, config.seed, step, slot);
  const TrajectoryInfo& trajectory = split.trajectory(key.trajectory);
  std::vector<std::vector<Vec3f>> history = split.history(key.trajectory, key.frame, config.hgn.history);
  std::vector<Vec3f> next = split.positions(key.trajectory, key.frame + 1, 1).front();
  const std::vector<Vec3f> noise = add_random_walk(
      history, config.noise_std, Random(config.seed, RandomPurpose::training_noise, stream_of(step, slot)));
  for (std::size_t p = 0; p < next.size(); ++p) next[p] += noise[p];

  std::vector<Vec3f> acceleration = acceleration_of(next, history);

  const graph::Surroundings& surroundings = trajectory.context->surroundings;
  SceneGraph graph;
  graph.type_row = trajectory.type_row;
  graph.features = graph::particle_features(config.hgn, normalization, surroundings, history);
  std::vector<Vec3f> now = std::move(history.back());
  Vec3d low = surroundings.wall_low, high = surroundings.wall_high;
  if (config.symmetries) {
    const Random random(config.seed, RandomPurpose::training_symmetry, stream_of(step, slot));
    const Symmetry symmetry = draw_symmetry(trajectory.context->scene.gravity, random);
    turn_sample(symmetry, config.hgn, normalization, graph.features, now, acceleration);
    apply_to_box(symmetry, low, high);
  }
  const Random random(config.seed, RandomPurpose::grid_jitter, stream_of(step, slot));
  for (int d = 0; d < 3; ++d) low[d] -= config.jitter_width() * random.uniform(0, d);
  graph.hierarchy = sparsegrid::build_hierarchy<3>(now, config.hgn.spacing, low, static_cast<int>(config.hgn.levels));
  set_target(graph, normalization, acceleration);
  return graph;
}

}  // namespace

SampleKey draw_sample(const DataSplit& split, uint64_t seed, int64_t step, int64_t slot) {
  const Random random(seed, RandomPurpose::batch_order, stream_of(step, slot));
  SampleKey key;
  key.trajectory = static_cast<int>(random.integer(0, 0, static_cast<uint32_t>(split.count())));
  key.frame = random.integer(0, 1, static_cast<uint32_t>(usable(split.trajectory(key.trajectory))));
  return key;
}

std::vector<SampleKey> strided_samples(const DataSplit& split, int64_t stride) {
  std::vector<SampleKey> keys;
  for (int i = 0; i < split.count(); ++i)
    for (int64_t t = 0; t < usable(split.trajectory(i)); t += stride) keys.push_back({i, t});
  return keys;
}

std::vector<SampleKey> spread_samples(const DataSplit& split, int64_t count) {
  const std::vector<SampleKey> all = strided_samples(split, 1);
  const auto total = static_cast<int64_t>(all.size());
  if (count >= total) return all;
  std::vector<SampleKey> keys;
  for (int64_t k = 0; k < count; ++k) keys.push_back(all[static_cast<std::size_t>((2 * k + 1) * total / (2 * count))]);
  return keys;
}

std::vector<Vec3f> add_random_walk(std::vector<std::vector<Vec3f>>& positions, double noise_std, const Random& random) {
  const std::size_t velocities = positions.size() - 1, particles = positions.front().size();
  const double increment = noise_std / std::sqrt(static_cast<double>(velocities));
  std::vector<Vec3f> newest(particles, Vec3f::zero());
  if (noise_std <= 0) return newest;
  const std::size_t draws = (3 * velocities + 3) / 4;  // of four normal numbers each
  std::vector<double> normal(4 * draws);
  for (std::size_t p = 0; p < particles; ++p) {
    for (std::size_t k = 0; k < draws; ++k)
      for (int pair = 0; pair < 2; ++pair) {
        const std::size_t at = 4 * k + 2 * static_cast<std::size_t>(pair);
        random.normal(p * draws + k, pair, normal[at], normal[at + 1]);
      }
    Vec3d velocity_noise = Vec3d::zero(), position_noise = Vec3d::zero();
    for (std::size_t j = 0; j < velocities; ++j) {
      for (int d = 0; d < 3; ++d) velocity_noise[d] += increment * normal[3 * j + static_cast<std::size_t>(d)];
      position_noise += velocity_noise;
      positions[j + 1][p] = (positions[j + 1][p].cast<double>() + position_noise).cast<float>();
    }
    newest[p] = position_noise.cast<float>();
  }
  return newest;
}

std::vector<Vec3f> acceleration_of(const std::vector<Vec3f>& next, const std::vector<std::vector<Vec3f>>& history) {
  const std::vector<Vec3f>&now = history.back(), &before = history[history.size() - 2];
  std::vector<Vec3f> acceleration(next.size());
  for (std::size_t p = 0; p < next.size(); ++p) {
    const Vec3d x = now[p].cast<double>();
    acceleration[p] = ((next[p].cast<double>() - x) - (x - before[p].cast<double>())).cast<float>();
  }
  return acceleration;
}

SceneGraph scene_graph(const graph::HgnConfig& config, const graph::Normalization& normalization,
                       const TrajectoryInfo& trajectory, const std::vector<std::vector<Vec3f>>& history,
                       const Vec3d& origin) {
  SceneGraph graph;
  graph.features = graph::particle_features(config, normalization, trajectory.context->surroundings, history);
  graph.type_row = trajectory.type_row;
  graph.hierarchy =
      sparsegrid::build_hierarchy<3>(history.back(), config.spacing, origin, static_cast<int>(config.levels));
  return graph;
}

Batch training_batch(const DataSplit& split, const TrainConfig& config, const graph::Normalization& normalization,
                     int64_t step, BatchShare share) {
  std::vector<SceneGraph> graphs;
  for (int64_t slot = share.first; slot < config.batch_scenes; slot += share.stride)
    graphs.push_back(training_graph(split, config, normalization, step, slot));
  return concatenate(graphs);
}

}  // namespace graupel::train
