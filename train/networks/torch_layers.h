// Weights as views of a flat array, and the kernels of graph_kernels.h, on libtorch tensors. Internal: only the .cpp
// files of train/ that are compiled with libtorch include this.
#pragma once

#include <ATen/core/Tensor.h>

#include "train/networks/graph_kernels.h"
#include "train/networks/parameter_layout.h"

namespace graupel::train {

/// View of one parameter.
at::Tensor view_of(const Parameter& parameter, const at::Tensor& flat);

/// The kernels of graph_kernels.h on tensors. An index is an int32 tensor.
Device place_of(const at::Tensor& tensor);
/// A term of gather_sum_leaky: rows of `table` by an index, or by row >> shift.
struct Term {
  at::Tensor table;
  at::Tensor index;
  int shift = 0;
};
/// LeakyReLU of a sum of gathered rows (graph_kernels.h) into `out`, which may be c's table.
void gather_sum_leaky_into(const at::Tensor& out, const Term& a, const Term& b, const Term& c, double slope);
/// Sums over sorted segments; `item` and `weight` may be undefined.
at::Tensor segment_sum(const at::Tensor& source, const at::Tensor& begin, const at::Tensor& item,
                       const at::Tensor& weight);
/// Sums over groups of `fixed` rows.
at::Tensor segment_sum_fixed(const at::Tensor& source, int fixed, const at::Tensor& weight);
/// out[r] = weight[r] * source[row(r)]; `weight` may be undefined.
at::Tensor gather_rows(int64_t rows, const Term& source, const at::Tensor& weight);

}  // namespace graupel::train
