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

/// What no training can have had, though each key alone allows it.
class ScaleCheck {
 public:
  ScaleCheck(const std::string& prefix, const std::string& file) : prefix_(prefix), file_(file) {}

  void operator()(const char* key, double value, double low, double high) const {
    if (value >= low && value <= high) return;
    throw InputError(metadata::where(file_, prefix_ + key) + "is out of range ('" + metadata::text_of(value) +
                     "', allowed from " + metadata::text_of(low) + " to " + metadata::text_of(high) +
                     "). Export the weights again");
  }
  /// `reach`: key and value of how far particles see each other [m].
  void features(const FeatureConfig& config, const char* reach_key, double reach) const {
    constexpr double shortest = 1e-6, longest = 1e3, longest_frame = 100;  // [m], [m], [s]
    (*this)("dx", config.dx, shortest, longest);
    (*this)("frame_time", config.frame_time, shortest, longest_frame);
    (*this)(reach_key, reach, config.dx / 20, config.dx * 100);
    (*this)("wall_clamp", config.wall_clamp, reach / 1000, reach * 1000);
    (*this)("distance_clamp", config.distance_clamp, reach / 1000, reach * 1000);
  }

 private:
  const std::string &prefix_, &file_;
};

}  // namespace

std::map<std::string, std::string> HgnConfig::to_metadata() const {
  return metadata_of(*this, hgn_prefix, hgn_architecture, hgn_format_version);
}
std::map<std::string, std::string> GnsConfig::to_metadata() const {
  return metadata_of(*this, gns_prefix, gns_architecture, gns_format_version);
}

HgnConfig HgnConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  const auto config = config_from<HgnConfig>(metadata, hgn_prefix, file,
                                             {"aggregation", "bundle", "dimensions", "material_constants", "contact"});
  const ScaleCheck check(hgn_prefix, file);
  check.features(config, "spacing", config.spacing);
  check("p2g_scale", config.p2g_scale, 1e-3, 16);
  return config;
}
GnsConfig GnsConfig::from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file) {
  const auto config =
      config_from<GnsConfig>(metadata, gns_prefix, file, {"bundle", "dimensions", "material_constants", "contact"});
  const ScaleCheck check(gns_prefix, file);
  check.features(config, "radius", config.radius);
  if (config.obstacle_particles)
    check("obstacle_spacing", config.obstacle_spacing, config.radius / 100, config.radius * 100);
  return config;
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
