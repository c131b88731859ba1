// Particle state in tiles of 16: component k of particle p lies at (p / 16) * 16 K + 16 k + p % 16, which suits vector
// units (16 particles at once) and GPUs (coalesced) alike. A slot is a place in these arrays.
#pragma once

#include <type_traits>
#include <utility>

#include "core/math/mat.h"
#include "core/parallel/buffer.h"
#include "core/parallel/parallel_for.h"

namespace graupel::mpm {

inline constexpr int64_t tile = 16;
inline int64_t padded_to_tile(int64_t n) { return (n + tile - 1) / tile * tile; }

/// parallel_for for kernels of precision T: double precision runs on the CPU alone, so no GPU kernel is compiled for
/// it.
template <typename T, typename Body>
void launch(Device device, int64_t n, const Body& body, Grain grain = {}) {
  if constexpr (std::is_same_v<T, double>)
    parallel_for_cpu(n, body, grain);
  else
    parallel_for(device, n, body, grain);
}

/// K numbers a particle.
template <typename T, int K>
struct TiledView {
  T* data;

  GRAUPEL_HD T* at(int64_t slot) const { return data + (slot / tile) * (tile * K) + slot % tile; }
  GRAUPEL_HD T get(int64_t slot) const { return *at(slot); }
  GRAUPEL_HD void set(int64_t slot, T value) const { *at(slot) = value; }
  GRAUPEL_HD Vec<T, K> vec(int64_t slot) const {
    Vec<T, K> v;
    const T* p = at(slot);
    for (int k = 0; k < K; ++k) v[k] = p[k * tile];
    return v;
  }
  GRAUPEL_HD void set_vec(int64_t slot, const Vec<T, K>& v) const {
    T* p = at(slot);
    for (int k = 0; k < K; ++k) p[k * tile] = v[k];
  }
};

template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> load_matrix(const TiledView<T, D * D>& view, int64_t slot) {
  Mat<T, D> m;
  const T* p = view.at(slot);
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) m(r, c) = p[(r * D + c) * tile];
  return m;
}
template <typename T, int D>
GRAUPEL_HD inline void store_matrix(const TiledView<T, D * D>& view, int64_t slot, const Mat<T, D>& m) {
  T* p = view.at(slot);
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) p[(r * D + c) * tile] = m(r, c);
}
/// Symmetric matrices keep xx, yy, zz, xy, xz, yz.
template <typename T>
GRAUPEL_HD inline Mat<T, 3> load_symmetric(const TiledView<T, 6>& view, int64_t slot) {
  const Vec<T, 6> s = view.vec(slot);
  return {{{s[0], s[3], s[4]}, {s[3], s[1], s[5]}, {s[4], s[5], s[2]}}};
}
template <typename T>
GRAUPEL_HD inline Vec<T, 6> symmetric_components(const Mat<T, 3>& m) {
  return {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)};
}
template <typename T>
GRAUPEL_HD inline void store_symmetric(const TiledView<T, 6>& view, int64_t slot, const Mat<T, 3>& m) {
  view.set_vec(slot, symmetric_components(m));
}

/// All particles, for kernels.
template <typename T>
struct ParticleView {
  int64_t count;
  TiledView<T, 3> position;              ///< x [m]
  TiledView<T, 3> velocity;              ///< v [m/s]
  TiledView<T, 9> affine_velocity;       ///< C [1/s]
  TiledView<T, 9> deformation_gradient;  ///< F, elastic part; identity for water
  TiledView<T, 6> stress;                ///< Kirchhoff stress tau [Pa]
  TiledView<T, 1> internal;              ///< J, J_p or v_c (mpm/materials/material.h)
  TiledView<T, 1> volume;                ///< V0 [m^3]
  TiledView<int32_t, 1> material;        ///< index into the material table
  TiledView<int32_t, 1> source_index;    ///< place in the order of the sources
};

/// Owner of the particle arrays on a device.
template <typename T>
class Particles {
 public:
  Particles() = default;
  Particles(Device device, int64_t count);

  int64_t count() const { return count_; }
  Device device() const { return device_; }
  ParticleView<T> view();
  /// Number of bytes on the device.
  int64_t bytes() const;
  /// Whether the indices of the last tile's lanes without a particle are 0, as all kernels leave them: kernels for
  /// whole tiles look these lanes' materials up too.
  bool spare_lanes_are_clear() const;

  /// Calls visit(buffer) for every array, in a fixed order: for saving, loading and permuting.
  template <typename Visitor>
  void for_each_buffer(Visitor&& visit) {
    visit(position_);
    visit(velocity_);
    visit(affine_velocity_);
    visit(deformation_gradient_);
    visit(stress_);
    visit(internal_);
    visit(volume_);
    visit(material_);
    visit(source_index_);
  }

 private:
  Device device_ = Device::cpu;
  int64_t count_ = 0;
  Buffer<T> position_, velocity_, affine_velocity_, deformation_gradient_, stress_, internal_, volume_;
  Buffer<int32_t> material_, source_index_;
};

}  // namespace graupel::mpm
