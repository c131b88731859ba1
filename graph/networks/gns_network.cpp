#include "graph/networks/gns_network.h"

#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "graph/config/config_metadata.h"
#include "graph/cpu/lap_timer.h"
#include "graph/cpu/messages/gns_processor.h"
#include "graph/cpu/messages/particle_codec.h"
#include "graph/cpu/workspace_pool.h"
#include "graph/features/normalization.h"
#include "graph/plan/layer_plan.h"

namespace graupel::graph {

namespace {

GnsConfig read_config(const nn::Weights& weights) {
  check_architecture(weights, gns_architecture, gns_format_version, "graph network simulator (GNS)");
  return GnsConfig::from_metadata(weights.metadata, weights.file);
}

FcnForm form_of(const GnsConfig& config) {
  return {.latent = static_cast<int>(config.latent),
          .hidden_layers = static_cast<int>(config.hidden_layers),
          .slope = static_cast<float>(config.leaky_slope)};
}

}  // namespace

struct GnsNetwork::Impl {
  explicit Impl(const nn::Weights& weights)
      : config(read_config(weights)),
        normalization(read_normalization(weights)),
        width(nn::padded_width(static_cast<int>(config.latent))),
        encoder(weights, "encoder.node", config, form_of(config)),
        processor(weights, config),
        decoder(weights, config, form_of(config)) {}

  std::vector<float> forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                             const std::vector<Vec3f>& position, FrameTiming& timing) {
    const std::size_t n = particle_type.size();
    GRAUPEL_ASSERT(position.size() == n);
    GRAUPEL_ASSERT(features.size() == n * static_cast<std::size_t>(config.input_width() - config.embedding));
    std::vector<float> acceleration(n * static_cast<std::size_t>(config.output_width()));
    if (n == 0) return acceleration;
    for (const int32_t type : particle_type) embedding_row(type);  // refuses an unknown type before threads start
    LapTimer watch;
    auto workspace = workspaces.take();
    workspace->graph.build(position, config.radius);
    timing.hierarchy += watch.lap();
    evaluate(features, particle_type, *workspace, acceleration);
    timing.network += watch.lap();
    workspaces.give_back(std::move(workspace));
    return acceleration;
  }

  /// From the graph in the workspace.
  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type, GnsWorkspace& workspace,
                std::vector<float>& acceleration) const {
    workspace.prepare(width, static_cast<int>(config.input_width()));
    const int64_t n = workspace.graph.particles();
    const int32_t* order = workspace.graph.order.data();
    float* node = workspace.node.data();
    for_each_range(workspace, n, tile_rows, [&](int32_t begin, int32_t end, TileScratch& scratch) {
      encoder.apply(order + begin, end - begin, features, particle_type, scratch,
                    node + static_cast<int64_t>(begin) * width);
    });
    processor.apply(workspace);
    for_each_range(workspace, n, tile_rows, [&](int32_t begin, int32_t end, TileScratch& scratch) {
      decoder.apply(node + static_cast<int64_t>(begin) * width, order + begin, end - begin, scratch, acceleration);
    });
  }

  GnsConfig config;
  Normalization normalization;
  int width;
  ParticleEncoder encoder;
  GnsProcessor processor;
  ParticleDecoder decoder;
  WorkspacePool<GnsWorkspace> workspaces;
};

GnsNetwork::GnsNetwork(const nn::Weights& weights) : impl_(std::make_unique<Impl>(weights)) {}
GnsNetwork::~GnsNetwork() = default;
GnsNetwork::GnsNetwork(GnsNetwork&&) noexcept = default;

const GnsConfig& GnsNetwork::config() const { return impl_->config; }
const FeatureConfig& GnsNetwork::feature_config() const { return impl_->config; }
const Normalization& GnsNetwork::normalization() const { return impl_->normalization; }
double GnsNetwork::spacing() const { return config().radius; }

std::vector<float> GnsNetwork::forward(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                                       const std::vector<Vec3f>& position) const {
  FrameTiming unused;
  return impl_->forward(features, particle_type, position, unused);
}

std::vector<float> GnsNetwork::predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                                       const std::vector<std::vector<Vec3f>>& positions, FrameTiming& timing) const {
  LapTimer watch;
  std::vector<std::vector<Vec3f>> all_positions = positions;
  std::vector<int32_t> all_types = particle_type;
  add_obstacle_particles(impl_->config, environment, all_positions, all_types);
  timing.hierarchy += watch.lap();
  const std::vector<float> features =
      particle_features(impl_->config, impl_->normalization, environment, all_positions);
  timing.features += watch.lap();
  std::vector<float> acceleration = impl_->forward(features, all_types, all_positions.back(), timing);
  acceleration.resize(particle_type.size() * static_cast<std::size_t>(impl_->config.output_width()));
  return acceleration;
}

double GnsNetwork::flop(const Environment& environment, const std::vector<Vec3f>& position) const {
  const GnsConfig& c = impl_->config;
  std::vector<std::vector<Vec3f>> all = {position};
  std::vector<int32_t> types_of_obstacles;
  add_obstacle_particles(c, environment, all, types_of_obstacles);
  const auto links = sparsegrid::build_radius_graph(all.back(), c.radius, sparsegrid::SelfEdges::with);
  return flop_of(plan_of(c), {.particles = links.points(),
                              .moving = static_cast<int64_t>(position.size()),
                              .level = {{.cells = 0, .edges = links.edges()}}});
}

void add_obstacle_particles(const GnsConfig& config, const Environment& environment,
                            std::vector<std::vector<Vec3f>>& positions, std::vector<int32_t>& particle_type) {
  if (!config.obstacle_particles) return;
  const std::vector<Vec3f>& points = environment.obstacle_particles.at_spacing(config.obstacle_spacing);
  const std::vector<int32_t> near = within_reach(points, positions.back(), config.reach());
  for (std::vector<Vec3f>& frame : positions)
    for (const int32_t p : near) frame.push_back(points[static_cast<std::size_t>(p)]);
  particle_type.insert(particle_type.end(), near.size(), obstacle_particle_type);
}

}  // namespace graupel::graph
