// The hyper-parameters of the graph network in training, whichever its architecture.
#pragma once

#include <utility>
#include <variant>

#include "core/scene/fields.h"
#include "graph/config/network_config.h"
#include "graph/plan/layer_plan.h"

namespace graupel::train {

/// Words of the metadata key "architecture".
enum class Architecture { hgn, gns };

using graph::features_of;
using graph::metadata_of;
using graph::network_config_of;
using graph::NetworkConfig;
using graph::plan_of;
using graph::spacing_of;

inline Architecture architecture_of(const NetworkConfig& config) {
  return std::holds_alternative<graph::HgnConfig>(config) ? Architecture::hgn : Architecture::gns;
}

constexpr auto enum_list(Architecture) {
  return std::to_array<std::pair<const char*, Architecture>>({{"hgn", Architecture::hgn}, {"gns", Architecture::gns}});
}

}  // namespace graupel::train
