// The ranks of a training run: processes that each take a part of every batch and add up their gradients. No torch
// header is needed to include this.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "core/parallel/device.h"
#include "core/system/error.h"
#include "train/parallel/rank_environment.h"

namespace at {
class Tensor;
}

namespace graupel::train {

/// Another rank has ended, does not answer, or was never there (exit 1).
struct CommError : Error {
  explicit CommError(const std::string& message) : Error(ExitCode::failed, message) {}
};

/// What ranks say to each other. Every rank must make the same calls in the same order; each call throws CommError
/// where a rank has gone. (With NCCL libtorch's watchdog ends the process instead.)
class Comm {
 public:
  virtual ~Comm() = default;

  virtual int rank() const = 0;
  virtual int size() const = 0;
  /// The sum over all ranks in place of `tensor`, which is contiguous; the same bits on every rank. For tensors on a
  /// GPU the call returns at once, and the current stream waits.
  virtual void all_reduce_sum(at::Tensor& tensor) = 0;
  /// Rank 0's values in place of `tensor`, which is contiguous.
  virtual void broadcast(at::Tensor& tensor) = 0;
  /// Returns when every rank has called it.
  virtual void barrier() = 0;

  bool alone() const { return size() == 1; }
  /// Rank 0 writes, validates and prints for all.
  bool leads() const { return rank() == 0; }
};

/// The only rank: every call returns at once.
Comm& single_process();

struct CommOptions {
  Device device = Device::cpu;
  double timeout = 600;  ///< [s] until a rank that does not answer is taken for gone
  std::function<void(const std::string&)> message;
};

/// Whether this build can connect ranks that compute on `device`.
bool can_join_ranks(Device device);

/// Joins the other ranks: NCCL where the device is a GPU, Gloo on the CPU. Throws CommError where some do not come in
/// time or compute on another device, ConfigError where this build of libtorch has no way to connect them.
std::unique_ptr<Comm> join_ranks(const RankEnvironment& environment, const CommOptions& options);

/// Sums of numbers over all ranks.
std::vector<double> sum_over_ranks(Comm& comm, const std::vector<double>& own);
/// Rank 0's text, on every rank.
std::string broadcast_text(Comm& comm, const std::string& own);
/// Rank 0's bytes in place of `bytes`.
void broadcast_bytes(Comm& comm, void* bytes, std::size_t count);
/// Rank 0's value in place of `value`; all ranks run the same program on machines of one kind.
template <typename T>
void broadcast_value(Comm& comm, T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  broadcast_bytes(comm, &value, sizeof(T));
}

}  // namespace graupel::train
