#include "graph/config/hgn_config.h"

#include "graph/config/config_metadata.h"

namespace graupel::graph {

namespace {
const std::string prefix = "hgn.";
}

std::map<std::string, std::string> HgnConfig::to_metadata() const {
  return metadata_of(*this, prefix, hgn_architecture, hgn_format_version);
}

HgnConfig HgnConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  return config_from<HgnConfig>(metadata, prefix, file, {"aggregation", "bundle", "dimensions"});
}

}  // namespace graupel::graph
