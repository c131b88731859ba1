#include "library/python/gpu_array.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <utility>

#include "core/parallel/buffer.h"
#include "core/parallel/cuda_runtime.h"

namespace graupel::python {

namespace {

std::vector<std::size_t> shape_of(std::size_t particles, ParticleQuantity what) {
  const auto components = static_cast<std::size_t>(components_of(what));
  if (components == 1) return {particles};
  if (components == 9) return {particles, 3, 3};
  return {particles, components};
}

/// DLPack's kind and number of the device that the rows are on.
std::pair<int, int> place_of(const float* rows) {
  const int gpu = cuda::device_of(rows);
  if (gpu < 0) return {nb::device::cpu::value, 0};
  return {nb::device::cuda::value, gpu};
}

nb::object indexed(GpuArray& array, const nb::object& index) { return nb::cast(array.numpy())[index]; }

}  // namespace

GpuArray::GpuArray(std::shared_ptr<const float> rows, std::size_t particles, ParticleQuantity what)
    : rows_(std::move(rows)), shape_(shape_of(particles, what)) {}

std::size_t GpuArray::size() const {
  std::size_t numbers = 1;
  for (const std::size_t extent : shape_) numbers *= extent;
  return numbers;
}

nb::object GpuArray::exported() const {
  const auto [kind, number] = place_of(rows_.get());
  nb::capsule keep(new std::shared_ptr<const float>(rows_),
                   [](void* held) noexcept { delete static_cast<std::shared_ptr<const float>*>(held); });
  return nb::cast(nb::ndarray<nb::array_api, const float>(rows_.get(), shape_.size(), shape_.data(), keep, nullptr,
                                                          nb::dtype<float>(), kind, number));
}

nb::ndarray<nb::numpy, const float> GpuArray::numpy() {
  if (!copy_) {
    auto copy = std::make_shared<std::vector<float>>(size());
    const Device device = cuda::device_of(rows_.get()) < 0 ? Device::cpu : Device::cuda;
    const WithoutGil others_run;
    device_copy(Device::cpu, copy->data(), device, rows_.get(), copy->size() * sizeof(float));
    copy_ = std::move(copy);
  }
  nb::capsule keep(new std::shared_ptr<const std::vector<float>>(copy_),
                   [](void* held) noexcept { delete static_cast<std::shared_ptr<const std::vector<float>>*>(held); });
  return {copy_->data(), shape_.size(), shape_.data(), keep};
}

void bind_gpu_array(nb::module_& module) {
  using namespace nb::literals;
  nb::class_<GpuArray>(
      module, "GpuArray",
      "Numbers of a run in the memory of its GPU, f32, read-only: torch.from_dlpack(a), cupy.from_dlpack(a).\n\n"
      "Made from the solver's own order and layout by one pass on the GPU, once a frame, and complete when it is "
      "given\n"
      "out: any stream may read it. It never changes and stays valid after later frames and after the run's end; its\n"
      "memory is given back with the last tensor over it. NumPy gets a copy: numpy(), indexing, numpy.asarray(a).")
      .def_prop_ro(
          "shape", [](const GpuArray& a) { return nb::tuple(nb::cast(a.shape())); },
          nb::sig("def shape(self) -> tuple[int, ...]"), "As of the same array on the CPU.")
      .def_prop_ro(
          "dtype", [](const GpuArray&) { return nb::module_::import_("numpy").attr("dtype")("float32"); },
          nb::sig("def dtype(self) -> numpy.dtype"), "float32.")
      .def("numpy", &GpuArray::numpy, nb::rv_policy::automatic, "A copy on the host, made once; read-only.")
      .def("__len__", [](const GpuArray& a) { return a.shape().front(); })
      .def("__getitem__", &indexed, "index"_a, nb::sig("def __getitem__(self, index: object) -> NDArray"))
      .def(
          "__array__",
          [](GpuArray& a, const nb::object& dtype, const nb::object& copy) {
            const nb::object numpy = nb::module_::import_("numpy");
            if (copy.is(nb::bool_(false)))
              throw nb::value_error("an array on a GPU cannot be seen by NumPy without a copy. Leave copy=False out");
            return numpy.attr("array")(nb::cast(a.numpy()), dtype);
          },
          "dtype"_a = nb::none(), "copy"_a = nb::none(),
          nb::sig("def __array__(self, dtype: object = None, copy: bool | None = None) -> NDArray"))
      .def(
          "__dlpack__",
          [](const GpuArray& a, const nb::kwargs& words) { return a.exported().attr("__dlpack__")(**words); },
          nb::sig("def __dlpack__(self, **words: object) -> object"),
          "A DLPack capsule over the GPU's memory, without a copy.")
      .def(
          "__dlpack_device__", [](const GpuArray& a) { return a.exported().attr("__dlpack_device__")(); },
          nb::sig("def __dlpack_device__(self) -> tuple[int, int]"), "(2, number of the GPU).")
      .def("__repr__", [](const GpuArray& a) {
        std::string shape;
        for (const std::size_t extent : a.shape()) shape += (shape.empty() ? "" : ", ") + std::to_string(extent);
        return "<graupel.GpuArray: float32 [" + shape + "]>";
      });
}

}  // namespace graupel::python
