// Weights as views of a flat array, and the kernels of graph_kernels.h, on libtorch tensors. Internal: only the .cpp
// files of train/ that are compiled with libtorch include this.
#pragma once

#include <ATen/core/Tensor.h>

#include "train/networks/graph_kernels.h"
#include "train/networks/parameter_layout.h"

namespace graupel::train {

/// View of one parameter.
at::Tensor view_of(const Parameter& parameter, const at::Tensor& flat);

/// Rows of nodes at one end of a set of links, and the links of each node. Indices are int32 tensors.
struct LinkEnd {
  bool is_own_row() const { return !index.defined() && shift == 0; }  ///< link l belongs to node l

  at::Tensor index;  ///< [links] node; undefined: l >> shift
  int shift = 0;
  at::Tensor begin, item;  ///< of sorted segments; undefined: 1 << shift links a node
};

/// out[l] = LeakyReLU(out[l] + sent[sender(l)] + received[receiver(l)]) for each link l; one of both may be empty.
void add_ends_and_activate(const at::Tensor& out, const LinkEnd& sender, const at::Tensor& sent,
                           const LinkEnd& receiver, const at::Tensor& received, double slope);
/// sum over the links l of each node of weight[l] * rows[l]; `weight` may be undefined.
at::Tensor sum_at(const LinkEnd& end, const at::Tensor& rows, const at::Tensor& weight);
/// weight[l] * nodes[node(l)] for each link l; `weight` may be undefined.
at::Tensor rows_at(const LinkEnd& end, int64_t links, const at::Tensor& nodes, const at::Tensor& weight);

}  // namespace graupel::train
