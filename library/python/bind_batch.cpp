// Many scenes that the solver advances together.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <utility>

#include "core/parallel/start_task.h"
#include "library/batch.h"
#include "library/python/files.h"
#include "library/python/gpu_array.h"

namespace graupel::python {

namespace {

class PyBatch {
 public:
  PyBatch(const nb::iterable& scenes, const std::string& device, const std::string& precision,
          std::optional<std::vector<uint64_t>> seeds) {
    BatchSettings settings;
    settings.device = parse_device(device);
    settings.f64 = is_f64(precision);
    if (seeds) settings.seeds = std::move(*seeds);
    device_ = settings.device;
    const std::vector<Scene> all = scenes_of(scenes);
    const WithoutGil others_run;
    batch_ = std::make_unique<Batch>(all, settings);
  }

  void advance_frame() {
    const InUse in_use(busy_);
    if (device_ == Device::cpu)
      advance_on_cpu();
    else
      advance_on_gpu();
  }
  void run(std::optional<int64_t> frames, const nb::object& progress) {
    const int64_t count = frames ? *frames : common_frames();
    if (count < 0) throw ConfigError("frames must not be negative (" + std::to_string(count) + "). Use 0 or more");
    for (int64_t frame = 1; frame <= count; ++frame) {
      advance_frame();
      if (!progress.is_none()) progress(frame);
    }
  }

  /// A list with `of(i)` of every scene.
  template <typename Of>
  nb::list list(const Of& of) {
    const InUse in_use(busy_);
    nb::list all;
    for (std::size_t i = 0; i < batch_->size(); ++i) all.append(of(i));
    return all;
  }
  nb::list vectors(ParticleQuantity what, std::vector<Vec3f> ParticleFrame::*member) {
    return list([&](std::size_t i) {
      if (device_ == Device::cuda) return nb::cast(on_device(i, what));
      const auto frame = frame_of(i);
      return nb::cast(rows_of((*frame).*member, frame));
    });
  }
  nb::list field(const std::string& name) {
    const ParticleField wanted = field_named(name);
    return list([&](std::size_t i) {
      if (device_ == Device::cuda) return nb::cast(on_device(i, quantity_of(wanted)));
      const auto frame = frame_of(i, {wanted});
      return nb::cast(field_array(wanted, frame->fields[wanted], frame));
    });
  }
  nb::list active() {
    return list([&](std::size_t i) {
      const auto frame = frame_of(i);
      const std::size_t n = batch_->particle_type(i).size();
      if (frame->active.empty()) return array_of(std::vector<uint8_t>(n, 1), {n});
      return array_of(frame->active, {n}, frame);
    });
  }
  nb::list particle_types() {
    return list([&](std::size_t i) {
      const std::span<const int32_t> types = batch_->particle_type(i);
      return array_of(std::vector<int32_t>(types.begin(), types.end()), {types.size()});
    });
  }
  nb::list diverged() {
    return list([&](std::size_t i) { return nb::cast(batch_->divergence(i)); });
  }
  nb::list scenes() {
    return list([&](std::size_t i) { return nb::cast(PyScene{batch_->scene(i), files_[i]}); });
  }
  std::size_t size() const { return batch_->size(); }
  int64_t frames_done() const { return batch_->frames_done(); }

 private:
  std::vector<Scene> scenes_of(const nb::iterable& scenes) {
    std::vector<Scene> all;
    for (const nb::handle one : scenes) {
      if (!nb::isinstance<PyScene>(one))
        throw nb::type_error(("scene " + std::to_string(all.size()) + " of the batch is a '" +
                              std::string(nb::type_name(one.type()).c_str()) +
                              "' (allowed: graupel.Scene). Make it with Scene.from_dict() or Scene.from_file()")
                                 .c_str());
      all.push_back(nb::cast<const PyScene&>(one));
      files_.push_back(nb::cast<const PyScene&>(one).file);
    }
    return all;
  }
  int64_t common_frames() const {
    const int64_t frames = batch_->scene(0).frames;
    for (std::size_t i = 1; i < size(); ++i)
      if (batch_->scene(i).frames != frames)
        throw ConfigError("the scenes have different numbers of frames (scene 0: " + std::to_string(frames) +
                          ", scene " + std::to_string(i) + ": " + std::to_string(batch_->scene(i).frames) +
                          "). Say how many: run(frames)");
    return frames;
  }
  std::shared_ptr<const ParticleFrame> frame_of(std::size_t i, FieldSet wanted = {}) const {
    const WithoutGil others_run;
    return batch_->frame(i, wanted);
  }
  GpuArray on_device(std::size_t i, ParticleQuantity what) const {
    return {batch_->on_device(i, what), batch_->particle_type(i).size(), what};
  }

  /// The threads of the batch make substeps; this one asks for signals, which Python tells its main thread alone.
  void advance_on_cpu() {
    const WithoutGil others_run;
    std::atomic<bool> stop = false;
    auto frame = start_task([&] { return batch_->advance_frame([&] { return stop.load(); }); });
    try {
      do poll_();
      while (frame.wait_for(std::chrono::milliseconds(50)) == std::future_status::timeout);
    } catch (...) {
      stop = true;
      frame.wait();
      throw;
    }
    frame.get();
  }
  void advance_on_gpu() {
    const WithoutGil others_run;
    batch_->advance_frame([&] {
      poll_();
      return false;
    });
    poll_();
  }

  std::unique_ptr<Batch> batch_;
  std::vector<std::string> files_;  ///< of the scenes
  Device device_ = Device::cpu;
  SignalPoll poll_;
  std::atomic<bool> busy_ = false;
};

}  // namespace

void bind_batch(nb::module_& module) {
  using namespace nb::literals;
  nb::class_<PyBatch>(
      module, "Batch",
      "Runs of many scenes that advance together, each with the bytes of its own Simulation.\n\n"
      "On the CPU every thread advances scenes of its own; on a GPU one launch advances all scenes of one grid. "
      "Scenes\n"
      "may differ in everything. What a run has is here a list, with one entry for each scene in their order; arrays,\n"
      "threads and Ctrl-C are as in Simulation.")
      .def(
          nb::init<const nb::iterable&, const std::string&, const std::string&, std::optional<std::vector<uint64_t>>>(),
          "scenes"_a, "device"_a = "cpu", "precision"_a = "f32", "seeds"_a = nb::none(),
          nb::sig("def __init__(self, scenes: Iterable[Scene], device: str = 'cpu', precision: str = 'f32', seeds: "
                  "Sequence[int] | None = None) -> None"),
          "Samples the sources and builds the obstacles of all scenes.\n\n"
          "seeds: of the particle sampling, one for each scene, default the scenes' own; others as in Simulation. "
          "Raises\n"
          "ConfigError, InputError, which begin with the scene: \"scene 3 ('column'): ...\".")
      .def(
          "advance_frame", &PyBatch::advance_frame,
          "To the end of every scene's frame, of its own frame_time.\n\n"
          "A scene that blows up stays behind (diverged), the others go on. Ctrl-C ends it between substeps; the next\n"
          "call goes on from there. On a GPU it ends after the frame.")
      .def("run", &PyBatch::run, "frames"_a = nb::none(), "progress"_a = nb::none(),
           nb::sig("def run(self, frames: int | None = None, progress: Callable[[int], object] | None = None) -> None"),
           "So many frames, default the scenes' number, which must then be the same; progress(frame) after each.")
      .def_prop_ro(
          "positions",
          [](PyBatch& batch) { return batch.vectors(ParticleQuantity::position, &ParticleFrame::position); },
          nb::sig("def positions(self) -> list[numpy.ndarray | GpuArray]"), "f32 [particles, 3], m, of each scene.")
      .def_prop_ro(
          "velocities",
          [](PyBatch& batch) { return batch.vectors(ParticleQuantity::velocity, &ParticleFrame::velocity); },
          nb::sig("def velocities(self) -> list[numpy.ndarray | GpuArray]"), "f32 [particles, 3], m/s, of each scene.")
      .def("field", &PyBatch::field, "name"_a, nb::sig("def field(self, name: str) -> list[numpy.ndarray | GpuArray]"),
           "Of each scene as Simulation.field(): 'stress' [n, 6] Pa, 'affine' [n, 3, 3] 1/s, 'deformation_gradient'\n"
           "[n, 3, 3], 'plastic' [n].")
      .def_prop_ro("active", &PyBatch::active, nb::sig("def active(self) -> list[numpy.ndarray]"),
                   "u8 [particles] of each scene: 0 for particles that are not in the run.")
      .def_prop_ro("particle_types", &PyBatch::particle_types,
                   nb::sig("def particle_types(self) -> list[numpy.ndarray]"), "i32 [particles] of each scene.")
      .def_prop_ro("diverged", &PyBatch::diverged, nb::sig("def diverged(self) -> list[str | None]"),
                   "Of each scene why it blew up, \"scene 3 ('column'): ...\", its arrays are then of no use; None "
                   "while it runs.\n\n"
                   "any(batch.diverged) tells whether one did.")
      .def_prop_ro("frames_done", &PyBatch::frames_done, "Whole frames so far.")
      .def_prop_ro("scenes", &PyBatch::scenes, nb::sig("def scenes(self) -> list[Scene]"))
      .def("__len__", &PyBatch::size);
}

}  // namespace graupel::python
