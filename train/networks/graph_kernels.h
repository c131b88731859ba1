// The operations of training that libtorch has no single call for: gather-add-activate, weighted segment sums, and the
// optimiser on the flat arrays. No atomics: sums run over sorted segments, so results repeat bit for bit on any device.
// Written as kernels because the eager equivalents read and write every [pairs, width] tensor three times more often.
#pragma once

#include <cstdint>

#include "core/parallel/device.h"

namespace graupel::train {

/// Which row of a table belongs to row r: index[r], or r >> shift where there is no index.
struct RowIndex {
  const int32_t* index = nullptr;
  int shift = 0;
};

/// Gathered rows; those of `table` lie `stride` numbers apart.
template <typename T>
struct GatherTerm {
  const T* table = nullptr;
  int64_t stride = 0;
  RowIndex row = {};
};

/// out[r] = LeakyReLU(a[row_a(r)] + b[row_b(r)] + out[r]), shape [rows, width]; b may be without a table. A slope of 0
/// is ReLU.
template <typename T>
void gather_sum_leaky(Device device, int64_t rows, int64_t width, const GatherTerm<T>& a, const GatherTerm<T>& b,
                      T* out, double slope);

/// Rows that are summed: segment s holds item[i] for i in [begin[s], begin[s+1]); `item` null means i itself, `begin`
/// null means `fixed` rows a segment.
struct Segments {
  int64_t count = 0;
  const int32_t* begin = nullptr;
  const int32_t* item = nullptr;
  int32_t fixed = 0;
};

/// out[s] = sum over the rows r of segment s of weight[r] * source[r], shape [segments, width]; `weight` null means 1.
template <typename T>
void segment_sum(Device device, const Segments& segments, int64_t width, const T* source, int64_t source_stride,
                 const T* weight, T* out);

/// out[r] = weight[r] * source[row(r)], shape [rows, width]; `weight` null means 1.
template <typename T>
void gather_rows(Device device, int64_t rows, int64_t width, const GatherTerm<T>& source, const T* weight, T* out);

/// Adam (Kingma and Ba 2015, algorithm 1) with the gradient scaled to at most `clip` in norm, and the moving average
/// ema = decay ema + (1 - decay) weights. A gradient that is not finite changes nothing.
struct AdamSettings {
  double learning_rate = 1e-4, beta1 = 0.9, beta2 = 0.999, epsilon = 1e-8;
  double correction1 = 1, correction2 = 1;  ///< 1 - beta^step
  double clip = 0;                          ///< 0: no clipping
  double ema_decay = 0;
  /// Where not null, in the device's memory: the learning rate and both corrections that are used in place of those
  /// above. A recorded step is replayed with others.
  const double* scheduled = nullptr;
};
/// `stream`: the cudaStream_t to launch on; null: the default one.
template <typename T>
void adam_step(Device device, int64_t count, const AdamSettings& settings, const T* gradient, const T* gradient_norm,
               T* weights, T* moment1, T* moment2, T* ema, void* stream = nullptr);

}  // namespace graupel::train
