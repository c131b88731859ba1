#include "train/networks/torch_layers.h"

#include <ATen/ops/empty.h>

namespace graupel::train {

namespace {

Device place_of(const at::Tensor& tensor) { return tensor.is_cuda() ? Device::cuda : Device::cpu; }
template <typename T>
const T* data_of(const at::Tensor& tensor) {
  return tensor.defined() ? tensor.data_ptr<T>() : nullptr;
}
RowIndex row_of(const LinkEnd& end) { return {data_of<int32_t>(end.index), end.shift}; }
template <typename T>
GatherTerm<T> term_of(const LinkEnd& end, const at::Tensor& nodes) {
  return {nodes.data_ptr<T>(), nodes.stride(0), row_of(end)};
}
at::Tensor with_dense_rows(const at::Tensor& rows) { return rows.stride(1) == 1 ? rows : rows.contiguous(); }

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

void add_ends_and_activate(const at::Tensor& out, const LinkEnd& sender, const at::Tensor& sent,
                           const LinkEnd& receiver, const at::Tensor& received, double slope) {
  with_type(out, [&](auto zero) {
    using T = decltype(zero);
    GatherTerm<T> a{}, b{};
    if (sent.numel() > 0) a = term_of<T>(sender, sent);
    if (received.numel() > 0) (a.table ? b : a) = term_of<T>(receiver, received);
    gather_sum_leaky<T>(place_of(out), out.size(0), out.size(1), a, b, out.data_ptr<T>(), slope);
  });
}

at::Tensor sum_at(const LinkEnd& end, const at::Tensor& rows, const at::Tensor& weight) {
  const at::Tensor source = with_dense_rows(rows);
  const int32_t fixed = 1 << end.shift;
  const int64_t count = end.begin.defined() ? end.begin.size(0) - 1 : source.size(0) / fixed;
  const Segments segments{count, data_of<int32_t>(end.begin), data_of<int32_t>(end.item), fixed};
  at::Tensor out = at::empty({count, source.size(1)}, source.options());
  with_type(source, [&](auto zero) {
    using T = decltype(zero);
    segment_sum<T>(place_of(source), segments, source.size(1), source.data_ptr<T>(), source.stride(0),
                   data_of<T>(weight), out.data_ptr<T>());
  });
  return out;
}

at::Tensor rows_at(const LinkEnd& end, int64_t links, const at::Tensor& nodes, const at::Tensor& weight) {
  const at::Tensor source = with_dense_rows(nodes);
  at::Tensor out = at::empty({links, source.size(1)}, source.options());
  with_type(out, [&](auto zero) {
    using T = decltype(zero);
    gather_rows<T>(place_of(out), links, out.size(1), term_of<T>(end, source), data_of<T>(weight), out.data_ptr<T>());
  });
  return out;
}

}  // namespace graupel::train
