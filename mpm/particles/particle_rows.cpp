#include "mpm/particles/particle_rows.h"

#include "core/parallel/buffer.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct GatherRows {
  ParticleView<T> particles;
  ParticleQuantity what;
  const uint8_t* active;  ///< by source index; null: all are
  float* rows;

  template <int K>
  GRAUPEL_HD void put(const TiledView<T, K>& from, int64_t slot, int32_t place, bool moves) const {
    for (int k = 0; k < K; ++k)
      rows[int64_t{K} * place + k] = moves ? static_cast<float>(from.at(slot)[k * tile]) : 0.0f;
  }

  GRAUPEL_HD void operator()(int64_t slot) const {
    const int32_t place = particles.source_index.get(slot);
    const bool in_run = active == nullptr || active[place] != 0;
    switch (what) {
      case ParticleQuantity::position:
        return put(particles.position, slot, place, true);
      case ParticleQuantity::velocity:
        return put(particles.velocity, slot, place, in_run);
      case ParticleQuantity::stress: {
        constexpr int kept_as[] = {0, 3, 4, 1, 5, 2};  // xx, xy, xz, yy, yz, zz among xx, yy, zz, xy, xz, yz
        for (int k = 0; k < 6; ++k)
          rows[int64_t{6} * place + k] =
              in_run ? static_cast<float>(particles.stress.at(slot)[kept_as[k] * tile]) : 0.0f;
        return;
      }
      case ParticleQuantity::affine:
        return put(particles.affine_velocity, slot, place, in_run);
      case ParticleQuantity::deformation_gradient:
        return put(particles.deformation_gradient, slot, place, true);
      case ParticleQuantity::plastic:
        return put(particles.internal, slot, place, true);
    }
  }
};

}  // namespace

template <typename T>
std::shared_ptr<const float> gather_rows(Particles<T>& particles, ParticleQuantity what,
                                         const std::vector<uint8_t>& active) {
  const Device device = particles.device();
  const auto rows = std::make_shared<Buffer<float>>(
      device, static_cast<std::size_t>(particles.count()) * static_cast<std::size_t>(components_of(what)));
  Buffer<uint8_t> in_run(device, 0);
  if (!active.empty()) in_run.upload(active);
  launch<T>(device, particles.count(),
            GatherRows<T>{particles.view(), what, active.empty() ? nullptr : in_run.data(), rows->data()});
  synchronize(device);
  return {rows, rows->data()};
}

template std::shared_ptr<const float> gather_rows<float>(Particles<float>&, ParticleQuantity,
                                                         const std::vector<uint8_t>&);
template std::shared_ptr<const float> gather_rows<double>(Particles<double>&, ParticleQuantity,
                                                          const std::vector<uint8_t>&);

}  // namespace graupel::mpm
