#include "train/networks/torch_layers.h"

#include <ATen/ops/empty.h>

namespace graupel::train {

namespace {

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
