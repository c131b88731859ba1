#include "library/python/frame_arrays.h"

namespace graupel::python {

namespace {

int64_t place_of(nb::handle number, int64_t size) {
  if (PyIndex_Check(number.ptr()) == 0)
    throw nb::type_error(("frames are indexed by a '" + std::string(nb::type_name(number.type()).c_str()) +
                          "' (allowed: int, slice). Index the array of a frame for the rest: x[frame][..]")
                             .c_str());
  const int64_t index = PyNumber_AsSsize_t(number.ptr(), PyExc_IndexError);
  if (index == -1 && PyErr_Occurred() != nullptr) throw nb::python_error();
  const int64_t place = index < 0 ? index + size : index;
  if (place < 0 || place >= size)
    throw nb::index_error(("frame " + std::to_string(index) + " of " + std::to_string(size)).c_str());
  return place;
}

}  // namespace

std::shared_ptr<const ParticleFrame> frame_at(const PyTrajectory& trajectory, nb::handle number, FieldSet wanted) {
  return trajectory.frames->frames(place_of(number, trajectory.size()), 1, wanted).front();
}

Frames frames_in(const PyTrajectory& trajectory, const nb::slice& slice, FieldSet wanted) {
  const auto [start, stop, step, length] = slice.compute(static_cast<std::size_t>(trajectory.size()));
  const auto first = static_cast<int64_t>(start), count = static_cast<int64_t>(length);
  if (count == 0) return {};
  if (step == 1) return trajectory.frames->frames(first, count, wanted);
  Frames frames;
  for (int64_t i = 0; i < count; ++i)
    frames.push_back(trajectory.frames->frames(first + i * static_cast<int64_t>(step), 1, wanted).front());
  return frames;
}

nb::object FrameArrays::of_frame(const std::shared_ptr<const ParticleFrame>& frame) const {
  switch (quantity) {
    case Quantity::position:
      return nb::cast(rows_of(frame->position, frame));
    case Quantity::velocity:
      if (frame->velocity.empty() && !frame->position.empty())
        throw InputError("the trajectory stores no velocities. Take differences of positions, or write it with them");
      return nb::cast(rows_of(frame->velocity, frame));
    case Quantity::active:
      if (frame->active.empty()) {
        const std::size_t n = frame->position.size();
        return nb::cast(array_of(std::vector<uint8_t>(n, 1), {n}));
      }
      return nb::cast(array_of(frame->active, {frame->active.size()}, frame));
    case Quantity::field:
      break;
  }
  return nb::cast(field_array(wanted, frame->fields[wanted], frame));
}

nb::object FrameArrays::get(const nb::object& index) const {
  const FieldSet fields = quantity == Quantity::field ? FieldSet{wanted} : FieldSet{};
  if (!nb::isinstance<nb::slice>(index)) return of_frame(frame_at(trajectory, index, fields));
  nb::list rows;
  for (const auto& frame : frames_in(trajectory, nb::cast<nb::slice>(index), fields)) rows.append(of_frame(frame));
  const nb::module_ numpy = nb::module_::import_("numpy");
  if (rows.size() > 0) return numpy.attr("stack")(rows);
  return trajectory.size() > 0
             ? numpy.attr("stack")(nb::make_tuple(get(nb::int_(0))))
                   .attr("__getitem__")(nb::slice(nb::int_(0), nb::int_(0), nb::none()))
             : numpy.attr("zeros")(nb::make_tuple(0, trajectory.header.particle_count(), 3), "float32");
}

nb::object FrameArrays::as_array(const nb::object& dtype, const nb::object& copy) const {
  if (copy.is(nb::bool_(false)))
    throw nb::value_error(
        "the frames of a trajectory cannot be seen as one array without a copy. Leave copy=False out, or take one "
        "frame: x[frame]");
  const nb::object all = get(nb::slice(nb::none(), nb::none(), nb::none()));
  return dtype.is_none() ? all : nb::object(all.attr("astype")(dtype, nb::arg("copy") = false));
}

nb::tuple FrameArrays::shape() const {
  const int64_t n = static_cast<int64_t>(trajectory.header.particle_count()), frames = trajectory.size();
  if (quantity == Quantity::active) return nb::make_tuple(frames, n);
  const int components = quantity == Quantity::field ? info_of(wanted).components : 3;
  if (components == 1) return nb::make_tuple(frames, n);
  if (components == 9) return nb::make_tuple(frames, n, 3, 3);
  return nb::make_tuple(frames, n, components);
}

void bind_frame_arrays(nb::module_& module) {
  using namespace nb::literals;
  nb::class_<FrameArrays>(module, "FrameArrays",
                          "A quantity of all frames, read when it is indexed: [frames, particles, ..].\n\n"
                          "x[i] is frame i, read-only, without a copy of what was read; x[i:j] stacks frames into an\n"
                          "array of their own; numpy.asarray(x) reads all.")
      .def("__len__", [](const FrameArrays& arrays) { return arrays.trajectory.size(); })
      .def("__getitem__", &FrameArrays::get, "index"_a,
           nb::sig("def __getitem__(self, index: int | slice) -> numpy.ndarray"))
      .def("__iter__", &iterator_over, nb::sig("def __iter__(self) -> Iterator[numpy.ndarray]"))
      .def("__array__", &FrameArrays::as_array, "dtype"_a = nb::none(), "copy"_a = nb::none(),
           nb::sig("def __array__(self, dtype: object = None, copy: bool | None = None) -> NDArray"))
      .def_prop_ro("shape", &FrameArrays::shape);
  nb::class_<PyFrame>(module, "Frame", "All particles at one time; arrays are read-only and stay valid.")
      .def_prop_ro(
          "time", [](const PyFrame& f) { return f.frame->time; }, "[s].")
      .def_prop_ro(
          "positions", [](const PyFrame& f) { return rows_of(f.frame->position, f.frame); }, "f32 [n, 3], m.",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "velocities", [](const PyFrame& f) { return rows_of(f.frame->velocity, f.frame); },
          "f32 [n, 3], m/s; [0, 3] where none are stored.", nb::rv_policy::automatic)
      .def_prop_ro(
          "active",
          [](const PyFrame& f) {
            return FrameArrays{{}, Quantity::active}.of_frame(f.frame);
          },
          "u8 [n]: 0 for particles that are not in the run.", nb::rv_policy::automatic);
}

}  // namespace graupel::python
