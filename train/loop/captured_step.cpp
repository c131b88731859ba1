#include "train/loop/captured_step.h"

#ifdef GRAUPEL_TORCH_CUDA
#include <cuda.h>  // first: the layout of libtorch's graph follows CUDA_VERSION in some of its versions

#include <ATen/cuda/CUDAGraph.h>
#include <c10/cuda/CUDACachingAllocator.h>
#include <c10/cuda/CUDAFunctions.h>
#include <c10/cuda/CUDAGuard.h>
#include <c10/cuda/CUDAStream.h>
#endif

namespace graupel::train {

#ifdef GRAUPEL_TORCH_CUDA

struct CapturedStep::Graph {
  /// Records `work` without doing it. What it allocates is the graph's own from then on.
  explicit Graph(const std::function<void()>& work) {
    c10::cuda::device_synchronize();
    c10::cuda::CUDACachingAllocator::emptyCache();  // of the warm-up: the graph holds as much again
    const c10::cuda::CUDAStreamGuard guard(c10::cuda::getStreamFromPool());  // the default stream cannot be recorded
    recorded.capture_begin();
    work();
    recorded.capture_end();
  }

  at::cuda::CUDAGraph recorded;
};

void* current_stream(Device device) {
  return device == Device::cuda ? c10::cuda::getCurrentCUDAStream().stream() : nullptr;
}

void CapturedStep::run(const std::function<void()>& work) {
  if (launch_ == StepLaunch::eager) return work();
  if (warm_ups_ < warm_up_runs) {
    ++warm_ups_;
    return work();
  }
  if (!graph_) graph_ = std::make_unique<Graph>(work);
  graph_->recorded.replay();
  ++replays_;
}

#else

struct CapturedStep::Graph {};

void* current_stream(Device) { return nullptr; }

void CapturedStep::run(const std::function<void()>& work) { work(); }

#endif

CapturedStep::CapturedStep(StepLaunch launch) : launch_(launch) {}
CapturedStep::~CapturedStep() = default;
CapturedStep::CapturedStep(CapturedStep&&) noexcept = default;

void CapturedStep::forget() {
  warm_ups_ = 0;
  graph_.reset();
}

}  // namespace graupel::train
