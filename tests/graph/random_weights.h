// Untrained networks and particle clouds for tests.
#pragma once

#include <vector>

#include "core/math/vec.h"
#include "graph/config/gns_config.h"
#include "graph/config/hgn_config.h"
#include "nn/weights.h"

namespace graupel::graph {

/// Every weight of the network uniform in +-1/sqrt(fan in) (PyTorch's default for linear layers), layer norms near
/// identity, embeddings in +-1.
nn::Weights random_weights(const HgnConfig& config, const Normalization& normalization, uint64_t seed = 1);
nn::Weights random_weights(const GnsConfig& config, const Normalization& normalization, uint64_t seed = 1);

/// Sets the decoder's last layer to zero (one hidden layer): the normalised acceleration is 0 everywhere.
void silence_decoder(nn::Weights& weights);

/// `particles` random points in `count` cubes of half edge `radius` [m], with centres in the unit cube.
std::vector<Vec3f> blobs(int count, int particles, double radius, uint64_t seed = 1);

}  // namespace graupel::graph
