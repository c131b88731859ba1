#include "graph/features/material_constants.h"

#include <cmath>
#include <mutex>
#include <numbers>

#include "core/parallel/buffer.h"
#include "core/scene/materials_by_type.h"

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
  explicit Impl(const Scene& scene) : by_type(scene.materials) {}
  MaterialsByType by_type;
  std::vector<MaterialConstants> constants;
  std::once_flag uploaded;
  Buffer<MaterialConstants> on_gpu;
};

MaterialTable::MaterialTable(const Scene& scene) : impl_(std::make_shared<Impl>(scene)) {
  for (const auto& [name, material] : scene.materials) impl_->constants.push_back(material_constants(material));
}

std::vector<int32_t> MaterialTable::by_type(const std::vector<int32_t>& particle_type) const {
  static_assert(MaterialsByType::none == no_material);
  return impl_->by_type.indices(particle_type, "the start of a rollout");
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
