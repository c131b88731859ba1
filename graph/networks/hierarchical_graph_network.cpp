#include "graph/networks/hierarchical_graph_network.h"

#include "core/system/error.h"
#include "graph/config/config_metadata.h"
#include "graph/cpu/hgn_engine.h"
#include "graph/cpu/lap_timer.h"
#include "graph/features/normalization.h"
#include "graph/plan/layer_plan.h"

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
        engine(config.aggregation == Aggregation::activations ? make_activation_engine(weights, config)
                                                              : make_message_engine(weights, config)) {}

  HgnConfig config;
  Normalization normalization;
  std::unique_ptr<HgnEngine> engine;
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
  std::vector<float> acceleration(n * static_cast<std::size_t>(c.output_width()));
  if (n == 0) return acceleration;
  for (const int32_t type : particle_type) embedding_row(type);  // refuses an unknown type before threads start
  impl_->engine->evaluate(features, particle_type, hierarchy, acceleration);
  return acceleration;
}

std::vector<float> HierarchicalGraphNetwork::predict(const Environment& environment,
                                                     const std::vector<int32_t>& particle_type,
                                                     const std::vector<std::vector<Vec3f>>& positions,
                                                     FrameTiming& timing) const {
  const HgnConfig& c = impl_->config;
  LapTimer watch;
  const std::vector<float> features = particle_features(c, impl_->normalization, environment, positions);
  timing.features += watch.lap();
  const auto hierarchy = sparsegrid::build_hierarchy<3>(positions.back(), c.spacing, environment.grid_origin(c.spacing),
                                                        static_cast<int>(c.levels));
  timing.hierarchy += watch.lap();
  std::vector<float> acceleration = forward(features, particle_type, hierarchy);
  timing.network += watch.lap();
  return acceleration;
}

double HierarchicalGraphNetwork::flop(const Environment& environment, const std::vector<Vec3f>& position) const {
  const HgnConfig& c = impl_->config;
  const auto hierarchy = sparsegrid::build_hierarchy<3>(position, c.spacing, environment.grid_origin(c.spacing),
                                                        static_cast<int>(c.levels));
  return flop_of(plan_of(c), rows_of(hierarchy));
}

}  // namespace graupel::graph
