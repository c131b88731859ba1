// Rows of a run in the memory of its GPU, for other libraries by DLPack.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "core/scene/particle_quantity.h"
#include "library/python/binding.h"

namespace graupel::python {

/// f32 [n, 3] positions and velocities, or a field with the shape of field_array(); C order, read-only.
class GpuArray {
 public:
  GpuArray(std::shared_ptr<const float> rows, std::size_t particles, ParticleQuantity what);

  const std::vector<std::size_t>& shape() const { return shape_; }
  std::size_t size() const;
  /// An object of nanobind's with __dlpack__ and __dlpack_device__. No copy; it keeps the rows alive.
  nb::object exported() const;
  /// A copy on the host, made once.
  nb::ndarray<nb::numpy, const float> numpy();

 private:
  std::shared_ptr<const float> rows_;
  std::vector<std::size_t> shape_;
  std::shared_ptr<const std::vector<float>> copy_;  ///< empty until it is asked for
};

}  // namespace graupel::python
