// The tables of 'graupel-bench mpm', on the terminal and as JSON.
#pragma once

#include "bench/mpm/mpm_speed.h"

namespace graupel::bench {

/// The table that the options ask for: cubes by size and material, a recipe's batches, or one of --table.
void print_mpm_table(BenchMpmOptions& options);

}  // namespace graupel::bench
