#include "graph/config/config_metadata.h"

#include "graph/config/hgn_config.h"

namespace graupel::graph {

namespace {

std::string value_of(const nn::Weights& weights, const char* key) {
  const auto found = weights.metadata.find(key);
  return found == weights.metadata.end() ? std::string() : found->second;
}

}  // namespace

namespace metadata {

std::string range_text(const Range& range) {
  const auto bound = [](double x) { return std::isinf(x) ? std::string(x < 0 ? "-inf" : "inf") : text_of(x); };
  return (range.low_open ? "above " : "from ") + bound(range.low) + " to " + bound(range.high);
}

std::string key_of(const std::string& prefix, const FieldInfo& info) { return prefix + std::string(info.name); }

std::string where(const std::string& file, const std::string& key) {
  return "'" + file + "': metadata key '" + key + "' ";
}

}  // namespace metadata

std::string removed_option(const FeatureConfig& config) {
  if (config.predictor == FramePredictor::none) return "";
  return "predictor (" + std::string(word_of(config.predictor)) +
         ", allowed: none) was removed: rollouts of networks that correct ballistic frames were no better. Train a " +
         "network without it";
}

std::string removed_option(const HgnConfig& config) {
  if (config.short_range == 0) return removed_option(static_cast<const FeatureConfig&>(config));
  return "short_range (" + metadata::text_of(config.short_range) +
         ", allowed: 0) was removed: links between particles cost twice the time and rollouts were worse. Train a " +
         "network without them";
}

std::string architecture_of(const nn::Weights& weights) { return value_of(weights, "architecture"); }

void check_architecture(const nn::Weights& weights, const std::string& architecture, const std::string& version,
                        const std::string& what) {
  if (const std::string found = architecture_of(weights); found != architecture)
    throw InputError("'" + weights.file + "' holds no " + what + " (architecture '" + found + "', supported: '" +
                     architecture + "'). Choose a weights file of that architecture");
  if (const std::string found = value_of(weights, "format_version"); found != version)
    throw InputError("'" + weights.file + "' has another format (format_version '" + found + "', supported: '" +
                     version + "'). Export the weights again");
}

}  // namespace graupel::graph
