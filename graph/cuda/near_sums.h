// Sums of activations over the particles near a particle (HgnConfig::short_range) and the way back, as
// activation_sums.h: a row of bf16 numbers and four numbers of the link read a link, one bit an activation kept.
// Width 128; all pointers are to the GPU's memory.
#pragma once

#include "graph/cuda/row_layers.h"

namespace graupel::graph {

/// Links between particles by receiver; every link has its reverse.
struct NearLinks {
  int64_t particles = 0, links = 0;
  const int32_t* begin = nullptr;    ///< [particles + 1]
  const int32_t* sender = nullptr;   ///< [links]
  const int32_t* reverse = nullptr;  ///< [links] the link from receiver to sender; for gradients
  const float* features = nullptr;   ///< [links, 4] edge_features (graph/gns_graph.h)
};

/// sum[r] = scale * sum over the links q of receiver r of a(sent[sender(q)] + received[r] + W features[q]),
/// a = LeakyReLU_0.01.
struct NearSums {
  NearLinks links = {};
  const uint16_t *sent = nullptr, *received = nullptr;  ///< [particles, 128]
  const float* weight = nullptr;                        ///< W [128, 4], rows `stride` numbers apart
  int32_t stride = 0;
  float scale = 1;
  uint16_t* sum = nullptr;   ///< [particles, 128]
  uint8_t* signs = nullptr;  ///< [links, 16], as in activation_sums.h
};
void sum_near(const NearSums& sums, void* stream);

/// With d[q] = scale a'(q) g[r] the gradient before the activation of link q: received[n] its sum over the links that
/// reach particle n, sent[n] over those that leave it, and of W the sum of d[q] features[q].
struct NearGradient {
  NearLinks links = {};
  const uint16_t* g = nullptr;  ///< [particles, 128] gradient of the sums
  float scale = 1;
  const uint8_t* signs = nullptr;
  uint16_t *sent = nullptr, *received = nullptr;  ///< [particles, 128]
  float* partial = nullptr;                       ///< [most_offset_partials(), 4, 128], to be added
};
/// Returns how many partial sums it writes.
int sum_gradients(const NearGradient& gradient, void* stream);

}  // namespace graupel::graph
