// Floating-point operations of one evaluation of a graph network (a frame, or FeatureConfig::bundle of them): those of
// its matrix products, a multiply-add counted as two. Biases, activations, norms and sums are not counted; they are
// some percent.
#pragma once

#include <cstdint>
#include <vector>

#include "graph/config/gns_config.h"
#include "graph/config/hgn_config.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

/// How first layers over concatenated inputs [f_i, f_j, e] are evaluated. Both give the same network.
enum class FirstLayers {
  whole,  ///< as the papers write them: all of the input, once a pair or an edge
  split   ///< the parts of f_i and f_j once a node; those of offsets, directions and embeddings, taken from tables or
          ///< added once a particle, are not counted
};
inline const char* name_of(FirstLayers first_layers) { return first_layers == FirstLayers::whole ? "whole" : "split"; }

/// Rows of an HGN's layers in one evaluation.
struct HgnRows {
  struct Level {
    int64_t cells = 0, edges = 0;
  };
  int64_t particles = 0;
  std::vector<Level> level;  ///< finest first
};
HgnRows rows_of(const sparsegrid::Hierarchy<3>& hierarchy);

/// Rows of a GNS's layers in one evaluation.
struct GnsRows {
  int64_t particles = 0;  ///< those of obstacles included
  int64_t moving = 0;     ///< those whose acceleration is asked for
  int64_t edges = 0;
};

double flop_of(const HgnConfig& config, const HgnRows& rows, FirstLayers first_layers = FirstLayers::split);
double flop_of(const GnsConfig& config, const GnsRows& rows, FirstLayers first_layers = FirstLayers::split);

}  // namespace graupel::graph
