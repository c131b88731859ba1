// The hyper-parameters of the graph network in training, whichever its architecture.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <variant>

#include "core/scene/fields.h"
#include "graph/config/gns_config.h"
#include "graph/config/hgn_config.h"
#include "graph/plan/layer_plan.h"
#include "nn/weights.h"

namespace graupel::train {

/// Words of the metadata key "architecture".
enum class Architecture { hgn, gns };

using NetworkConfig = std::variant<graph::HgnConfig, graph::GnsConfig>;

inline Architecture architecture_of(const NetworkConfig& config) {
  return std::holds_alternative<graph::HgnConfig>(config) ? Architecture::hgn : Architecture::gns;
}
inline const graph::FeatureConfig& features_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) -> const graph::FeatureConfig& { return c; }, config);
}
/// R [m]: cell size of the finest level, or radius of the graph.
inline double spacing_of(const NetworkConfig& config) {
  const auto* hgn = std::get_if<graph::HgnConfig>(&config);
  return hgn != nullptr ? hgn->spacing : std::get<graph::GnsConfig>(config).radius;
}
inline graph::LayerPlan plan_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) { return graph::plan_of(c); }, config);
}
/// For a weights file.
inline std::map<std::string, std::string> metadata_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) { return c.to_metadata(); }, config);
}

/// Of a weights file. Throws InputError for another architecture and for keys that are missing or wrong.
NetworkConfig network_config_of(const nn::Weights& weights);

constexpr auto enum_list(Architecture) {
  return std::to_array<std::pair<const char*, Architecture>>({{"hgn", Architecture::hgn}, {"gns", Architecture::gns}});
}

}  // namespace graupel::train
