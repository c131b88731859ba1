// GNS written as its formulas stand, in double precision with concatenated inputs and all pairs, for tests.
#pragma once

#include <vector>

#include "core/math/vec.h"
#include "nn/weights.h"

namespace graupel::graph {

std::vector<double> reference_gns(const nn::Weights& weights, const std::vector<float>& features,
                                  const std::vector<int32_t>& particle_type, const std::vector<Vec3f>& position);

}  // namespace graupel::graph
