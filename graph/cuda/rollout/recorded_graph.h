// Launches of a stream, and of those that it forks to and joins, as one CUDA graph.
#pragma once

#include <cuda_runtime.h>

#include "core/parallel/cuda_check.h"

namespace graupel::graph {

class RecordedGraph {
 public:
  RecordedGraph() = default;
  ~RecordedGraph() { drop(); }
  RecordedGraph(const RecordedGraph&) = delete;
  RecordedGraph& operator=(const RecordedGraph&) = delete;

  explicit operator bool() const { return graph_ != nullptr; }
  void drop() {
    if (graph_) cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
  }
  /// `launches` launches alone; all its memory is there.
  template <typename Launches>
  void record(cudaStream_t stream, const Launches& launches) {
    drop();
    cudaGraph_t captured = nullptr;
    GRAUPEL_CUDA_CHECK(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
    try {
      launches();
    } catch (...) {  // a stream that goes on recording would hide what went wrong
      if (cudaStreamEndCapture(stream, &captured) == cudaSuccess) cudaGraphDestroy(captured);
      cudaGetLastError();
      throw;
    }
    GRAUPEL_CUDA_CHECK(cudaStreamEndCapture(stream, &captured));
    GRAUPEL_CUDA_CHECK(cudaGraphInstantiate(&graph_, captured, 0));
    GRAUPEL_CUDA_CHECK(cudaGraphDestroy(captured));
  }
  void launch(cudaStream_t stream) { GRAUPEL_CUDA_CHECK(cudaGraphLaunch(graph_, stream)); }

 private:
  cudaGraphExec_t graph_ = nullptr;
};

}  // namespace graupel::graph
