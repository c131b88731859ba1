// Trajectories and data sets: lazy sequences of frames.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <filesystem>
#include <mutex>

#include "library/python/contact_forces.h"
#include "library/python/frame_arrays.h"
#include "mpm/scene/particle_materials.h"

namespace graupel::python {

namespace {

/// A file, which one thread at a time reads.
struct OpenFile {
  explicit OpenFile(const std::string& file) : path(file), reader(file) {}
  std::string path;
  io::TrajectoryReader reader;
  std::mutex mutex;
};

class FileFrames final : public TrajectoryFrames {
 public:
  FileFrames(std::shared_ptr<OpenFile> file, int index) : file_(std::move(file)), index_(index) {}
  std::vector<std::shared_ptr<const ParticleFrame>> frames(int64_t first, int64_t count,
                                                           FieldSet wanted) const override {
    const WithoutGil others_run;
    const std::lock_guard lock(file_->mutex);
    std::vector<std::shared_ptr<const ParticleFrame>> read;
    for (ParticleFrame& frame : file_->reader.frames(index_, first, count, wanted))
      read.push_back(std::make_shared<const ParticleFrame>(std::move(frame)));
    return read;
  }
  FieldSet fields() const override {
    const std::lock_guard lock(file_->mutex);
    return file_->reader.fields(index_);
  }
  bool complete() const override {
    const std::lock_guard lock(file_->mutex);
    return file_->reader.complete() && file_->reader.attribute(index_, "recovered").empty();
  }
  std::vector<io::NamedValue> parameters() const override {
    const std::lock_guard lock(file_->mutex);
    return file_->reader.parameters(index_);
  }
  std::vector<std::string> contact_names() const override {
    const std::lock_guard lock(file_->mutex);
    return file_->reader.contact_names(index_);
  }
  std::vector<std::vector<ContactForce>> contact_forces() const override {
    const WithoutGil others_run;
    const std::lock_guard lock(file_->mutex);
    return file_->reader.contact_forces(index_);
  }

 private:
  std::shared_ptr<OpenFile> file_;
  int index_;
};

class MemoryFrames final : public TrajectoryFrames {
 public:
  explicit MemoryFrames(std::vector<ParticleFrame> frames) {
    for (ParticleFrame& frame : frames) frames_.push_back(std::make_shared<const ParticleFrame>(std::move(frame)));
  }
  std::vector<std::shared_ptr<const ParticleFrame>> frames(int64_t first, int64_t count, FieldSet) const override {
    return {frames_.begin() + first, frames_.begin() + first + count};
  }
  FieldSet fields() const override { return {}; }

 private:
  std::vector<std::shared_ptr<const ParticleFrame>> frames_;
};

std::shared_ptr<OpenFile> open_file(const nb::object& path) {
  const std::string file = path_of(path);
  const WithoutGil others_run;
  return std::make_shared<OpenFile>(file);
}

PyTrajectory trajectory_of(const std::shared_ptr<OpenFile>& file, int64_t index) {
  const int count = file->reader.count();
  if (index < 0) index += count;
  if (index < 0 || index >= count)
    throw nb::index_error(("'" + file->path + "' has " + std::to_string(count) + " trajectories").c_str());
  const std::lock_guard lock(file->mutex);
  return {file->reader.header(static_cast<int>(index)),
          std::make_shared<FileFrames>(file, static_cast<int>(index)),
          file->path,
          {},
          {},
          {{"the trajectory", std::filesystem::absolute(file->path).string()}}};
}

void write(const PyTrajectory& trajectory, const nb::object& path, bool velocities) {
  const std::string file = path_of(path);
  check_output(file, trajectory.inputs);
  io::TrajectoryWriteOptions options;
  options.fields = trajectory.frames->fields();
  options.contacts = trajectory.frames->contact_names();
  const std::vector<std::vector<ContactForce>> forces = trajectory.frames->contact_forces();
  const std::vector<io::NamedValue> parameters = trajectory.frames->parameters();
  for (int64_t i = 0; i < trajectory.size(); ++i) {
    const auto frame = trajectory.frames->frames(i, 1, {}).front();
    if (i == 0) options.velocity = velocities && !frame->velocity.empty();
    options.active = options.active || !frame->active.empty();
  }
  SignalPoll poll;
  io::TrajectoryWriter writer(file, trajectory.header, options);
  if (!parameters.empty()) writer.parameters(parameters);
  if (!trajectory.frames->complete()) writer.attribute("recovered", "1");
  for (int64_t i = 0; i < trajectory.size(); ++i) {
    const auto frame = trajectory.frames->frames(i, 1, options.fields).front();
    const WithoutGil others_run;
    writer.append(*frame);
    if (!options.contacts.empty()) writer.append_forces(forces[static_cast<std::size_t>(i)]);
    poll();
  }
  writer.finish(trajectory.header.diverged_at_frame);
}

nb::object scene_dict(const PyTrajectory& trajectory) {
  if (trajectory.header.scene_json.empty()) return nb::dict();
  return nb::module_::import_("json").attr("loads")(text_of(trajectory.header.scene_json));
}

/// Places in the scene's materials; -1 for those of obstacles, and for all where the file does not tell them.
nb::ndarray<nb::numpy, const int32_t> materials_of(const PyTrajectory& trajectory) {
  const std::string where = trajectory.file.empty() ? "the trajectory" : "'" + trajectory.file + "'";
  std::vector<int32_t> materials(trajectory.header.particle_type.size(), -1);
  if (!trajectory.header.scene_json.empty() && trajectory.size() > 0) {
    const auto first = trajectory.frames->frames(0, 1, {}).front();
    try {
      const Scene scene = io::parse_stored_scene(trajectory.header.scene_json, where, trajectory.file);
      materials = mpm::particle_materials(scene, trajectory.header, first->position, where);
    } catch (const Error&) {  // no scene of these particles, as where they came from arrays
    }
  }
  const std::size_t count = materials.size();
  return array_of(std::move(materials), {count});
}

}  // namespace

PyTrajectory in_memory(Trajectory trajectory) {
  PyTrajectory made;
  made.header = trajectory;
  for (ParticleFrame& frame : made.header.frames) frame = {frame.time, {}, {}};
  made.frames = std::make_shared<MemoryFrames>(std::move(trajectory.frames));
  return made;
}

void bind_trajectory(nb::module_& module) {
  using namespace nb::literals;
  bind_frame_arrays(module);
  nb::class_<PyTrajectory>(module, "Trajectory",
                           "Frames of a run: a file's, read when they are asked for, or a rollout's in memory.\n\n"
                           "len(t) frames; t[i] and iteration give a Frame each, t[i:j] a list of them.")
      .def(
          "__init__",
          [](PyTrajectory* place, const nb::object& path, int64_t index) {
            new (place) PyTrajectory(trajectory_of(open_file(path), index));
          },
          "path"_a, "index"_a = 0, nb::sig("def __init__(self, path: str | os.PathLike, index: int = 0) -> None"),
          "Trajectory number index of a file of Graupel, or in the LagrangeBench layout. Raises InputError.")
      .def("__len__", &PyTrajectory::size)
      .def(
          "__getitem__",
          [](const PyTrajectory& t, const nb::slice& slice) {
            nb::list frames;
            for (const auto& frame : frames_in(t, slice)) frames.append(PyFrame{frame});
            return frames;
          },
          "index"_a, nb::sig("def __getitem__(self, index: slice) -> list[Frame]"))
      .def(
          "__getitem__", [](const PyTrajectory& t, const nb::object& index) { return PyFrame{frame_at(t, index)}; },
          "index"_a, nb::sig("def __getitem__(self, index: int) -> Frame"))
      .def("__iter__", &iterator_over, nb::sig("def __iter__(self) -> Iterator[Frame]"))
      .def_prop_ro(
          "positions",
          [](const PyTrajectory& t) {
            return FrameArrays{t, Quantity::position};
          },
          "f32 [frames, particles, 3], m.", nb::rv_policy::automatic)
      .def_prop_ro(
          "velocities",
          [](const PyTrajectory& t) {
            return FrameArrays{t, Quantity::velocity};
          },
          "f32 [frames, particles, 3], m/s. Raises InputError where none are stored.", nb::rv_policy::automatic)
      .def_prop_ro(
          "active",
          [](const PyTrajectory& t) {
            return FrameArrays{t, Quantity::active};
          },
          "u8 [frames, particles]: 0 for particles that are not in the run in that frame.", nb::rv_policy::automatic)
      .def(
          "field",
          [](const PyTrajectory& t, const std::string& name) {
            for (const ParticleField field : all_particle_fields)
              if (name == info_of(field).name && t.frames->fields().contains(field))
                return FrameArrays{t, Quantity::field, field};
            throw InputError("the trajectory does not store '" + name + "' (stored: '" + t.frames->fields().names() +
                             "'). Write it with fields='" + name + "'");
          },
          "name"_a, "A stored field of all frames, shapes as Simulation.field().")
      .def_prop_ro(
          "forces",
          [](const PyTrajectory& t) -> nb::object {
            const std::vector<std::string> names = t.frames->contact_names();
            return names.empty() ? nb::none() : nb::object(contact_dict(names, t.frames->contact_forces()));
          },
          nb::sig("def forces(self) -> dict | None"),
          "What the matter did to each obstacle and wall from the frame before to each frame, nothing in the first:\n"
          "'names' [k], and f64 [frames, k, 3] 'impulse' N s, 'force' N and 'torque' N m (means of that time),\n"
          "'reference' m, the point that the torque is about. None where none are stored: run with forces=True.")
      .def_prop_ro(
          "times",
          [](const PyTrajectory& t) {
            std::vector<double> times;
            for (const ParticleFrame& frame : t.header.frames) times.push_back(frame.time);
            const std::size_t count = times.size();
            return array_of(std::move(times), {count});
          },
          "f64 [frames], s.", nb::rv_policy::automatic)
      .def_prop_ro(
          "particle_types",
          [](const PyTrajectory& t) { return array_of(t.header.particle_type, {t.header.particle_type.size()}); },
          "i32 [particles], ids of the material's model.", nb::rv_policy::automatic)
      .def_prop_ro("particle_count", [](const PyTrajectory& t) { return t.header.particle_count(); })
      .def_prop_ro("particle_materials", &materials_of,
                   "i32 [particles], places in Scene.materials; -1 for none, and for all where the file does not tell.",
                   nb::rv_policy::automatic)
      .def_prop_ro(
          "has_active",
          [](const PyTrajectory& t) { return t.size() > 0 && !t.frames->frames(0, 1, {}).front()->active.empty(); },
          "Whether particles come or go.")
      .def_prop_ro(
          "frame_time", [](const PyTrajectory& t) { return t.header.frame_time; }, "[s].")
      .def_prop_ro(
          "seed", [](const PyTrajectory& t) { return t.header.seed; }, "Of the particle sampling.")
      .def_prop_ro(
          "made_by", [](const PyTrajectory& t) { return text_of(t.header.made_by); }, "'mpm', or the weights file.")
      .def_prop_ro(
          "diverged_at_frame", [](const PyTrajectory& t) { return t.header.diverged_at_frame; },
          "First frame that is not usable; -1 for none.")
      .def_prop_ro(
          "complete", [](const PyTrajectory& t) { return t.frames->complete(); }, "Whether its run ended.")
      .def_prop_ro("scene_dict", &scene_dict, nb::sig("def scene_dict(self) -> dict"), "The stored scene; {} for none.")
      .def_prop_ro(
          "scene",
          [](const PyTrajectory& t) {
            const std::string file = t.file.empty() ? "" : std::filesystem::absolute(t.file).string();
            return PyScene{io::parse_stored_scene(t.header.scene_json, "stored scene", t.file), file};
          },
          "The stored scene, with its meshes read. Raises ConfigError, InputError where they are missing.")
      .def_prop_ro(
          "obstacles",
          [](const PyTrajectory& t) -> nb::object { return scene_dict(t).attr("get")("obstacles", nb::list()); },
          nb::sig("def obstacles(self) -> list[dict]"), "The obstacles of the stored scene.")
      .def_prop_ro(
          "parameters",
          [](const PyTrajectory& t) {
            nb::dict values;
            for (const io::NamedValue& p : t.frames->parameters()) values[text_of(p.name)] = p.value;
            return values;
          },
          nb::sig("def parameters(self) -> dict[str, float]"), "Of the run in its data set, by name.")
      .def_prop_ro(
          "verdict", [](const PyTrajectory& t) { return t.verdict; }, nb::sig("def verdict(self) -> str | None"),
          "Of reduced models: 'ok', 'doubtful', 'do not trust' or 'unknown'.")
      .def_prop_ro(
          "trust_number", [](const PyTrajectory& t) { return t.trust_number; },
          nb::sig("def trust_number(self) -> float | None"),
          "Error indicator of the last frame; up to 1 as in training.")
      .def("write", &write, "path"_a, "velocities"_a = true,
           nb::sig("def write(self, path: str | os.PathLike, velocities: bool = True) -> None"),
           "Writes all frames to an HDF5 file, with their fields, forces and parameters.\n\n"
           "Raises IoError, also for a folder or a device, and ConfigError for a file that it was made of.")
      .def("__repr__", [](const PyTrajectory& t) {
        return text_of("<graupel.Trajectory: " + std::to_string(t.size()) + " frames of " +
                       std::to_string(t.header.particle_count()) + " particles, made by '" + t.header.made_by + "'>");
      });

  nb::class_<OpenFile>(module, "DataSet", "The trajectories of a file, a sequence of Trajectory.")
      .def("__len__", [](const OpenFile& file) { return file.reader.count(); })
      .def(
          "__getitem__",
          [](const std::shared_ptr<OpenFile>& file, const nb::slice& slice) {
            const auto [start, stop, step, length] = slice.compute(static_cast<std::size_t>(file->reader.count()));
            nb::list trajectories;
            for (std::size_t i = 0; i < length; ++i)
              trajectories.append(trajectory_of(file, start + static_cast<int64_t>(i) * step));
            return trajectories;
          },
          "index"_a, nb::sig("def __getitem__(self, index: slice) -> list[Trajectory]"))
      .def(
          "__getitem__",
          [](const std::shared_ptr<OpenFile>& file, int64_t index) { return trajectory_of(file, index); }, "index"_a)
      .def("__iter__", &iterator_over, nb::sig("def __iter__(self) -> Iterator[Trajectory]"))
      .def_prop_ro("complete", [](const OpenFile& file) { return file.reader.complete(); });
  module.def("open", &open_file, "path"_a, nb::sig("def open(path: str | os.PathLike) -> DataSet"),
             "Opens a file with one or more trajectories. Raises InputError.");
}

}  // namespace graupel::python
