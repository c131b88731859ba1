#include "mpm/particles/particles.h"

#include <algorithm>

namespace graupel::mpm {

template <typename T>
Particles<T>::Particles(Device device, int64_t count)
    : device_(device),
      count_(count),
      position_(device, static_cast<std::size_t>(padded_to_tile(count)) * 3),
      velocity_(device, static_cast<std::size_t>(padded_to_tile(count)) * 3),
      affine_velocity_(device, static_cast<std::size_t>(padded_to_tile(count)) * 9),
      deformation_gradient_(device, static_cast<std::size_t>(padded_to_tile(count)) * 9),
      stress_(device, static_cast<std::size_t>(padded_to_tile(count)) * 6),
      internal_(device, static_cast<std::size_t>(padded_to_tile(count))),
      volume_(device, static_cast<std::size_t>(padded_to_tile(count))),
      material_(device, static_cast<std::size_t>(padded_to_tile(count))),
      source_index_(device, static_cast<std::size_t>(padded_to_tile(count))) {
  for_each_buffer([](auto& buffer) { buffer.fill_zero(); });
}

template <typename T>
ParticleView<T> Particles<T>::view() {
  return {count_,
          {position_.data()},
          {velocity_.data()},
          {affine_velocity_.data()},
          {deformation_gradient_.data()},
          {stress_.data()},
          {internal_.data()},
          {volume_.data()},
          {material_.data()},
          {source_index_.data()}};
}

template <typename T>
int64_t Particles<T>::bytes() const {
  return padded_to_tile(count_) * static_cast<int64_t>(35 * sizeof(T) + 2 * sizeof(int32_t));
}

template <typename T>
bool Particles<T>::spare_lanes_are_clear() const {
  const auto clear = [&](const Buffer<int32_t>& indices) {
    const std::vector<int32_t> host = indices.download();
    return std::all_of(host.begin() + count_, host.end(), [](int32_t index) { return index == 0; });
  };
  return clear(material_) && clear(source_index_);
}

template class Particles<float>;
template class Particles<double>;

}  // namespace graupel::mpm
