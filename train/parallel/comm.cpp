#include "train/parallel/comm.h"

#include <ATen/core/Tensor.h>
#include <ATen/ops/from_blob.h>

#include <cstdint>

namespace graupel::train {

namespace {

class SingleProcess : public Comm {
 public:
  int rank() const override { return 0; }
  int size() const override { return 1; }
  void all_reduce_sum(at::Tensor&) override {}
  void broadcast(at::Tensor&) override {}
  void barrier() override {}
};

}  // namespace

Comm& single_process() {
  static SingleProcess comm;
  return comm;
}

std::vector<double> sum_over_ranks(Comm& comm, const std::vector<double>& own) {
  std::vector<double> sums = own;
  at::Tensor tensor = at::from_blob(sums.data(), {static_cast<int64_t>(sums.size())}, at::kDouble);
  comm.all_reduce_sum(tensor);
  return sums;
}

std::string broadcast_text(Comm& comm, const std::string& own) {
  if (comm.alone()) return own;
  std::string text = own;
  std::size_t length = own.size();
  broadcast_value(comm, length);
  text.resize(length);
  broadcast_bytes(comm, text.data(), length);
  return text;
}

void broadcast_bytes(Comm& comm, void* bytes, std::size_t count) {
  if (comm.alone() || count == 0) return;
  at::Tensor tensor = at::from_blob(bytes, {static_cast<int64_t>(count)}, at::kByte);
  comm.broadcast(tensor);
}

}  // namespace graupel::train
