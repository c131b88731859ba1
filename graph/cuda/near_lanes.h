// What one of the 16 lanes of a particle does in the kernels of near_sums.cu, for its eight columns; on the host, too.
// The rows of several links are under way together.
#pragma once

#include <cstring>

#include "core/host_device.h"
#include "graph/cuda/near_sums.h"

namespace graupel::graph::near {

constexpr int columns = 8;
constexpr int features = 4;
constexpr int sign_lanes = layer_width / columns;  ///< bytes of signs a link
constexpr int under_way = 4;
constexpr float slope = 0.01f;  ///< of HGN's activation

struct alignas(16) RowWord {
  uint32_t part[columns / 2];
};
struct alignas(16) Features {
  float of[features];
};

GRAUPEL_HD inline RowWord row_word(const uint16_t* rows, int64_t row, int lane) {
  return *(reinterpret_cast<const RowWord*>(rows + row * layer_width) + lane);
}
GRAUPEL_HD inline float number(const RowWord& word, int i) {
  const uint32_t bits = i % 2 ? word.part[i / 2] & 0xffff0000u : word.part[i / 2] << 16;
  float x;
  std::memcpy(&x, &bits, sizeof(x));
  return x;
}

/// A lane's rows of W.
struct LaneWeights {
  float of[columns][features];
  GRAUPEL_HD LaneWeights(const NearSums& s, int lane) {
    GRAUPEL_UNROLL
    for (int i = 0; i < columns; ++i) {
      GRAUPEL_UNROLL
      for (int k = 0; k < features; ++k) of[i][k] = s.weight[int64_t{columns * lane + i} * s.stride + k];
    }
  }
};

/// The sum of particle n, and the signs of its links.
GRAUPEL_HD inline void sum_links(const NearSums& s, const LaneWeights& w, int64_t n, int lane, float (&sum)[columns]) {
  const RowWord own = row_word(s.received, n, lane);
  float received[columns];
  GRAUPEL_UNROLL
  for (int i = 0; i < columns; ++i) {
    received[i] = number(own, i);
    sum[i] = 0;
  }
  const int32_t end = s.links.begin[n + 1];
  for (int32_t at = s.links.begin[n]; at < end; at += under_way) {
    RowWord word[under_way];
    Features feature[under_way];
    GRAUPEL_UNROLL
    for (int k = 0; k < under_way; ++k) {
      if (at + k >= end) continue;
      word[k] = row_word(s.sent, s.links.sender[at + k], lane);
      feature[k] = reinterpret_cast<const Features*>(s.links.features)[at + k];
    }
    GRAUPEL_UNROLL
    for (int k = 0; k < under_way; ++k) {
      if (at + k >= end) continue;
      unsigned signs = 0;
      GRAUPEL_UNROLL
      for (int i = 0; i < columns; ++i) {
        float x = received[i] + number(word[k], i);
        GRAUPEL_UNROLL
        for (int f = 0; f < features; ++f) x += w.of[i][f] * feature[k].of[f];
        if (x > 0) signs |= 1u << i;
        sum[i] += x > 0 ? x : slope * x;
      }
      s.signs[int64_t{at + k} * sign_lanes + lane] = static_cast<uint8_t>(signs);
    }
  }
  GRAUPEL_UNROLL
  for (int i = 0; i < columns; ++i) sum[i] *= s.scale;
}

/// The gradients of particle n; adds to those of W, [feature, column].
GRAUPEL_HD inline void sum_link_gradients(const NearGradient& d, int64_t n, int lane, float (&sent)[columns],
                                          float (&received)[columns], float (&weight)[features][columns]) {
  const RowWord own = row_word(d.g, n, lane);
  GRAUPEL_UNROLL
  for (int i = 0; i < columns; ++i) sent[i] = received[i] = 0;
  const int32_t end = d.links.begin[n + 1];
  for (int32_t at = d.links.begin[n]; at < end; at += under_way) {
    RowWord word[under_way];
    Features feature[under_way];
    unsigned arriving[under_way], leaving[under_way];
    GRAUPEL_UNROLL
    for (int k = 0; k < under_way; ++k) {
      if (at + k >= end) continue;
      word[k] = row_word(d.g, d.links.sender[at + k], lane);
      feature[k] = reinterpret_cast<const Features*>(d.links.features)[at + k];
      arriving[k] = d.signs[int64_t{at + k} * sign_lanes + lane];
      leaving[k] = d.signs[int64_t{d.links.reverse[at + k]} * sign_lanes + lane];
    }
    GRAUPEL_UNROLL
    for (int k = 0; k < under_way; ++k) {
      if (at + k >= end) continue;
      GRAUPEL_UNROLL
      for (int i = 0; i < columns; ++i) {
        sent[i] += number(word[k], i) * (leaving[k] >> i & 1 ? d.scale : slope * d.scale);
        const float x = number(own, i) * (arriving[k] >> i & 1 ? d.scale : slope * d.scale);
        received[i] += x;
        GRAUPEL_UNROLL
        for (int f = 0; f < features; ++f) weight[f][i] += feature[k].of[f] * x;
      }
    }
  }
}

}  // namespace graupel::graph::near
