// Weights as views of flat arrays, and the kernels of graph_kernels.h, on libtorch tensors. Internal: only the .cpp
// files of train/ that are compiled with libtorch include this.
#pragma once

#include <ATen/core/Tensor.h>

#include <map>
#include <string>
#include <vector>

#include "train/networks/graph_kernels.h"
#include "train/networks/parameter_layout.h"

namespace graupel::train {

/// Views of one FCN's weights and of their gradients; gradients are undefined where only inference is wanted.
struct Fcn {
  struct Layer {
    at::Tensor w, b, w_grad, b_grad;
  };
  at::Tensor w1, b1, w2, b2, gamma, beta;  ///< first layer, last layer, norm
  at::Tensor w1_grad, b1_grad, w2_grad, b2_grad, gamma_grad, beta_grad;
  std::vector<Layer> middle;  ///< further hidden layers
  double slope = graph::hgn_leaky_slope;
  bool norm = true;
};

/// All FCNs of the network by name, as views of a flat array (and of a flat gradient, which may be undefined).
std::map<std::string, Fcn> bind_fcns(const ParameterLayout& layout, const at::Tensor& flat, const at::Tensor& gradient);
/// All gather layers of the network by name, in the same way.
std::map<std::string, Fcn::Layer> bind_gathers(const ParameterLayout& layout, const at::Tensor& flat,
                                               const at::Tensor& gradient);
/// View of one parameter.
at::Tensor view_of(const Parameter& parameter, const at::Tensor& flat);

/// What the backward pass of an FCN needs.
struct FcnRecord {
  at::Tensor input;                 ///< of layer 1, where it is one tensor
  std::vector<at::Tensor> earlier;  ///< inputs of the middle layers: activated, [rows, H]
  at::Tensor hidden;                ///< input of the last layer: activated, [rows, H]
  at::Tensor raw;                   ///< before the norm
  at::Tensor mean, rstd;
};

/// The rest of an FCN after the first activation, LayerNorm(W2 hidden + b2) behind the middle layers. A record may be
/// null (inference).
at::Tensor second_layer(const Fcn& fcn, const at::Tensor& hidden, FcnRecord* record);
/// Gradient of the sum that entered the activation.
at::Tensor second_layer_backward(const Fcn& fcn, const FcnRecord& record, const at::Tensor& grad);

/// The whole FCN on rows of concatenated inputs.
at::Tensor fcn_forward(const Fcn& fcn, const at::Tensor& input, FcnRecord* record);
/// Gradient of the input.
at::Tensor fcn_backward(const Fcn& fcn, const FcnRecord& record, const at::Tensor& grad);

/// grad *= the activation's slope at the activated values.
void activation_backward(const at::Tensor& activated, const at::Tensor& grad, double slope);

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
