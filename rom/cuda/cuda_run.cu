#include <map>
#include <string>

#include "core/parallel/cuda_check.h"
#include "rom/cuda/cuda_run.h"
#include "rom/cuda/device_run.h"

namespace graupel::rom::device {

namespace {

namespace kernels {

template <typename Body>
__global__ void items(int64_t n, Body body) {
  const int64_t i = static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < n) body(i);
}
/// A kernel's blocks may take their places while the kernel before still works; what that wrote is there afterwards.
__device__ inline void await_kernel_before() {
#if __CUDA_ARCH__ >= 900
  cudaTriggerProgrammaticLaunchCompletion();  // of the one after: it waits itself
  cudaGridDependencySynchronize();
#endif
}
/// Shared memory that the launch sizes.
__device__ inline double* equation_room() {
  extern __shared__ double room[];
  return room;
}
template <typename Group>
__global__ void __launch_bounds__(step_threads, Group::outputs > 1 ? 2 : 1) run_branch(RunView view) {
  __shared__ BranchShared shared;
  await_kernel_before();
  branch<Group>(CudaBlock{}, view, shared);
}
__global__ void __launch_bounds__(step_threads, 4) run_decode(RunView view) {
  __shared__ DecodeShared shared;
  await_kernel_before();
  decode(CudaBlock{}, view, shared, equation_room());
}
/// Blocks that a multiprocessor has at once hide each other's waiting where there are many instances; alone, a spilled
/// register costs more.
template <int blocks>
__global__ void __launch_bounds__(step_threads, blocks) run_gather(RunView view) {
  __shared__ GatherShared shared;
  await_kernel_before();
  gather<false>(CudaBlock{}, view, shared);
}
__global__ void __launch_bounds__(step_threads, 1) run_fit(RunView view) {
  __shared__ FitShared shared;
  await_kernel_before();
  fit(CudaBlock{}, view, shared, equation_room());
}
__global__ void __launch_bounds__(step_threads, 1) run_prepare(RunView view) {
  __shared__ BranchShared shared;
  await_kernel_before();
  prepare(CudaBlock{}, view, shared);
}
__global__ void __launch_bounds__(step_threads, 4) run_decode_elastic(RunView view) {
  __shared__ ElasticShared shared;
  await_kernel_before();
  decode_elastic(CudaBlock{}, view, shared);
}
__global__ void __launch_bounds__(step_threads, 1) run_gather_and_project(RunView view) {
  __shared__ GatherAndProjectShared shared;
  await_kernel_before();
  gather_and_project(CudaBlock{}, view, shared);
}
__global__ void __launch_bounds__(step_threads) run_frame(RunView view, int instance, float* frame) {
  __shared__ DecodeShared shared;
  write_frame(CudaBlock{}, view, instance, frame, shared);
}

}  // namespace kernels

class CudaBackend {
 public:
  CudaBackend() {
    int device = 0;
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&processors_, cudaDevAttrMultiProcessorCount, device));
    int capability = 0;
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&capability, cudaDevAttrComputeCapabilityMajor, device));
    early_launch_ = capability >= 9;
    GRAUPEL_CUDA_CHECK(cudaStreamCreate(&stream_));
    GRAUPEL_CUDA_CHECK(cudaEventCreate(&begin_));
    GRAUPEL_CUDA_CHECK(cudaEventCreate(&end_));
  }
  ~CudaBackend() {
    for (const auto& [kind, graph] : graphs_) cudaGraphExecDestroy(graph);
    cudaEventDestroy(begin_);
    cudaEventDestroy(end_);
    cudaStreamDestroy(stream_);
  }
  CudaBackend(const CudaBackend&) = delete;
  CudaBackend& operator=(const CudaBackend&) = delete;

  Device device() const { return Device::cuda; }
  int processors() const { return processors_; }
  void wait() { GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(stream_)); }

  template <typename Body>
  void launch(int64_t n, const Body& body) {
    constexpr int threads = 128;
    kernels::items<<<static_cast<unsigned>((n + threads - 1) / threads), threads, 0, stream_>>>(n, body);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }
  void branch(const RunView& view) {
    if (has_many_instances(view))
      start(kernels::run_branch<ManyOutputs>, branch_blocks<ManyOutputs>(view), view);
    else
      start(kernels::run_branch<OneOutput>, branch_blocks<OneOutput>(view), view);
  }
  void decode(const RunView& view) {
    start(kernels::run_decode, view.instance_count * (1 + view.decode_blocks), view, equation_bytes(view));
  }
  void gather(const RunView& view) {
    start(has_many_instances(view) ? kernels::run_gather<2> : kernels::run_gather<1>,
          view.instance_count * view.gather_blocks, view);
  }
  void fit(const RunView& view) { start(kernels::run_fit, view.instance_count, view, equation_bytes(view)); }
  void prepare(const RunView& view) { start(kernels::run_prepare, view.instance_count * view.worker_blocks, view); }
  void decode_elastic(const RunView& view) {
    start(kernels::run_decode_elastic, view.instance_count * view.decode_blocks, view);
  }
  void gather_and_project(const RunView& view) {
    start(kernels::run_gather_and_project, view.instance_count * view.gather_blocks, view);
  }
  void write_frame(const RunView& view, int instance, float* frame) {
    const int blocks = std::min((view.model.particles + step_warps - 1) / step_warps, 8 * processors_);
    kernels::run_frame<<<static_cast<unsigned>(blocks), step_threads, 0, stream_>>>(view, instance, frame);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
  }

  /// Copies to the device after all that was launched.
  void write(const std::byte* from, std::size_t bytes, std::byte* to) {
    GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream_));
  }
  /// Copies to the host after all that was launched, and waits for it.
  template <typename T>
  void read(const T* from, std::size_t n, T* to) {
    GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(to, from, n * sizeof(T), cudaMemcpyDeviceToHost, stream_));
    wait();
  }

  /// Makes a graph of what `work` launches, once for each `kind`.
  template <typename Work>
  void record(int kind, const Work& work) {
    if (graphs_.count(kind) > 0) return;
    cudaGraph_t captured = nullptr;
    cudaGraphExec_t graph = nullptr;
    GRAUPEL_CUDA_CHECK(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
    work();
    GRAUPEL_CUDA_CHECK(cudaStreamEndCapture(stream_, &captured));
    GRAUPEL_CUDA_CHECK(cudaGraphInstantiate(&graph, captured, 0));
    GRAUPEL_CUDA_CHECK(cudaGraphDestroy(captured));
    graphs_[kind] = graph;
  }
  void play(int kind) { GRAUPEL_CUDA_CHECK(cudaGraphLaunch(graphs_.at(kind), stream_)); }

  /// Seconds on the device.
  template <typename Work>
  double timed(const Work& work) {
    GRAUPEL_CUDA_CHECK(cudaEventRecord(begin_, stream_));
    work();
    GRAUPEL_CUDA_CHECK(cudaEventRecord(end_, stream_));
    GRAUPEL_CUDA_CHECK(cudaEventSynchronize(end_));
    float milliseconds = 0;
    GRAUPEL_CUDA_CHECK(cudaEventElapsedTime(&milliseconds, begin_, end_));
    return 1e-3 * static_cast<double>(milliseconds);
  }

 private:
  static std::size_t equation_bytes(const RunView& view) {
    return static_cast<std::size_t>(EquationCapacity::size(view.model)) * sizeof(double);
  }
  void start(void (*kernel)(RunView), int blocks, const RunView& view, std::size_t shared_bytes = 0) {
    cudaLaunchAttribute early{};
    early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
    early.val.programmaticStreamSerializationAllowed = 1;
    cudaLaunchConfig_t launch{};
    launch.gridDim = static_cast<unsigned>(blocks);
    launch.blockDim = step_threads;
    launch.dynamicSmemBytes = shared_bytes;
    launch.stream = stream_;
    launch.attrs = &early;
    launch.numAttrs = early_launch_ ? 1 : 0;
    GRAUPEL_CUDA_CHECK(cudaLaunchKernelEx(&launch, kernel, view));
  }
  cudaStream_t stream_ = nullptr;
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
  std::map<int, cudaGraphExec_t> graphs_;
  int processors_ = 0;
  bool early_launch_ = false;  ///< kernels may take their places early (await_kernel_before)
};

}  // namespace

std::unique_ptr<DeviceRun> make_cuda_run(const ModelTable& model, std::vector<InstanceTable> tables,
                                         const RunSettings& settings) {
  return std::make_unique<DeviceRunOn<CudaBackend>>(model, std::move(tables), settings);
}

}  // namespace graupel::rom::device
