// Callbacks at two points of the forward pass, where the caller may enqueue kernels on the same stream.
#pragma once

#include <functional>

namespace graupel::graph {

struct LaunchHooks {
  std::function<void()> graph_ready;  ///< called when the stream depends on nothing but the graph
  std::function<void()> room_beside;  ///< called before the coarse levels, which do not fill the GPU
};

}  // namespace graupel::graph
