// Sums of activations over gathered rows, in registers: y = sum over i of w_i leaky_relu(row_i + table_i + base). Rows
// are padded (nn/linear.h); additions are made in the order of i, column by column.
#pragma once

#include "nn/activation.h"
#include "nn/lanes.h"

namespace graupel::nn {

/// What one row adds.
struct ActivatedRow {
  const float* row;
  const float* table;  ///< not read by add_activated
  float weight;
};

namespace activated_sums {

enum class Form { rows, rows_and_table };

/// Columns [0, vectors * lanes) of rows that begin at `column`.
template <int vectors, Form form, typename Item>
inline void add_columns(int column, int n, const Item& item, const float* base, float* sum) {
  Lanes start[vectors], total[vectors];
  for (int v = 0; v < vectors; ++v) {
    start[v] = *reinterpret_cast<const Lanes*>(base + column + v * lanes);
    if constexpr (form == Form::rows) total[v] = *reinterpret_cast<const Lanes*>(sum + column + v * lanes);
    if constexpr (form == Form::rows_and_table) total[v] = Lanes{};
  }
  for (int i = 0; i < n; ++i) {
    const ActivatedRow at = item(i);
    for (int v = 0; v < vectors; ++v) {
      const int c = column + v * lanes;
      Lanes x = *reinterpret_cast<const Lanes*>(at.row + c) + start[v];
      if constexpr (form == Form::rows_and_table) x += *reinterpret_cast<const Lanes*>(at.table + c);
      const Lanes small = leaky_slope * x;
      x = x > small ? x : small;
      total[v] += at.weight * x;
    }
  }
  for (int v = 0; v < vectors; ++v) *reinterpret_cast<Lanes*>(sum + column + v * lanes) = total[v];
}

template <Form form, typename Item>
inline void add_rows(int width, int n, const Item& item, const float* base, float* sum) {
  constexpr int few = panel / lanes, many = lanes == 16 ? 8 : few;  // as many as the registers hold
  int column = 0;
  for (; column + many * lanes <= width; column += many * lanes) add_columns<many, form>(column, n, item, base, sum);
  for (; column < width; column += panel) add_columns<few, form>(column, n, item, base, sum);
}

}  // namespace activated_sums

/// sum += sum over i < n of weight leaky_relu(row + base), item(i) an ActivatedRow.
template <typename Item>
inline void add_activated(int width, int n, const Item& item, const float* base, float* sum) {
  activated_sums::add_rows<activated_sums::Form::rows>(width, n, item, base, sum);
}

/// sum = sum over i < n of weight leaky_relu(row + table + base).
template <typename Item>
inline void sum_activated(int width, int n, const Item& item, const float* base, float* sum) {
  activated_sums::add_rows<activated_sums::Form::rows_and_table>(width, n, item, base, sum);
}

}  // namespace graupel::nn
