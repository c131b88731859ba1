#include "graph/networks/graph_network.h"

#include <cmath>

#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "graph/cpu/engine.h"
#include "graph/cpu/lap_timer.h"
#include "graph/features/normalization.h"
#include "graph/features/periodic_images.h"

namespace graupel::graph {

namespace {

std::unique_ptr<CpuEngine> make_engine(const NetworkConfig& config, const nn::Weights& weights) {
  const auto* hgn = std::get_if<HgnConfig>(&config);
  const auto make = !hgn                                           ? make_gns_engine
                    : hgn->aggregation == Aggregation::activations ? make_activation_engine
                                                                   : make_message_engine;
  return make(plan_of(config), weights, spacing_of(config));
}

/// A tensor under another name would be one that is missing.
void refuse_unknown_tensors(const NetworkConfig& config, const nn::Weights& weights) {
  nn::Weights known;
  add_normalization(known, {});
  for (const PlanTensor& tensor : plan_of(config).tensors()) known.tensors[tensor.name];
  for (const auto& [name, tensor] : weights.tensors)
    if (known.tensors.count(name) == 0)
      throw InputError("'" + weights.file + "' has the tensor '" + name +
                       "', which no such network has. It is damaged or of another version; export the weights again");
}

/// How far beyond periodic walls images lie [m]: all that can send a message to a particle of GNS; the coarsest cell of
/// HGN, whose levels do not fit the period.
double image_layer(const NetworkConfig& config) {
  if (const auto* hgn = std::get_if<HgnConfig>(&config))
    return hgn->spacing * std::exp2(static_cast<double>(hgn->levels - 1));
  return std::get<GnsConfig>(config).receptive_field();
}

}  // namespace

struct GraphNetwork::Impl {
  explicit Impl(const nn::Weights& weights)
      : config(network_config_of(weights)),
        normalization(read_normalization(weights)),
        engine(make_engine(config, weights)) {
    refuse_unknown_tensors(config, weights);
  }

  std::vector<float> forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const std::vector<Vec3f>& position, const Vec3d& origin, FrameTiming& timing,
                             const NetworkEngine* other) const {
    const FeatureConfig& c = features_of(config);
    const std::size_t n = particle_type.size();
    GRAUPEL_ASSERT(position.size() == n);
    GRAUPEL_ASSERT(features.size() == n * static_cast<std::size_t>(c.input_width() - c.embedding));
    std::vector<float> acceleration(n * static_cast<std::size_t>(c.output_width()));
    if (n == 0) return acceleration;
    for (const int32_t type : particle_type) embedding_row(type);  // refuses an unknown type before threads start
    if (other == nullptr) {
      engine->evaluate(features, particle_type, position, origin, acceleration, timing);
      return acceleration;
    }
    LapTimer watch;
    (*other)(features, particle_type, position, origin, acceleration);
    timing.network += watch.lap();
    return acceleration;
  }
  Vec3d origin(const Environment& environment) const { return environment.grid_origin(spacing_of(config)); }
  /// Settings of a network that sees obstacle particles; null: it does not.
  const GnsConfig* with_obstacles() const {
    const auto* gns = std::get_if<GnsConfig>(&config);
    return gns && gns->obstacle_particles ? gns : nullptr;
  }
  std::vector<float> predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                             const std::vector<int32_t>& material, const std::vector<std::vector<Vec3f>>& positions,
                             FrameTiming& timing, const NetworkEngine* other) const {
    LapTimer watch;
    std::vector<float> features =
        particle_features(features_of(config), normalization, environment, positions, material);
    const PeriodicImages images = periodic_images(environment, positions.back(), image_layer(config));
    timing.features += watch.lap();
    if (images.source.empty())
      return forward(features, particle_type, positions.back(), origin(environment), timing, other);
    std::vector<int32_t> all_types = particle_type;
    std::vector<Vec3f> all_positions = positions.back();
    const std::size_t n = particle_type.size(), width = features.size() / n;
    features.reserve((n + images.source.size()) * width);
    for (std::size_t k = 0; k < images.source.size(); ++k) {
      const auto source = static_cast<std::size_t>(images.source[k]);
      all_types.push_back(particle_type[source]);
      all_positions.push_back(positions.back()[source] + images.shift[k]);
      for (std::size_t f = 0; f < width; ++f) features.push_back(features[source * width + f]);
    }
    timing.hierarchy += watch.lap();
    std::vector<float> acceleration = forward(features, all_types, all_positions, origin(environment), timing, other);
    acceleration.resize(n * static_cast<std::size_t>(features_of(config).output_width()));
    return acceleration;
  }

  NetworkConfig config;
  Normalization normalization;
  std::unique_ptr<CpuEngine> engine;
};

GraphNetwork::GraphNetwork(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
GraphNetwork::~GraphNetwork() = default;

const NetworkConfig& GraphNetwork::config() const { return impl_->config; }
const FeatureConfig& GraphNetwork::feature_config() const { return features_of(impl_->config); }
const Normalization& GraphNetwork::normalization() const { return impl_->normalization; }
double GraphNetwork::spacing() const { return spacing_of(impl_->config); }

std::vector<float> GraphNetwork::forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                                         const std::vector<Vec3f>& position, const Vec3d& origin) const {
  FrameTiming unused;
  return impl_->forward(features, particle_type, position, origin, unused, nullptr);
}

std::vector<float> GraphNetwork::predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                                         const std::vector<int32_t>& material,
                                         const std::vector<std::vector<Vec3f>>& positions, FrameTiming& timing,
                                         const NetworkEngine* engine) const {
  const GnsConfig* gns = impl_->with_obstacles();
  if (!gns) return impl_->predict(environment, particle_type, material, positions, timing, engine);
  LapTimer watch;
  std::vector<std::vector<Vec3f>> all_positions = positions;
  std::vector<int32_t> all_types = particle_type;
  add_obstacle_particles(*gns, environment, all_positions, all_types);
  std::vector<int32_t> all_materials = material;
  if (!material.empty()) all_materials.resize(all_types.size(), no_material);
  timing.hierarchy += watch.lap();
  std::vector<float> acceleration =
      impl_->predict(environment, all_types, all_materials, all_positions, timing, engine);
  acceleration.resize(particle_type.size() * static_cast<std::size_t>(gns->output_width()));
  return acceleration;
}

double GraphNetwork::flop(const Environment& environment, const std::vector<Vec3f>& position) const {
  std::vector<std::vector<Vec3f>> all = {position};
  std::vector<int32_t> types_of_obstacles;
  if (const GnsConfig* gns = impl_->with_obstacles())
    add_obstacle_particles(*gns, environment, all, types_of_obstacles);
  PlanRows rows = impl_->engine->rows(all.back(), impl_->origin(environment));
  rows.moving = static_cast<int64_t>(position.size());
  return flop_of(plan_of(impl_->config), rows);
}

void add_obstacle_particles(const GnsConfig& config, const Environment& environment,
                            std::vector<std::vector<Vec3f>>& positions, std::vector<int32_t>& particle_type) {
  if (!config.obstacle_particles) return;
  const std::vector<Vec3f>& points = environment.obstacle_particles.at_spacing(config.obstacle_spacing);
  const std::vector<int32_t> near = within_cutoff(points, positions.back(), config.receptive_field());
  for (std::size_t f = 0; f < positions.size(); ++f) {
    const double back = static_cast<double>(positions.size() - 1 - f) * config.frame_time;
    for (const int32_t p : near)
      positions[f].push_back(environment.point_before(points[static_cast<std::size_t>(p)], back));
  }
  particle_type.insert(particle_type.end(), near.size(), obstacle_particle_type);
}

std::shared_ptr<const Network> load_network(const nn::Weights& weights) {
  return std::make_shared<const GraphNetwork>(weights);
}

}  // namespace graupel::graph
