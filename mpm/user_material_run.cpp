#include "mpm/user_material_run.h"

#include "core/system/error.h"
#include "mpm/solver/solver.h"

namespace graupel::mpm {

std::unique_ptr<Simulation> create_with_user_materials(const PreparedScene& prepared, const UserMaterials& laws) {
  if (laws.empty()) return Simulation::create(prepared);
  const auto& [scene, options, obstacles, particles] = prepared;
  if (options.device != Device::cpu)
    throw ConfigError("materials with laws of the caller's own run on the CPU only. Use Device::cpu");
  if (options.precision == Precision::f64)
    return std::make_unique<Solver<double>>(scene, options, particles, obstacles, laws);
  return std::make_unique<Solver<float>>(scene, options, particles, obstacles, laws);
}

}  // namespace graupel::mpm
