// Where the caller of a network's launches adds its own to their stream.
#pragma once

#include <functional>

namespace graupel::graph {

struct LaunchMoments {
  std::function<void()> graph_ready;  ///< called when the stream waits for nothing but the graph
  std::function<void()> room_beside;  ///< called where what follows leaves multiprocessors idle
};

}  // namespace graupel::graph
