// Which features a network has, for kernels of any device.
#pragma once

#include "graph/config/feature_config.h"

namespace graupel::graph {

/// What a FeatureConfig and a Normalization say about features.
struct FeatureRules {
  FeatureRules() = default;
  FeatureRules(const FeatureConfig& config, const Normalization& statistics)
      : history(static_cast<int>(config.history)),
        width(static_cast<int>(config.input_width() - config.embedding)),
        cell_normal(config.cell_normal),
        signed_distance(config.signed_distance),
        material_constants(config.material_constants),
        contact(config.contact),
        plane(config.in_plane()),
        wall_clamp(config.wall_clamp),
        distance_clamp(config.distance_clamp),
        normalization(statistics) {}

  int history = 0;  ///< velocities
  int width = 0;    ///< numbers a particle
  bool cell_normal = false, signed_distance = false;
  bool material_constants = false, contact = false;
  bool plane = false;                         ///< two dimensions
  double wall_clamp = 1, distance_clamp = 1;  ///< [m]
  Normalization normalization;
};

}  // namespace graupel::graph
