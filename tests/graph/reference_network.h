// The network of the HGN paper written as its formulas stand, in double precision with concatenated inputs, for tests.
#pragma once

#include <vector>

#include "graph/config/hgn_config.h"
#include "nn/weights.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

std::vector<double> reference_forward(const nn::Weights& weights, const std::vector<float>& features,
                                      const std::vector<int32_t>& particle_type,
                                      const sparsegrid::Hierarchy<3>& hierarchy,
                                      const std::vector<Vec<float, 3>>& position);

}  // namespace graupel::graph
