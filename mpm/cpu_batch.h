// A batch of scenes as so many simulations: on the CPU, and for scenes that the tuned kernels for GPUs do not know.
#pragma once

#include <memory>
#include <vector>

#include "mpm/simulation.h"

namespace graupel::mpm {

std::unique_ptr<SceneBatch> make_side_by_side(const std::vector<PreparedScene>& scenes);

}  // namespace graupel::mpm
