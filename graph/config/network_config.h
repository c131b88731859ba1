// The hyper-parameters of a graph network, whichever its architecture.
#pragma once

#include <map>
#include <string>
#include <variant>

#include "graph/config/gns_config.h"
#include "graph/config/hgn_config.h"
#include "nn/weights.h"

namespace graupel::graph {

using NetworkConfig = std::variant<HgnConfig, GnsConfig>;

inline const FeatureConfig& features_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) -> const FeatureConfig& { return c; }, config);
}
/// R [m]: cell size of the finest level, or radius of the graph.
inline double spacing_of(const NetworkConfig& config) {
  const auto* hgn = std::get_if<HgnConfig>(&config);
  return hgn != nullptr ? hgn->spacing : std::get<GnsConfig>(config).radius;
}
/// For a weights file.
inline std::map<std::string, std::string> metadata_of(const NetworkConfig& config) {
  return std::visit([](const auto& c) { return c.to_metadata(); }, config);
}

/// "architecture" of a weights file, "" where it has none.
std::string architecture_of(const nn::Weights& weights);
/// Of a weights file. Throws InputError for another architecture and for keys that are missing or wrong.
NetworkConfig network_config_of(const nn::Weights& weights);

}  // namespace graupel::graph
