// Sums of activations over gathered rows, in registers: y = sum over i of w_i leaky_relu(row_i + table_i [+ base]).
// Rows are padded (nn/linear.h); additions are made in the order of i, column by column.
#pragma once

#include "nn/activation.h"
#include "nn/lanes.h"

namespace graupel::nn {

/// What one row adds; Word: float, or uint32_t of packed rows (nn/lanes.h).
template <typename Word>
struct ActivatedRow {
  const Word* row;
  const float* table;
  float weight;
};

namespace activated_sums {

enum class Form { onto_sum, over_base };

/// Columns [column, column + vectors * lanes).
template <int vectors, Form form, typename Item, typename Base>
inline void add_columns(int column, int n, const Item& item, const Base* base, float* sum) {
  Lanes start[vectors], total[vectors];
  if constexpr (form == Form::onto_sum) {
    load_columns(sum, column, total);
  } else {
    load_columns(base, column, start);
#pragma GCC unroll 8
    for (int v = 0; v < vectors; ++v) total[v] = Lanes{};
  }
  for (int i = 0; i < n; ++i) {
    const auto at = item(i);
    Lanes x[vectors];
    load_columns(at.row, column, x);
#pragma GCC unroll 8
    for (int v = 0; v < vectors; ++v) {
      x[v] += *reinterpret_cast<const Lanes*>(at.table + column + v * lanes);
      if constexpr (form == Form::over_base) x[v] += start[v];
      const Lanes small = leaky_slope * x[v];
      x[v] = x[v] > small ? x[v] : small;
      total[v] += at.weight * x[v];
    }
  }
#pragma GCC unroll 8
  for (int v = 0; v < vectors; ++v) *reinterpret_cast<Lanes*>(sum + column + v * lanes) = total[v];
}

template <Form form, typename Item, typename Base>
inline void add_rows(int width, int n, const Item& item, const Base* base, float* sum) {
  constexpr int few = panel / lanes, many = lanes == 16 ? 8 : few;  // as many as the registers hold
  int column = 0;
  for (; column + many * lanes <= width; column += many * lanes) add_columns<many, form>(column, n, item, base, sum);
  for (; column < width; column += panel) add_columns<few, form>(column, n, item, base, sum);
}

}  // namespace activated_sums

/// sum += sum over i < n of weight leaky_relu(row + table), item(i) an ActivatedRow.
template <typename Item>
inline void add_activated(int width, int n, const Item& item, float* sum) {
  activated_sums::add_rows<activated_sums::Form::onto_sum>(width, n, item, sum, sum);
}

/// sum = sum over i < n of weight leaky_relu(row + table + base). `base` may be packed.
template <typename Item, typename Base>
inline void sum_activated(int width, int n, const Item& item, const Base* base, float* sum) {
  activated_sums::add_rows<activated_sums::Form::over_base>(width, n, item, base, sum);
}

}  // namespace graupel::nn
