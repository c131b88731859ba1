// The hyper-parameters of the graph network in training, whichever its architecture.
#pragma once

#include <utility>
#include <variant>

#include "core/scene/fields.h"
#include "graph/config/network_config.h"
#include "graph/plan/layer_plan.h"

namespace graupel {
namespace train {

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

}  // namespace train

template <>
struct EnumWords<train::Architecture> {
  static constexpr std::pair<const char*, train::Architecture> words[] = {{"hgn", train::Architecture::hgn},
                                                                          {"gns", train::Architecture::gns}};
};

}  // namespace graupel
