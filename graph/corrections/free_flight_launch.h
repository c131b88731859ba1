// Free flight on a GPU: three launches find the groups of a frame, one or two correct it. The
// numbers are those of the CPU.
#pragma once

#include "graph/corrections/free_flight_kernels.h"

namespace graupel::graph::flight {

/// All of `groups` lies in the GPU's memory. `stream`: a cudaStream_t; null: the default one.
void find_groups_on_gpu(const Groups& groups, void* stream);
void correct_on_gpu(const Groups& groups, Vec3f* next, void* stream);

}  // namespace graupel::graph::flight
