// A network with its derivatives along X and along the latent's rate, in training, on libtorch tensors: five streams,
// the value h_0, the tangents h_1 .. h_3 along the axes of X and h_4 along (0, q'),
//   a_s = h_s W^T (+ b for s = 0),   h_0 = elu(a_0),   h_s = elu'(a_0) a_s.
// Each layer is one product for all streams. elu' = min(h_0, 0) + 1 and elu'' a_s = h_s where h_0 < 0, so that the
// backward pass needs the h alone. Internal as encoder_layers.h.
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "train/reduced/mlp/encoder_layers.h"
#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

/// What the backward pass needs.
struct TangentRecord {
  at::Tensor points, states, rates;  ///< of the batch: X [m, 3], q [k, r], q' [k, r]
  std::vector<at::Tensor> hidden;    ///< activated, [streams, k m, width]
};

/// Outputs [streams, k m, outputs] at every point of every snapshot. `layers`: the first takes (X, q).
at::Tensor tangents_forward(const std::vector<LinearLayer>& layers, TangentRecord& record);
/// Fills the gradients of the weights from that with respect to the outputs.
void tangents_backward(const std::vector<LinearLayer>& layers, const TangentRecord& record, at::Tensor gradient);

}  // namespace graupel::train
