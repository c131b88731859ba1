#include "train/data/sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/scene/material_config.h"
#include "core/scene/particle_rows.h"
#include "core/system/error.h"
#include "graph/networks/graph_network.h"
#include "graph/topology/gns_graph.h"
#include "train/data/symmetry.h"

namespace graupel::train {

namespace {

/// Frames of a trajectory that have a next one.
int64_t usable(const TrajectoryInfo& trajectory) { return trajectory.frames - 1; }

void set_links(SceneGraph& graph, const std::vector<Vec3f>& current, double radius) {
  graph.links = sparsegrid::build_radius_graph(current, radius, sparsegrid::SelfEdges::with);
  graph.edge_features.reserve(graph.links.sender.size() * graph::edge_feature_count);
  for (std::size_t r = 0; r < current.size(); ++r)
    for (int32_t e = graph.links.begin[r]; e < graph.links.begin[r + 1]; ++e) {
      const auto s = static_cast<std::size_t>(graph.links.sender[static_cast<std::size_t>(e)]);
      const auto features = graph::edge_features(current[s], current[r], radius);
      graph.edge_features.insert(graph.edge_features.end(), features.begin(), features.end());
    }
}

/// Hierarchy, links between particles at `current`.
void set_graph(SceneGraph& graph, const NetworkConfig& config, const std::vector<Vec3f>& current, const Vec3d& origin) {
  if (const auto* gns = std::get_if<graph::GnsConfig>(&config)) return set_links(graph, current, gns->radius);
  const auto& hgn = std::get<graph::HgnConfig>(config);
  graph.hierarchy = sparsegrid::build_hierarchy<3>(current, hgn.spacing, origin, static_cast<int>(hgn.levels));
}

/// Appends the obstacle particles in the receptive field of the turned positions `current`, their features and types.
void add_obstacles(SceneGraph& graph, const graph::GnsConfig& config, const SampleRules& rules,
                   const graph::Environment& environment, const SampleScene& scene, std::vector<Vec3f>& current) {
  if (!config.obstacle_particles) return;
  const std::vector<Vec3f>& points = environment.obstacle_particles.at_spacing(config.obstacle_spacing);
  std::vector<Vec3f> turned;
  turned.reserve(points.size());
  for (const Vec3f& x : points) turned.push_back(scene.symmetry.apply(x));
  const std::vector<int32_t> near = graph::within_cutoff(turned, current, config.receptive_field());
  const auto width = static_cast<std::size_t>(rules.features.width);
  for (const int32_t p : near) {
    Vec3f position[graph::most_history + 1];
    std::fill(std::begin(position), std::end(position), points[static_cast<std::size_t>(p)]);
    graph.features.resize(graph.features.size() + width);
    graph::write_feature_row(rules.features, scene.environment, scene.symmetry, graph::no_material, position,
                             graph.features.data() + graph.features.size() - width);
    current.push_back(turned[static_cast<std::size_t>(p)]);
  }
  graph.type_row.insert(graph.type_row.end(), near.size(), graph::embedding_row(obstacle_particle_type));
  graph.obstacle_particles = static_cast<int64_t>(near.size());
}

SceneGraph training_graph(const DataSplit& split, const TrainConfig& config, const SampleRules& rules, int64_t step,
                          int64_t slot) {
  const SampleDraw draw = draw_training_sample(split, config, step, slot);
  const TrajectoryInfo& trajectory = split.trajectory(draw.key.trajectory);
  GRAUPEL_ASSERT(!rules.features.material_constants || split.has_materials());
  const std::vector<std::vector<Vec3f>> history =
      split.history(draw.key.trajectory, draw.key.frame, rules.features.history);
  const std::vector<std::vector<Vec3f>> ahead = split.positions(draw.key.trajectory, draw.key.frame, rules.bundle + 1);
  graph::MovingEnvironment moving_environment(trajectory.context->environment);
  const graph::Environment& environment = moving_environment.at(draw.time);
  const SampleScene scene{0, draw.stream, draw.symmetry, draw.displacement, draw.drift, environment.view(Device::cpu)};
  const std::vector<int32_t> present = trajectory.present(draw.key.frame);
  SceneGraph graph;
  graph.type_row = particle_rows(trajectory.type_row, present);
  const std::size_t particles = present.size(), target_width = 3 * static_cast<std::size_t>(rules.bundle);
  graph.features.resize(particles * static_cast<std::size_t>(rules.features.width));
  graph.target.resize(particles * target_width);
  std::vector<Vec3f> current(particles);
  for (std::size_t row = 0; row < particles; ++row) {
    const auto p = static_cast<std::size_t>(present[row]);
    const auto truth = [&](int j) { return ahead[static_cast<std::size_t>(j)][p]; };
    Vec3f position[graph::most_positions];
    for (std::size_t t = 0; t < history.size(); ++t) position[t] = history[t][p];
    current[row] =
        write_disturbed_sample(rules, scene, p, trajectory.is_kinematic(p), trajectory.material_of(p), position, truth,
                               graph.features.data() + row * static_cast<std::size_t>(rules.features.width),
                               graph.target.data() + row * target_width);
    graph.leaves.push_back(trajectory.is_in_run(p, draw.key.frame, draw.key.frame + rules.bundle) ? 0 : 1);
  }
  if (config.architecture == Architecture::gns) add_obstacles(graph, config.gns, rules, environment, scene, current);
  set_graph(graph, config.network(), current, draw.origin);
  return graph;
}

}  // namespace

uint64_t stream_of(int64_t step, int64_t slot) {
  return (static_cast<uint64_t>(step) << 16) | static_cast<uint64_t>(slot);
}

int64_t pushes_of(const TrainConfig& config, int64_t step) {
  constexpr int64_t no_slot = 0xffff;  // one number for all scenes of a batch
  const Random random(config.seed, RandomPurpose::batch_order, stream_of(step, no_slot));
  if (config.push_steps == 0 || random.uniform(1) >= config.push_share) return 0;
  return 1 + random.integer(0, 0, static_cast<uint32_t>(config.push_steps));
}

SampleKey draw_sample(const DataSplit& split, uint64_t seed, int64_t step, int64_t slot, int64_t ahead,
                      int64_t bundle) {
  const Random random(seed, RandomPurpose::batch_order, stream_of(step, slot));
  SampleKey key;
  key.trajectory = static_cast<int>(random.integer(0, 0, static_cast<uint32_t>(split.count())));
  const TrajectoryInfo& trajectory = split.trajectory(key.trajectory);
  const int64_t frames = usable(trajectory) - ahead;
  GRAUPEL_ASSERT(frames > 0);
  key.frame = random.integer(0, 1, static_cast<uint32_t>(frames));
  for (int64_t tried = 0; !trajectory.some_count(key.frame, key.frame + bundle); key.frame = (key.frame + 1) % frames)
    GRAUPEL_ASSERT(++tried < frames);
  return key;
}

std::vector<SampleKey> strided_samples(const DataSplit& split, int64_t stride) {
  std::vector<SampleKey> keys;
  for (int i = 0; i < split.count(); ++i)
    for (int64_t t = 0; t < usable(split.trajectory(i)); t += stride)
      if (split.trajectory(i).some_count(t, t + 1)) keys.push_back({i, t});
  return keys;
}

std::vector<SampleKey> spread_samples(const DataSplit& split, int64_t count) {
  std::vector<SampleKey> all = strided_samples(split, 1);
  const auto total = static_cast<int64_t>(all.size());
  if (count >= total) return all;
  std::vector<SampleKey> keys;
  for (int64_t k = 0; k < count; ++k) keys.push_back(all[static_cast<std::size_t>((2 * k + 1) * total / (2 * count))]);
  return keys;
}

namespace {

/// Waves of random directions and lengths; their strains are `strain` at most, together.
Waves draw_waves(const Random& random, uint64_t first, const TrainConfig& config, double strain, int64_t dimensions) {
  Waves waves{};
  for (int i = 0; i < Waves::count; ++i) {
    const uint64_t draw = first + 2 * static_cast<uint64_t>(i);
    double a, b, c, unused;
    random.normal(draw, 0, a, b);
    random.normal(draw, 1, c, unused);
    if (dimensions == 2) c = 0;
    const double length =
        config.wave_shortest * std::pow(config.wave_longest / config.wave_shortest, random.uniform(draw + 1, 0));
    const double number = 2 * std::numbers::pi / length;
    waves.vector[i] = (normalized(Vec3d{a, b, c}) * number).cast<float>();
    waves.phase[i] = static_cast<float>(2 * std::numbers::pi * random.uniform(draw + 1, 1));
    waves.amplitude[i] = static_cast<float>(strain * random.uniform(draw + 1, 2) / (Waves::count * number));
  }
  return waves;
}

}  // namespace

SampleDraw draw_training_sample(const DataSplit& split, const TrainConfig& config, int64_t step, int64_t slot) {
  SampleDraw draw;
  const int64_t bundle = config.features().bundle;
  draw.key = draw_sample(split, config.seed, step, slot, pushes_of(config, step) * bundle + bundle - 1, bundle);
  draw.stream = stream_of(step, slot);
  const SceneContext& context = *split.trajectory(draw.key.trajectory).context;
  draw.time = context.time_of(draw.key.frame + 1);
  const int64_t dimensions = context.scene.domain.dimensions;
  const double spacing = spacing_of(config.network());
  draw.low = context.environment.grid_origin(spacing);
  draw.high = context.environment.wall_high;
  if (dimensions == 2) draw.high[2] = draw.low[2] + 2 * spacing;
  if (config.symmetries) {
    draw.symmetry = draw_symmetry(context.scene.gravity, dimensions,
                                  Random(config.seed, RandomPurpose::training_symmetry, draw.stream));
    apply_to_box(draw.symmetry, draw.low, draw.high);
  }
  const Random waves(config.seed, RandomPurpose::training_symmetry, draw.stream);
  constexpr uint64_t first = 16;  // after the draws of the symmetry
  if (waves.uniform(first) < config.wave_share) {
    draw.displacement = draw_waves(waves, first + 1, config, config.wave_strain, dimensions);
    draw.drift = draw_waves(waves, first + 1 + 2 * Waves::count, config, config.wave_rate, dimensions);
  }
  const Random random(config.seed, RandomPurpose::grid_jitter, draw.stream);
  draw.origin = draw.low;
  for (int d = 0; d < dimensions; ++d) draw.origin[d] -= config.jitter_width() * random.uniform(0, d);
  return draw;
}

Vec3d grid_origin(const TrajectoryInfo& trajectory, const NetworkConfig& config) {
  return trajectory.context->environment.grid_origin(spacing_of(config));
}

SampleRules sample_rules(const TrainConfig& config, const graph::Normalization& normalization) {
  return {graph::FeatureRules(config.features(), normalization),
          static_cast<int>(config.features().bundle),
          config.seed,
          config.noise_std,
          static_cast<float>(config.push_recovery),
          static_cast<float>(config.push_velocity_recovery),
          static_cast<float>(config.wave_recovery)};
}

std::vector<Vec3f> add_random_walk(std::vector<std::vector<Vec3f>>& positions, double noise_std, const Random& random) {
  const std::size_t particles = positions.front().size();
  GRAUPEL_ASSERT(positions.size() <= graph::most_history + 1);
  std::vector<Vec3f> newest(particles, Vec3f::zero());
  for (std::size_t p = 0; p < particles; ++p) {
    Vec3f position[graph::most_history + 1];
    for (std::size_t t = 0; t < positions.size(); ++t) position[t] = positions[t][p];
    newest[p] = add_noise(random, noise_std, static_cast<int>(positions.size()) - 1, p, position);
    for (std::size_t t = 0; t < positions.size(); ++t) positions[t][p] = position[t];
  }
  return newest;
}

std::vector<Vec3f> acceleration_of(const std::vector<Vec3f>& next, const std::vector<std::vector<Vec3f>>& history) {
  const std::vector<Vec3f>&current = history.back(), &before = history[history.size() - 2];
  std::vector<Vec3f> acceleration(next.size());
  for (std::size_t p = 0; p < next.size(); ++p) acceleration[p] = acceleration_at(next[p], current[p], before[p]);
  return acceleration;
}

SceneGraph scene_graph(const NetworkConfig& config, const graph::Normalization& normalization,
                       const graph::Environment& environment, const ParticleKinds& particles,
                       const std::vector<std::vector<Vec3f>>& history, const Vec3d& origin) {
  SceneGraph graph;
  graph.type_row = particles.type_row;
  std::vector<std::vector<Vec3f>> seen = history;
  if (const auto* gns = std::get_if<graph::GnsConfig>(&config); gns && gns->obstacle_particles) {
    graph::add_obstacle_particles(*gns, environment, seen, graph.type_row);
    graph.obstacle_particles = static_cast<int64_t>(seen.back().size() - history.back().size());
  }
  std::vector<int32_t> material = particles.material;
  if (!material.empty()) material.resize(seen.back().size(), graph::no_material);
  graph.features = graph::particle_features(features_of(config), normalization, environment, seen, material);
  set_graph(graph, config, seen.back(), origin);
  return graph;
}

Batch training_batch(const DataSplit& split, const TrainConfig& config, const graph::Normalization& normalization,
                     int64_t step, BatchShard shard) {
  const SampleRules rules = sample_rules(config, normalization);
  std::vector<SceneGraph> graphs;
  for (int64_t slot = shard.first; slot < config.batch_scenes; slot += shard.stride)
    graphs.push_back(training_graph(split, config, rules, step, slot));
  return concatenate(graphs);
}

}  // namespace graupel::train
