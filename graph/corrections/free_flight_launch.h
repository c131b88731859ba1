// Free flight on a GPU: three launches find the groups of a frame, one or two correct it, of all scenes at once. The
// numbers are those of the CPU.
#pragma once

#include <vector>

#include "graph/corrections/free_flight_kernels.h"

namespace graupel::graph::flight {

/// A scene's groups and its positions to be corrected.
struct Correction {
  Groups groups;
  Vec3f* next;
};

/// Nodes and counters as between frames, and the particles' masses `from`, copied to `mass`, in a stream.
void start_on_gpu(const Groups& groups, const std::vector<float>& from, float* mass, void* stream);
/// All of the groups of each scene lies in the GPU's memory. `stream`: a cudaStream_t; null: the default one.
void find_groups_on_gpu(const std::vector<Groups>& scenes, void* stream);
void correct_on_gpu(const std::vector<Correction>& scenes, void* stream);

}  // namespace graupel::graph::flight
