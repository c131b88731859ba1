#include "train/networks/torch_layers.h"

#include <ATen/ops/addmm.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/leaky_relu.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/native_layer_norm.h>
#include <ATen/ops/native_layer_norm_backward.h>
#include <ATen/ops/sum.h>

#include "core/system/error.h"

namespace graupel::train {

namespace {

constexpr double norm_epsilon = 1e-5;

template <typename T>
const T* data_of(const at::Tensor& tensor) {
  return tensor.defined() ? tensor.data_ptr<T>() : nullptr;
}
RowIndex row_of(const Term& term) { return {data_of<int32_t>(term.index), term.shift}; }
template <typename T>
GatherTerm<T> term_of(const Term& term) {
  if (!term.table.defined()) return {nullptr, 0, {}};
  return {term.table.data_ptr<T>(), term.table.stride(0), row_of(term)};
}

/// Calls body(T()) with the tensors' number type.
template <typename Body>
void with_type(const at::Tensor& tensor, const Body& body) {
  if (tensor.scalar_type() == at::kDouble)
    body(double());
  else
    body(float());
}

}  // namespace

at::Tensor view_of(const Parameter& parameter, const at::Tensor& flat) {
  return flat.narrow(0, parameter.begin, parameter.count).view(parameter.shape);
}

std::map<std::string, Fcn> bind_fcns(const ParameterLayout& layout, const at::Tensor& flat,
                                     const at::Tensor& gradient) {
  std::map<std::string, Fcn> fcns;
  for (const graph::PlanLayer& shape : layout.plan().layers) {
    if (shape.is_linear()) continue;
    Fcn fcn;
    fcn.norm = shape.norm;
    fcn.slope = shape.slope;
    const auto bind = [&](const std::string& name, at::Tensor& value, at::Tensor& grad) {
      const Parameter& parameter = layout.find(shape.name + name);
      value = view_of(parameter, flat);
      if (gradient.defined()) grad = view_of(parameter, gradient);
    };
    bind(".layer1.weight", fcn.w1, fcn.w1_grad);
    bind(".layer1.bias", fcn.b1, fcn.b1_grad);
    for (int64_t l = 2; l <= shape.hidden_layers; ++l) {
      Fcn::Layer& layer = fcn.middle.emplace_back();
      bind(".layer" + std::to_string(l) + ".weight", layer.w, layer.w_grad);
      bind(".layer" + std::to_string(l) + ".bias", layer.b, layer.b_grad);
    }
    const std::string last = ".layer" + std::to_string(shape.hidden_layers + 1);
    bind(last + ".weight", fcn.w2, fcn.w2_grad);
    bind(last + ".bias", fcn.b2, fcn.b2_grad);
    if (shape.norm) {
      bind(".norm.weight", fcn.gamma, fcn.gamma_grad);
      bind(".norm.bias", fcn.beta, fcn.beta_grad);
    }
    fcns.emplace(shape.name, std::move(fcn));
  }
  return fcns;
}

std::map<std::string, Fcn::Layer> bind_gathers(const ParameterLayout& layout, const at::Tensor& flat,
                                               const at::Tensor& gradient) {
  std::map<std::string, Fcn::Layer> layers;
  for (const graph::PlanLayer& shape : layout.plan().layers) {
    if (!shape.is_linear()) continue;
    const Parameter &weight = layout.find(shape.name + ".weight"), &bias = layout.find(shape.name + ".bias");
    Fcn::Layer& layer = layers[shape.name];
    layer.w = view_of(weight, flat);
    layer.b = view_of(bias, flat);
    if (!gradient.defined()) continue;
    layer.w_grad = view_of(weight, gradient);
    layer.b_grad = view_of(bias, gradient);
  }
  return layers;
}

void activation_backward(const at::Tensor& activated, const at::Tensor& grad, double slope) {
  with_type(grad, [&](auto zero) {
    using T = decltype(zero);
    leaky_backward<T>(place_of(grad), grad.numel(), activated.data_ptr<T>(), grad.data_ptr<T>(), slope);
  });
}

at::Tensor second_layer(const Fcn& fcn, const at::Tensor& first_hidden, FcnRecord* record) {
  at::Tensor hidden = first_hidden;
  for (const Fcn::Layer& layer : fcn.middle) {
    if (record) record->earlier.push_back(hidden);
    hidden = at::addmm(layer.b, hidden, layer.w.t());
    at::leaky_relu_(hidden, fcn.slope);
  }
  const at::Tensor raw = at::addmm(fcn.b2, hidden, fcn.w2.t());
  if (record) record->hidden = hidden;
  if (!fcn.norm) return raw;
  auto [out, mean, rstd] = at::native_layer_norm(raw, {raw.size(1)}, fcn.gamma, fcn.beta, norm_epsilon);
  if (record) {
    record->raw = raw;
    record->mean = mean;
    record->rstd = rstd;
  }
  return out;
}

at::Tensor second_layer_backward(const Fcn& fcn, const FcnRecord& record, const at::Tensor& grad) {
  at::Tensor grad_raw = grad;
  if (fcn.norm) {
    auto [input, gamma, beta] = at::native_layer_norm_backward(grad, record.raw, {grad.size(1)}, record.mean,
                                                               record.rstd, fcn.gamma, fcn.beta, {true, true, true});
    fcn.gamma_grad.copy_(gamma);
    fcn.beta_grad.copy_(beta);
    grad_raw = input;
  }
  at::Tensor w2_grad = fcn.w2_grad, b2_grad = fcn.b2_grad;
  at::mm_out(w2_grad, grad_raw.t(), record.hidden);
  at::sum_out(b2_grad, grad_raw, 0);
  at::Tensor grad_sum = at::mm(grad_raw, fcn.w2);
  activation_backward(record.hidden, grad_sum, fcn.slope);
  for (std::size_t l = fcn.middle.size(); l-- > 0;) {
    const Fcn::Layer& layer = fcn.middle[l];
    at::Tensor w_grad = layer.w_grad, b_grad = layer.b_grad;
    at::mm_out(w_grad, grad_sum.t(), record.earlier[l]);
    at::sum_out(b_grad, grad_sum, 0);
    grad_sum = at::mm(grad_sum, layer.w);
    activation_backward(record.earlier[l], grad_sum, fcn.slope);
  }
  return grad_sum;
}

at::Tensor fcn_forward(const Fcn& fcn, const at::Tensor& input, FcnRecord* record) {
  at::Tensor hidden = at::addmm(fcn.b1, input, fcn.w1.t());
  at::leaky_relu_(hidden, fcn.slope);
  if (record) record->input = input;
  return second_layer(fcn, hidden, record);
}

at::Tensor fcn_backward(const Fcn& fcn, const FcnRecord& record, const at::Tensor& grad) {
  const at::Tensor grad_sum = second_layer_backward(fcn, record, grad);
  at::Tensor w1_grad = fcn.w1_grad, b1_grad = fcn.b1_grad;
  at::mm_out(w1_grad, grad_sum.t(), record.input);
  at::sum_out(b1_grad, grad_sum, 0);
  return at::mm(grad_sum, fcn.w1);
}

Device place_of(const at::Tensor& tensor) { return tensor.is_cuda() ? Device::cuda : Device::cpu; }

void gather_sum_leaky_into(const at::Tensor& out, const Term& a, const Term& b, const Term& c, double slope) {
  with_type(out, [&](auto zero) {
    using T = decltype(zero);
    gather_sum_leaky<T>(place_of(out), out.size(0), out.size(1), term_of<T>(a), term_of<T>(b), term_of<T>(c),
                        out.data_ptr<T>(), slope);
  });
}

namespace {
at::Tensor sum_segments(const at::Tensor& source, const Segments& segments, const at::Tensor& weight) {
  at::Tensor out = at::empty({segments.count, source.size(1)}, source.options());
  with_type(source, [&](auto zero) {
    using T = decltype(zero);
    segment_sum<T>(place_of(source), segments, source.size(1), source.data_ptr<T>(), source.stride(0),
                   data_of<T>(weight), out.data_ptr<T>());
  });
  return out;
}
}  // namespace

at::Tensor segment_sum(const at::Tensor& source, const at::Tensor& begin, const at::Tensor& item,
                       const at::Tensor& weight) {
  return sum_segments(source, {begin.size(0) - 1, data_of<int32_t>(begin), data_of<int32_t>(item), 0}, weight);
}

at::Tensor segment_sum_fixed(const at::Tensor& source, int fixed, const at::Tensor& weight) {
  return sum_segments(source, {source.size(0) / fixed, nullptr, nullptr, fixed}, weight);
}

at::Tensor gather_rows(int64_t rows, const Term& source, const at::Tensor& weight) {
  at::Tensor out = at::empty({rows, source.table.size(1)}, source.table.options());
  with_type(out, [&](auto zero) {
    using T = decltype(zero);
    gather_rows<T>(place_of(out), rows, out.size(1), source.table.data_ptr<T>(), source.table.stride(0), row_of(source),
                   data_of<T>(weight), out.data_ptr<T>());
  });
  return out;
}

}  // namespace graupel::train
