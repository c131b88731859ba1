// Input features and prediction targets of the graph networks (HGN paper, section 3.1), and the statistics of their
// training data.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "core/scene/fields.h"
#include "core/scene/removed_field.h"

namespace graupel {
namespace graph {

/// Frames that a network may predict at once.
inline constexpr int most_bundle = 8;

/// Features of FeatureConfig::material_constants and ::contact.
inline constexpr int material_constant_count = 7, contact_feature_count = 7;

/// Networks that corrected a frame of gravity alone.
inline constexpr RemovedField removed_predictor = {"predictor", "\"none\"",
                                                   "rollouts of networks that correct ballistic frames were no better"};

/// The part of a network's hyper-parameters that settles its features, its outputs and the scenes it fits. Defaults are
/// the HGN paper's.
struct FeatureConfig {
  int64_t embedding = 16;        ///< E
  int64_t history = 5;           ///< m velocities
  double wall_clamp = 0.28;      ///< d_max = 8 R [m]
  bool cell_normal = true;       ///< feature: normal of the particle's obstacle cell (the paper's)
  bool signed_distance = false;  ///< features: obstacle distance / band, and its gradient
  double distance_clamp = 0.1;   ///< [m] of that distance
  /// features: constants of the particle's material (graph/features/material_constants.h)
  bool material_constants = false;
  /// features of the nearest surface within the clamps: friction, kind of contact, velocity (contact_features.h)
  bool contact = false;
  double frame_time = 1.0 / 60;  ///< [s] the network was trained for
  double dx = 1.0 / 64;          ///< cell size of the obstacle normals [m]
  int64_t dimensions = 3;        ///< of the scenes; in two all particles lie in a plane of z, and stay there
  /// Frames k predicted at once (time bundling; Brandstetter, Worrall and Welling 2022): accelerations a_1 .. a_k of
  /// the frames after the newest one, v_j = v_{j-1} + a_j, x_j = x_{j-1} + v_j.
  int64_t bundle = 1;

  static constexpr RemovedField removed[] = {removed_predictor};

  bool in_plane() const { return dimensions == 2; }
  int64_t input_width() const {
    return 3 * history + 6 + (cell_normal ? 3 : 0) + (signed_distance ? 4 : 0) +
           (material_constants ? material_constant_count : 0) + (contact ? contact_feature_count : 0) + embedding;
  }
  /// Numbers that the decoder gives for a particle: [a_1 xyz, a_2 xyz, ..].
  int64_t output_width() const { return 3 * bundle; }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = FeatureConfig;
    visit(&C::embedding, FieldInfo{.name = "embedding",
                                   .unit = "",
                                   .meaning = "Width of the particle-type embedding",
                                   .range = Range::between(1, 64)});
    visit(&C::history, FieldInfo{.name = "history",
                                 .unit = "frames",
                                 .meaning = "Velocities the network sees",
                                 .range = Range::between(1, 16)});
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
    visit(&C::material_constants,
          FieldInfo{
              .name = "material_constants", .unit = "", .meaning = "Features: constants of the particle's material"});
    visit(&C::contact, FieldInfo{.name = "contact",
                                 .unit = "",
                                 .meaning = "Features: friction, kind of contact and velocity of the nearest surface"});
    visit(&C::frame_time,
          FieldInfo{.name = "frame_time", .unit = "s", .meaning = "Time between frames", .range = Range::positive()});
    visit(&C::dx,
          FieldInfo{
              .name = "dx", .unit = "m", .meaning = "Cell size of the obstacle normals", .range = Range::positive()});
    visit(&C::dimensions,
          FieldInfo{
              .name = "dimensions", .unit = "", .meaning = "2 for scenes in the plane", .range = Range::between(2, 3)});
    visit(&C::bundle, FieldInfo{.name = "bundle",
                                .unit = "frames",
                                .meaning = "Frames that are predicted at once",
                                .range = Range::between(1, most_bundle)});
  }
};

/// Statistics of frame differences over the training set, per axis; std already includes the training noise.
struct Normalization {
  float velocity_mean[3] = {0, 0, 0}, velocity_std[3] = {1, 1, 1};
  float acceleration_mean[3] = {0, 0, 0}, acceleration_std[3] = {1, 1, 1};
};

}  // namespace graph
}  // namespace graupel
