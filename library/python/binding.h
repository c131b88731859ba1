// What the files of the Python binding share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"
#include "core/system/error.h"
#include "library/python/gil.h"

namespace graupel::python {

namespace nb = nanobind;

/// Graupel's errors become the classes of graupel._errors, by kind.
void register_errors();
void bind_scene(nb::module_& module);
void bind_simulation(nb::module_& module);
void bind_trajectory(nb::module_& module);
void bind_gpu_array(nb::module_& module);
void bind_batch(nb::module_& module);
void bind_models(nb::module_& module);

using Rows = nb::ndarray<nb::numpy, const float, nb::ndim<2>>;

/// A read-only array [n, 3] over `vectors`, which `owner` keeps alive. No copy.
template <typename Owner>
Rows rows_of(const std::vector<Vec3f>& vectors, std::shared_ptr<Owner> owner) {
  nb::capsule keep(new std::shared_ptr<Owner>(std::move(owner)),
                   [](void* held) noexcept { delete static_cast<std::shared_ptr<Owner>*>(held); });
  return Rows(reinterpret_cast<const float*>(vectors.data()), {vectors.size(), 3}, keep);
}
/// A read-only array of any shape over `values`. No copy.
template <typename T, typename Owner>
nb::ndarray<nb::numpy, const T> array_of(const std::vector<T>& values, std::initializer_list<std::size_t> shape,
                                         std::shared_ptr<Owner> owner) {
  nb::capsule keep(new std::shared_ptr<Owner>(std::move(owner)),
                   [](void* held) noexcept { delete static_cast<std::shared_ptr<Owner>*>(held); });
  return nb::ndarray<nb::numpy, const T>(values.data(), shape, keep);
}
/// The same of values that nobody else has.
template <typename T>
nb::ndarray<nb::numpy, const T> array_of(std::vector<T> values, std::initializer_list<std::size_t> shape) {
  auto owner = std::make_shared<std::vector<T>>(std::move(values));
  return array_of(*owner, shape, owner);
}

/// Python's iterator over a sequence, by its [0], [1] and so on; with it type checkers know of the iteration.
inline nb::object iterator_over(nb::handle sequence) { return nb::steal<nb::object>(PySeqIter_New(sequence.ptr())); }

/// Throws ConfigError, which tells the names.
inline ParticleField field_named(const std::string& name) {
  for (const ParticleField field : all_particle_fields)
    if (name == info_of(field).name) return field;
  FieldSet::parse(name);  // says which there are
  throw ConfigError("one field at a time ('" + name + "'). Ask for each alone");
}

/// Throws ConfigError for another word than f32 and f64.
inline bool is_f64(const std::string& precision) {
  if (precision != "f32" && precision != "f64")
    throw ConfigError("precision is not known ('" + precision + "', allowed: f32, f64). Choose one of these");
  return precision == "f64";
}

/// A stored field with the shape that fits it: stress [n, 6], affine and deformation_gradient [n, 3, 3], plastic [n].
template <typename Owner>
nb::ndarray<nb::numpy, const float> field_array(ParticleField field, const std::vector<float>& values,
                                                std::shared_ptr<Owner> owner) {
  const auto components = static_cast<std::size_t>(info_of(field).components);
  const std::size_t n = values.size() / components;
  if (components == 1) return array_of(values, {n}, std::move(owner));
  if (components == 9) return array_of(values, {n, 3, 3}, std::move(owner));
  return array_of(values, {n, components}, std::move(owner));
}

/// Python's signals (Ctrl-C), asked for at most twenty times a second from work that runs without the GIL. One for all
/// frames of a run: frames may be shorter than that.
class SignalPoll {
 public:
  /// Throws what Python's handler raised, KeyboardInterrupt for Ctrl-C.
  void operator()() {
    stay_if_ending();
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < std::chrono::milliseconds(50)) return;
    last_ = now;
    const WithGil gil;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Refuses a second thread, which the GIL does not keep out of work that runs without it.
class InUse {
 public:
  explicit InUse(std::atomic<bool>& flag) : flag_(flag) {
    if (flag_.exchange(true))
      throw std::runtime_error(
          "another thread uses this object, or the rollout that calls progress (allowed: one at a time). Wait for it, "
          "or make a second");
  }
  ~InUse() { flag_ = false; }
  InUse(const InUse&) = delete;
  InUse& operator=(const InUse&) = delete;

 private:
  std::atomic<bool>& flag_;
};

}  // namespace graupel::python
