// Hyper-parameters of the hierarchical graph network, kept in the weights file's metadata.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/fields.h"

namespace graupel::graph {

/// Values of the metadata keys "architecture" and "format_version" of a weights file.
inline constexpr const char* hgn_architecture = "hgn";
inline constexpr const char* hgn_format_version = "1";

/// Defaults are the HGN paper's (mode `paper`); docs/decisions/ settles what it leaves open.
struct HgnConfig {
  int64_t latent = 128;          ///< H
  int64_t levels = 4;            ///< L
  int64_t message_passing = 4;   ///< M
  int64_t embedding = 16;        ///< E
  int64_t history = 5;           ///< m velocities
  double spacing = 0.035;        ///< R [m]
  double wall_clamp = 0.28;      ///< d_max = 8 R [m]
  bool cell_normal = true;       ///< feature: normal of the particle's obstacle cell (the paper's)
  bool signed_distance = false;  ///< features: obstacle distance / band, and its gradient
  double distance_clamp = 0.1;   ///< [m] of that distance
  double p2g_scale = 0.125;      ///< constant factor on the particle-to-grid sum
  double frame_time = 1.0 / 60;  ///< [s] the network was trained for
  double dx = 1.0 / 64;          ///< cell size of the obstacle normals [m]

  int64_t input_width() const {
    return 3 * history + 6 + (cell_normal ? 3 : 0) + (signed_distance ? 4 : 0) + embedding;
  }

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
    visit(&C::embedding, FieldInfo{.name = "embedding",
                                   .unit = "",
                                   .meaning = "Width of the particle-type embedding",
                                   .range = Range::between(1, 64)});
    visit(&C::history, FieldInfo{.name = "history",
                                 .unit = "frames",
                                 .meaning = "Velocities the network sees",
                                 .range = Range::between(1, 16)});
    visit(&C::spacing,
          FieldInfo{
              .name = "spacing", .unit = "m", .meaning = "Cell size of the finest level", .range = Range::positive()});
    visit(&C::wall_clamp, FieldInfo{.name = "wall_clamp",
                                    .unit = "m",
                                    .meaning = "Wall distances are clamped to this",
                                    .range = Range::positive()});
    visit(&C::cell_normal,
          FieldInfo{.name = "cell_normal", .unit = "", .meaning = "Feature: obstacle normal of the particle's cell"});
    visit(&C::signed_distance,
          FieldInfo{.name = "signed_distance", .unit = "", .meaning = "Features: obstacle distance and its gradient"});
    visit(&C::distance_clamp, FieldInfo{.name = "distance_clamp",
                                        .unit = "m",
                                        .meaning = "Obstacle distances are clamped to this",
                                        .range = Range::positive()});
    visit(&C::p2g_scale, FieldInfo{.name = "p2g_scale",
                                   .unit = "",
                                   .meaning = "Factor on the particle-to-grid sum",
                                   .range = Range::positive()});
    visit(&C::frame_time,
          FieldInfo{.name = "frame_time", .unit = "s", .meaning = "Time between frames", .range = Range::positive()});
    visit(&C::dx,
          FieldInfo{
              .name = "dx", .unit = "m", .meaning = "Cell size of the obstacle normals", .range = Range::positive()});
  }

  /// To and from safetensors metadata ("hgn.latent" = "128" ..., with "architecture" and "format_version"). Reading
  /// throws InputError naming `file`, key and value when a key is missing, unknown, unreadable or out of range.
  std::map<std::string, std::string> to_metadata() const;
  static HgnConfig from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

/// Statistics of frame differences over the training set, per axis; std already includes the training noise.
struct Normalization {
  float velocity_mean[3] = {0, 0, 0}, velocity_std[3] = {1, 1, 1};
  float acceleration_mean[3] = {0, 0, 0}, acceleration_std[3] = {1, 1, 1};
};

}  // namespace graupel::graph
