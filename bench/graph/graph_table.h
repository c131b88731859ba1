// The table of 'graupel-bench graph', on the terminal and as JSON.
#pragma once

#include "bench/graph/graph_options.h"

namespace graupel::bench {

/// Measures all sizes, prints a row a model and state, writes --json.
void print_graph_table(BenchGraphOptions& options);

}  // namespace graupel::bench
