#include "graph/config/network_config.h"

#include "core/system/error.h"
#include "graph/config/config_metadata.h"

namespace graupel::graph {

namespace {

const std::string hgn_prefix = "hgn.", gns_prefix = "gns.";

std::string value_of(const nn::Weights& weights, const char* key) {
  const auto found = weights.metadata.find(key);
  return found == weights.metadata.end() ? std::string() : found->second;
}

}  // namespace

std::map<std::string, std::string> HgnConfig::to_metadata() const {
  return metadata_of(*this, hgn_prefix, hgn_architecture, hgn_format_version);
}
std::map<std::string, std::string> GnsConfig::to_metadata() const {
  return metadata_of(*this, gns_prefix, gns_architecture, gns_format_version);
}

HgnConfig HgnConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  return config_from<HgnConfig>(metadata, hgn_prefix, file,
                                {"aggregation", "bundle", "dimensions", "material_constants", "contact"});
}
GnsConfig GnsConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  return config_from<GnsConfig>(metadata, gns_prefix, file, {"bundle", "dimensions", "material_constants", "contact"});
}

std::string architecture_of(const nn::Weights& weights) { return value_of(weights, "architecture"); }

NetworkConfig network_config_of(const nn::Weights& weights) {
  const std::string architecture = architecture_of(weights), version = value_of(weights, "format_version");
  const bool is_hgn = architecture == hgn_architecture;
  if (!is_hgn && architecture != gns_architecture)
    throw InputError("'" + weights.file + "' holds no graph network (architecture '" + architecture +
                     "', supported: '" + hgn_architecture + "', '" + gns_architecture +
                     "'). Choose a weights file of one of these architectures");
  if (const std::string supported = is_hgn ? hgn_format_version : gns_format_version; version != supported)
    throw InputError("'" + weights.file + "' has another format (format_version '" + version + "', supported: '" +
                     supported + "'). Export the weights again");
  if (is_hgn) return HgnConfig::from_metadata(weights.metadata, weights.file);
  return GnsConfig::from_metadata(weights.metadata, weights.file);
}

}  // namespace graupel::graph
