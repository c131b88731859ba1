// Time of a graph network in libtorch alone, at the state of a trajectory's end: what the engines of graph/ are
// measured against. Features, graph and upload are made once and are not timed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "graph/plan/layer_plan.h"
#include "nn/weights.h"
#include "train/config/network_config.h"

namespace graupel::train {

struct NetworkTimingOptions {
  Device device = Device::cpu;
  int threads = 1;  ///< of libtorch and of its BLAS
  graph::FirstLayers first_layers = graph::FirstLayers::whole;
  int64_t warm_ups = 3;  ///< runs before those that are timed
  int64_t runs = 10;
};

struct NetworkTime {
  Architecture architecture = Architecture::hgn;
  int64_t particles = 0;        ///< those of obstacles not included
  double flop = 0;              ///< of a frame, as it was evaluated
  std::vector<double> seconds;  ///< of every run, ascending

  double median() const { return seconds[seconds.size() / 2]; }
};

/// Inference in f32 (TF32 products on a GPU): by libtorch's own operations where first layers are whole, by the passes
/// of training where they are split. `file` holds a trajectory of history + 1 frames or more; the newest ones of its
/// first trajectory are taken. Throws InputError for weights of another architecture, a file that is missing or damaged
/// and too few frames, ConfigError where the network is for other data.
NetworkTime time_network(const nn::Weights& weights, const std::string& file, const NetworkTimingOptions& options);

}  // namespace graupel::train
