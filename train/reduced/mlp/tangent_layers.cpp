#include "train/reduced/mlp/tangent_layers.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/clamp_max.h>
#include <ATen/ops/elu.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/lt.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/mul.h>
#include <ATen/ops/sum.h>

namespace graupel::train {

namespace {

/// elu'(a_0) from h_0 = elu(a_0).
at::Tensor slope_of(const at::Tensor& value) { return at::clamp_max(value, 0).add_(1); }

at::Tensor rows_of(const at::Tensor& streams) { return streams.reshape({-1, streams.size(2)}); }

/// Activates a_0 and multiplies the tangents, in place.
void activate(at::Tensor& streams) {
  at::Tensor value = streams.select(0, 0);
  at::elu_(value);
  streams.narrow(0, 1, tangent_streams - 1).mul_(slope_of(value));
}

/// Columns of the first layer's weights that belong to X and to q.
at::Tensor point_columns(const at::Tensor& weight) { return weight.narrow(1, 0, 3); }
at::Tensor state_columns(const at::Tensor& weight) { return weight.narrow(1, 3, weight.size(1) - 3); }

at::Tensor first_layer(const LinearLayer& layer, const TangentRecord& record) {
  const int64_t k = record.states.size(0), m = record.points.size(0), width = layer.weight.size(0);
  at::Tensor streams = at::empty({tangent_streams, k, m, width}, layer.weight.options());
  const at::Tensor along_x = point_columns(layer.weight).t(), along_q = state_columns(layer.weight).t();
  streams.select(0, 0).copy_(at::addmm(layer.bias, record.states, along_q).unsqueeze(1) +
                             at::mm(record.points, along_x).unsqueeze(0));
  streams.narrow(0, 1, 3).copy_(along_x.view({3, 1, 1, width}));
  streams.select(0, 4).copy_(at::mm(record.rates, along_q).unsqueeze(1));
  return streams.view({tangent_streams, k * m, width});
}

void first_layer_backward(const LinearLayer& layer, const TangentRecord& record, const at::Tensor& gradient) {
  const int64_t k = record.states.size(0), m = record.points.size(0);
  const at::Tensor by_row = gradient.view({tangent_streams, k, m, -1}), value = by_row.select(0, 0),
                   by_state = at::sum(value, 1), rate = at::sum(by_row.select(0, 4), 1);
  at::Tensor along_x = point_columns(layer.weight_gradient), along_q = state_columns(layer.weight_gradient),
             bias = layer.bias_gradient;
  along_x.copy_(at::mm(at::sum(value, 0).t(), record.points) +
                at::sum(gradient.narrow(0, 1, 3), at::IntArrayRef{1}).t());
  along_q.copy_(at::addmm(at::mm(by_state.t(), record.states), rate.t(), record.rates));
  bias.copy_(at::sum(by_state, 0));
}

}  // namespace

at::Tensor tangents_forward(const std::vector<LinearLayer>& layers, TangentRecord& record) {
  at::Tensor streams = first_layer(layers.front(), record);
  for (std::size_t l = 1; l < layers.size(); ++l) {
    activate(streams);
    record.hidden.push_back(streams);
    streams = at::mm(rows_of(streams), layers[l].weight.t()).view({tangent_streams, streams.size(1), -1});
    streams.select(0, 0).add_(layers[l].bias);
  }
  return streams;
}

void tangents_backward(const std::vector<LinearLayer>& layers, const TangentRecord& record, at::Tensor gradient) {
  for (std::size_t l = layers.size(); l-- > 1;) {
    const at::Tensor &hidden = record.hidden[l - 1], value = hidden.select(0, 0);
    at::Tensor weight = layers[l].weight_gradient, bias = layers[l].bias_gradient;
    at::mm_out(weight, rows_of(gradient).t(), rows_of(hidden));
    bias.copy_(at::sum(gradient.select(0, 0), 0));
    gradient = at::mm(rows_of(gradient), layers[l].weight).view_as(hidden);
    const at::Tensor curved =
        at::sum(gradient.narrow(0, 1, tangent_streams - 1) * hidden.narrow(0, 1, tangent_streams - 1), 0)
            .mul_(at::lt(value, 0));
    gradient.mul_(slope_of(value));
    gradient.select(0, 0).add_(curved);
  }
  first_layer_backward(layers.front(), record, gradient);
}

}  // namespace graupel::train
