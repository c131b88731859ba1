#include "graph/features/material_constants.h"

#include <cmath>
#include <mutex>
#include <numbers>
#include <string>

#include "core/parallel/buffer.h"
#include "core/system/error.h"

namespace graupel::graph {

namespace {

constexpr double reference_stiffness = 3e5;      // [Pa]
constexpr double reference_viscosity = 0.01;     // [Pa s]
constexpr double viscosity_scale = 3;            // of the logarithm
constexpr double reference_cohesion = 50;        // [Pa]
constexpr double reference_hardening = 10;       // exponent
constexpr double reference_compression = 0.025;  // singular values
constexpr double reference_stretch = 0.005;

}  // namespace

MaterialConstants material_constants(const MaterialConfig& material) {
  MaterialConstants constants;
  if (material.model == MaterialModel::stationary) return constants;
  const auto put = [&](int number, double value) { constants.feature[number] = static_cast<float>(value); };
  const bool is_water = material.model == MaterialModel::water;
  put(0, std::log((is_water ? material.bulk_modulus : material.youngs_modulus) / reference_stiffness));
  if (is_water) put(1, std::log1p(material.viscosity / reference_viscosity) / viscosity_scale);
  if (material.model == MaterialModel::sand) {
    put(2, std::tan(material.friction_angle * std::numbers::pi / 180));
    put(3, std::log1p(material.cohesion / reference_cohesion));
  }
  if (material.model == MaterialModel::snow) {
    put(4, material.hardening / reference_hardening);
    put(5, material.critical_compression / reference_compression);
    put(6, material.critical_stretch / reference_stretch);
  }
  return constants;
}

struct MaterialTable::Impl {
  std::vector<std::string> name;
  std::vector<int32_t> type;
  std::vector<MaterialConstants> constants;
  std::once_flag uploaded;
  Buffer<MaterialConstants> on_gpu;
};

MaterialTable::MaterialTable(const Scene& scene) : impl_(std::make_shared<Impl>()) {
  for (const auto& [name, material] : scene.materials) {
    impl_->name.push_back(name);
    impl_->type.push_back(particle_type_of(material.model));
    impl_->constants.push_back(material_constants(material));
  }
}

std::vector<int32_t> MaterialTable::by_type(const std::vector<int32_t>& particle_type) const {
  constexpr int32_t unknown = -2;
  std::vector<int32_t> of_type(64, unknown), material;
  of_type[obstacle_particle_type] = no_material;
  material.reserve(particle_type.size());
  for (const int32_t type : particle_type) {
    if (type < 0 || static_cast<std::size_t>(type) >= of_type.size())
      throw InputError("a particle type is not known (" + std::to_string(type) + ", allowed 0 to 63)");
    int32_t& found = of_type[static_cast<std::size_t>(type)];
    for (std::size_t m = 0; found == unknown && m < impl_->type.size(); ++m) {
      if (impl_->type[m] != type) continue;
      for (std::size_t other = m + 1; other < impl_->type.size(); ++other)
        if (impl_->type[other] == type)
          throw ConfigError("materials '" + impl_->name[m] + "' and '" + impl_->name[other] + "' are of one law (" +
                            particle_type_name(type) +
                            "), so that the particles' types do not tell which of them a "
                            "particle is of. Give the particles' materials");
      found = static_cast<int32_t>(m);
    }
    if (found == unknown)
      throw InputError("the scene has no material of a particle's type (" + particle_type_name(type) +
                       "). Use particles of the scene");
    material.push_back(found);
  }
  return material;
}

const MaterialConstants* MaterialTable::constants(Device device) const {
  if (device == Device::cpu) return impl_->constants.data();
  std::call_once(impl_->uploaded, [this] {
    impl_->on_gpu = Buffer<MaterialConstants>(Device::cuda, 0);
    impl_->on_gpu.upload(impl_->constants);
  });
  return impl_->on_gpu.data();
}

}  // namespace graupel::graph
