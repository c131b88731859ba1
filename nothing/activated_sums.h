// Sums of activations over gathered rows: y = sum over i of w_i leaky_relu(row_i + table_i [+ base]). Rows are padded
// (nn/linear.h); additions are made in the order of i, column by column.
#pragma once

#include "nn/row_kernels.h"

namespace graupel::nn {

/// sum += sum over i < n of weight leaky_relu(row + table).
inline void add_activated(int width, int n, const ActivatedRow<float>* rows, float* sum) {
  row_kernels().add_activated(width, n, rows, sum);
}
inline void add_activated(int width, int n, const ActivatedRow<uint32_t>* rows, float* sum) {
  row_kernels().add_activated_packed(width, n, rows, sum);
}

/// sum = sum over i < n of weight leaky_relu(row + table + base). `base` may be packed where rows are.
inline void sum_activated(int width, int n, const ActivatedRow<float>* rows, const float* base, float* sum) {
  row_kernels().sum_activated(width, n, rows, base, sum);
}
inline void sum_activated(int width, int n, const ActivatedRow<uint32_t>* rows, const float* base, float* sum) {
  row_kernels().sum_activated_packed(width, n, rows, base, sum);
}
inline void sum_activated(int width, int n, const ActivatedRow<uint32_t>* rows, const uint32_t* base, float* sum) {
  row_kernels().sum_activated_over_packed(width, n, rows, base, sum);
}

}  // namespace graupel::nn
