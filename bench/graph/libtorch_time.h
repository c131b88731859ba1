// The time of a graph network in libtorch, by `graupel-train time`: what Graupel's own engines are measured against.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/math/vec.h"
#include "core/parallel/device.h"
#include "graph/plan/layer_plan.h"

namespace graupel::bench {

/// A state of particles, as a network sees it.
struct NetworkState {
  std::string scene_json;                   ///< domain and obstacles
  double frame_time = 0;                    ///< [s]
  std::vector<int32_t> particle_type;       ///< [n]
  std::vector<std::vector<Vec3f>> history;  ///< at least 3 frames of [n] positions [m], newest last
};

struct LibtorchTime {
  graph::FirstLayers first_layers = graph::FirstLayers::whole;
  double seconds = 0;  ///< of the network alone, median
  double flop = 0;     ///< of a frame, as it was evaluated
  int threads = 0;
  std::string version, blas;  ///< of libtorch; what the BLAS says of itself
  std::string device, number_type;
};

/// On `device` with num_threads() threads. Throws ConfigError where this build has no graupel-train, Error where that
/// fails.
LibtorchTime time_in_libtorch(const std::string& weights_file, const NetworkState& state,
                              graph::FirstLayers first_layers, Device device);

}  // namespace graupel::bench
