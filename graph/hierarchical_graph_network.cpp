#include "graph/hierarchical_graph_network.h"

#include <string>

#include "core/error.h"
#include "graph/config_metadata.h"
#include "graph/lap_timer.h"
#include "graph/level_transfer.h"
#include "graph/message_passing.h"
#include "graph/network_flop.h"
#include "graph/normalization.h"
#include "graph/particle_transfer.h"
#include "graph/workspace_pool.h"

namespace graupel::graph {

namespace {

HgnConfig read_config(const nn::Weights& weights) {
  check_architecture(weights, hgn_architecture, hgn_format_version, "hierarchical graph network");
  return HgnConfig::from_metadata(weights.metadata, weights.file);
}

}  // namespace

struct HierarchicalGraphNetwork::Impl {
  explicit Impl(const nn::Weights& weights)
      : config(read_config(weights)),
        normalization(read_normalization(weights)),
        width(nn::padded_width(static_cast<int>(config.latent))),
        particles(weights, config) {
    const auto levels = static_cast<std::size_t>(config.levels);
    for (std::size_t l = 0; l < levels; ++l) down.emplace_back(weights, config, "down." + std::to_string(l));
    for (std::size_t l = 0; l + 1 < levels; ++l) {
      up.emplace_back(weights, config, "up." + std::to_string(l));
      between.emplace_back(weights, config, l);
    }
  }

  /// Steps 0 to 12 of figure 2 of the paper.
  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                std::vector<float>& acceleration) const {
    workspace.topology.build(hierarchy);
    workspace.prepare(width, static_cast<int>(config.input_width()));
    particles.encode(features, particle_type, hierarchy, workspace);
    particles.particle_to_grid(hierarchy, workspace);
    down[0].apply(0, workspace);
    for (std::size_t l = 0; l < between.size(); ++l) {
      between[l].restrict_to_coarse(hierarchy, workspace);
      down[l + 1].apply(l + 1, workspace);
    }
    for (std::size_t l = between.size(); l-- > 0;) {
      between[l].prolong_to_fine(hierarchy, workspace);
      up[l].apply(l, workspace);
    }
    particles.grid_to_particle(hierarchy, workspace, acceleration);
  }

  HgnConfig config;
  Normalization normalization;
  int width;
  ParticleTransfer particles;
  std::vector<MessagePassing> down, up;
  std::vector<LevelTransfer> between;
  WorkspacePool<Workspace> workspaces;
};

HierarchicalGraphNetwork::HierarchicalGraphNetwork(const nn::Weights& weights)
    : impl_(std::make_unique<Impl>(weights)) {}
HierarchicalGraphNetwork::~HierarchicalGraphNetwork() = default;
HierarchicalGraphNetwork::HierarchicalGraphNetwork(HierarchicalGraphNetwork&&) noexcept = default;

const HgnConfig& HierarchicalGraphNetwork::config() const { return impl_->config; }
const FeatureConfig& HierarchicalGraphNetwork::feature_config() const { return impl_->config; }
const Normalization& HierarchicalGraphNetwork::normalization() const { return impl_->normalization; }
double HierarchicalGraphNetwork::spacing() const { return config().spacing; }

std::vector<float> HierarchicalGraphNetwork::forward(const std::vector<float>& features,
                                                     const std::vector<int32_t>& particle_type,
                                                     const sparsegrid::Hierarchy<3>& hierarchy) const {
  const HgnConfig& c = impl_->config;
  const std::size_t n = particle_type.size();
  GRAUPEL_ASSERT(features.size() == n * static_cast<std::size_t>(c.input_width() - c.embedding));
  GRAUPEL_ASSERT(hierarchy.cell.size() == n && hierarchy.levels.size() == static_cast<std::size_t>(c.levels));
  std::vector<float> acceleration(n * 3);
  if (n == 0) return acceleration;
  for (const int32_t type : particle_type) embedding_row(type);  // refuses an unknown type before threads start
  auto workspace = impl_->workspaces.take();
  impl_->evaluate(features, particle_type, hierarchy, *workspace, acceleration);
  impl_->workspaces.give_back(std::move(workspace));
  return acceleration;
}

std::vector<float> HierarchicalGraphNetwork::predict(const Surroundings& surroundings,
                                                     const std::vector<int32_t>& particle_type,
                                                     const std::vector<std::vector<Vec3f>>& positions,
                                                     FrameTiming& timing) const {
  const HgnConfig& c = impl_->config;
  LapTimer watch;
  const std::vector<float> features = particle_features(c, impl_->normalization, surroundings, positions);
  timing.features += watch.lap();
  const auto hierarchy =
      sparsegrid::build_hierarchy<3>(positions.back(), c.spacing, surroundings.wall_low, static_cast<int>(c.levels));
  timing.hierarchy += watch.lap();
  std::vector<float> acceleration = forward(features, particle_type, hierarchy);
  timing.network += watch.lap();
  return acceleration;
}

double HierarchicalGraphNetwork::flop(const Surroundings& surroundings, const std::vector<Vec3f>& position) const {
  const HgnConfig& c = impl_->config;
  const auto hierarchy =
      sparsegrid::build_hierarchy<3>(position, c.spacing, surroundings.wall_low, static_cast<int>(c.levels));
  return flop_of(c, rows_of(hierarchy));
}

}  // namespace graupel::graph
