// Hyper-parameters of the hierarchical graph network, kept in the weights file's metadata.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "graph/config/feature_config.h"

namespace graupel {
namespace graph {

/// Values of the metadata keys "architecture" and "format_version" of a weights file.
inline constexpr const char* hgn_architecture = "hgn";
inline constexpr const char* hgn_format_version = "1";

/// What a receiver sums (docs/decisions/0011-sums-of-activations.md).
enum class Aggregation {
  messages,    ///< outputs of an FCN a message, as the paper says
  activations  ///< activations of a linear layer a message; the FCN is evaluated once a receiver, on the sum
};

/// Defaults are the HGN paper's (mode `paper`); docs/decisions/ settles what it leaves open.
struct HgnConfig : FeatureConfig {
  int64_t latent = 128;         ///< H
  int64_t levels = 4;           ///< L
  int64_t message_passing = 4;  ///< M
  double spacing = 0.035;       ///< R [m]
  double p2g_scale = 0.125;     ///< constant factor on the particle-to-grid sum
  Aggregation aggregation = Aggregation::messages;

  static constexpr RemovedField removed[] = {
      removed_predictor,
      {"short_range", "0 0.0", "links between particles cost twice the time and rollouts were worse"}};

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = HgnConfig;
    visit(&C::latent,
          FieldInfo{
              .name = "latent", .unit = "", .meaning = "Latent and hidden width", .range = Range::between(8, 1024)});
    visit(&C::levels, FieldInfo{.name = "levels", .unit = "", .meaning = "Grid levels", .range = Range::between(1, 8)});
    visit(&C::message_passing, FieldInfo{.name = "message_passing",
                                         .unit = "",
                                         .meaning = "Message-passing iterations per block",
                                         .range = Range::between(1, 16)});
    visit(&C::spacing,
          FieldInfo{
              .name = "spacing", .unit = "m", .meaning = "Cell size of the finest level", .range = Range::positive()});
    visit(&C::p2g_scale, FieldInfo{.name = "p2g_scale",
                                   .unit = "",
                                   .meaning = "Factor on the particle-to-grid sum",
                                   .range = Range::positive()});
    visit(&C::aggregation,
          FieldInfo{.name = "aggregation", .unit = "", .meaning = "What cells and particles sum of what reaches them"});
    FeatureConfig::fields(visit);
  }

  /// To and from safetensors metadata ("hgn.latent" = "128" ..., with "architecture" and "format_version"). Reading
  /// throws InputError naming `file`, key and value when a key is missing, unknown, unreadable or out of range.
  std::map<std::string, std::string> to_metadata() const;
  static HgnConfig from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

}  // namespace graph

template <>
struct EnumWords<graph::Aggregation> {
  static constexpr std::pair<const char*, graph::Aggregation> words[] = {
      {"messages", graph::Aggregation::messages}, {"activations", graph::Aggregation::activations}};
};

}  // namespace graupel
