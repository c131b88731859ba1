// The CPU threads behind parallel_for.
#pragma once

#include <cstdint>

namespace graupel {

/// run(context, c) for c in [0, chunks), on up to num_threads() threads that take the next chunk when they have
/// finished one. A thread that gets no processor in the meantime is not waited for: other processes on the cores cost
/// their share and no more. Within a parallel region all chunks are done by the calling thread.
void run_chunks(int64_t chunks, const void* context, void (*run)(const void* context, int64_t chunk));

/// Which of the threads of run_chunks() this is: 0 <= slot < num_threads(), 0 outside.
int thread_slot();

}  // namespace graupel
