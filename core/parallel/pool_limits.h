// How many threads a process may have.
#pragma once

namespace graupel {

/// The number of threads that can be started now besides this one, plus one; at most `wanted`. Costs about 20 us each.
int startable_threads(int wanted);

/// From now on the threads of thread_pool.h and of OpenVDB are at most so many in the whole process.
void limit_pool(int threads);

}  // namespace graupel
