#include "graph/config/gns_config.h"

#include "graph/config/config_metadata.h"

namespace graupel::graph {

namespace {
const std::string prefix = "gns.";
}

std::map<std::string, std::string> GnsConfig::to_metadata() const {
  return metadata_of(*this, prefix, gns_architecture, gns_format_version);
}

GnsConfig GnsConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  return config_from<GnsConfig>(metadata, prefix, file, {"bundle", "dimensions"});
}

}  // namespace graupel::graph
