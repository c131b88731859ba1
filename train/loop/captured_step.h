// A step of training that launches the same kernels on the same memory every time: on a GPU it is recorded once as a
// CUDA graph and launched whole, since small layers take longer to launch one by one than to compute.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "core/parallel/device.h"

namespace graupel::train {

enum class StepLaunch {
  eager,  ///< kernel by kernel
  graph   ///< as one CUDA graph, where libtorch has CUDA
};

/// The stream that libtorch launches on now, a cudaStream_t; null: the default stream, or no GPU.
void* current_stream(Device device);

class CapturedStep {
 public:
  /// Runs before the recording: libraries load their kernels and choose among them.
  static constexpr int warm_up_runs = 3;

  explicit CapturedStep(StepLaunch launch);
  ~CapturedStep();
  CapturedStep(CapturedStep&&) noexcept;

  /// Does `work`. To be recorded it must not wait for the GPU, nor copy from or to the host. The memory that it reads
  /// and writes, but for what it allocates itself, and all sizes must be the same in every run since the last forget().
  void run(const std::function<void()>& work);
  /// The next run starts anew: memory or sizes have changed.
  void forget();
  /// Runs that launched a graph.
  int64_t replays() const { return replays_; }

 private:
  struct Graph;
  StepLaunch launch_;
  int warm_ups_ = 0;  ///< since the last forget()
  int64_t replays_ = 0;
  std::unique_ptr<Graph> graph_;
};

}  // namespace graupel::train
