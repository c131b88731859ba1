// Runs of the solver, frame by frame or substep by substep.
#include "library/mpm.h"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstring>

#include "library/io.h"
#include "library/python/contact_forces.h"
#include "library/python/files.h"
#include "library/python/gpu_array.h"

namespace graupel::python {

namespace {

/// A copy of a run's state, and what the matter did to obstacles and walls up to then.
struct Recorded {
  ParticleFrame frame;
  ContactSums contacts;
};

class PySimulation {
 public:
  PySimulation(const PyScene& scene, const std::string& device, const std::string& precision,
               std::optional<uint64_t> seed, bool forces)
      : inputs_(files_of(scene)), file_(scene.file) {
    SimulationSettings settings;
    settings.device = parse_device(device);
    settings.f64 = is_f64(precision);
    settings.seed = seed;
    settings.contact_forces = forces;
    on_gpu_ = settings.device == Device::cuda;
    const WithoutGil others_run;
    run_ = std::make_unique<Simulation>(scene, settings);
    if (forces) contact_names_ = graupel::contact_names(run_->scene());
    whole_frames_ = ContactSums(run_->contact_forces(), run_->time());
  }

  bool step() {
    const InUse in_use(busy_);
    const WithoutGil others_run;
    in_frame_ = true;
    if (!run_->advance_substep()) return false;
    end_frame();
    return true;
  }
  void advance_frame() {
    const InUse in_use(busy_);
    const WithoutGil others_run;
    advance();
  }
  void run(std::optional<int64_t> frames, const nb::object& progress) {
    const int64_t count = frames.value_or(run_->scene().frames);
    if (count < 0) throw ConfigError("frames must not be negative (" + std::to_string(count) + "). Use 0 or more");
    for (int64_t frame = 1; frame <= count; ++frame) {
      advance_frame();
      if (!progress.is_none()) progress(frame);
    }
  }

  nb::object positions() {
    const InUse in_use(busy_);
    if (on_gpu_) return nb::cast(on_device(ParticleQuantity::position));
    const auto frame = run_->shared_frame();
    return nb::cast(rows_of(frame->position, frame));
  }
  nb::object velocities() {
    const InUse in_use(busy_);
    if (on_gpu_) return nb::cast(on_device(ParticleQuantity::velocity));
    const auto frame = run_->shared_frame();
    return nb::cast(rows_of(frame->velocity, frame));
  }
  nb::ndarray<nb::numpy, const uint8_t> active() {
    const InUse in_use(busy_);
    const auto frame = run_->shared_frame();
    if (frame->active.empty())
      return array_of(std::vector<uint8_t>(run_->particle_count(), 1), {run_->particle_count()});
    return array_of(frame->active, {frame->active.size()}, frame);
  }
  nb::object field(const std::string& name) {
    const InUse in_use(busy_);
    const ParticleField wanted = field_named(name);
    if (on_gpu_) return nb::cast(on_device(quantity_of(wanted)));
    const auto values = run_->shared_field(wanted);
    return nb::cast(field_array(wanted, *values, values));
  }
  /// As on a GPU, also for runs on the CPU.
  GpuArray on_device(ParticleQuantity what) const { return {run_->on_device(what), run_->particle_count(), what}; }
  nb::ndarray<nb::numpy, const int32_t> particle_types() {
    const std::span<const int32_t> types = run_->particle_type();
    return array_of(std::vector<int32_t>(types.begin(), types.end()), {types.size()});
  }
  nb::ndarray<nb::numpy, const double> volumes() {
    const InUse in_use(busy_);
    const auto values = run_->volume();
    return array_of(std::vector<double>(values.begin(), values.end()), {values.size()});
  }
  nb::dict balance() {
    const InUse in_use(busy_);
    const Balance b = run_->balance();
    nb::dict sums;
    sums["mass"] = b.mass;
    sums["momentum"] = nb::make_tuple(b.momentum[0], b.momentum[1], b.momentum[2]);
    sums["kinetic"] = b.kinetic;
    sums["elastic"] = b.elastic;
    sums["gravitational"] = b.gravitational;
    return sums;
  }
  nb::dict contact_forces() {
    const InUse in_use(busy_);
    const std::vector<ContactForce> forces = run_->contact_forces();
    if (forces.empty())
      throw ConfigError("the run keeps no count of forces. Make it with Simulation(scene, forces=True)");
    return contact_dict(contact_names_, forces);
  }
  nb::bytes save_state() {
    const InUse in_use(busy_);
    if (in_frame_)
      throw ConfigError(
          "a state is saved between two frames, and this run is inside of one (after step(), or a call that was "
          "interrupted). Call advance_frame(), which ends it, first");
    const std::vector<std::byte> state = run_->save_state();
    return nb::bytes(reinterpret_cast<const char*>(state.data()), state.size());
  }
  void load_state(const nb::bytes& state) {
    const InUse in_use(busy_);
    std::vector<std::byte> bytes(state.size());
    std::memcpy(bytes.data(), state.c_str(), state.size());
    run_->load_state(bytes);
    in_frame_ = false;
    whole_frames_ = ContactSums(run_->contact_forces(), run_->time());
  }
  double time() const { return run_->time(); }
  int64_t substeps() const { return run_->substeps(); }
  std::size_t particle_count() const { return run_->particle_count(); }
  PyScene scene() const { return {run_->scene(), file_}; }
  /// What the run was made of.
  const std::vector<NamedFile>& inputs() const { return inputs_; }
  /// contact_names() of a run with forces=True; else empty.
  const std::vector<std::string>& contact_names() const { return contact_names_; }
  Recorded record(FieldSet wanted) {
    const InUse in_use(busy_);
    const WithoutGil others_run;
    Recorded now = {run_->frame(wanted), whole_frames_};
    if (in_frame_) now.contacts.add(run_->contact_forces(), run_->time(), false);
    return now;
  }
  Trajectory header() {
    const InUse in_use(busy_);
    return run_->header();
  }

 private:
  void advance() {
    in_frame_ = true;
    while (!run_->advance_substep()) poll_();
    end_frame();
    poll_();
  }
  void end_frame() {
    in_frame_ = false;
    whole_frames_.add(run_->contact_forces(), run_->time(), true);
  }

  std::unique_ptr<Simulation> run_;
  std::vector<NamedFile> inputs_;
  std::string file_;  ///< of the scene
  bool on_gpu_ = false;
  bool in_frame_ = false;  ///< step() has begun a frame
  std::vector<std::string> contact_names_;
  ContactSums whole_frames_ = {{}, 0};
  SignalPoll poll_;
  std::atomic<bool> busy_ = false;
};

/// Writes a run to a file while it goes on.
class PyWriter {
 public:
  PyWriter(const nb::object& path, PySimulation& simulation, const std::string& fields, bool velocity)
      : fields_(FieldSet::parse(fields)) {
    io::TrajectoryWriteOptions options;
    options.velocity = velocity;
    options.fields = fields_;
    options.active = simulation.scene().has_inactive_particles();
    options.contacts = contact_names_ = simulation.contact_names();
    const std::string file = path_of(path);
    check_output(file, simulation.inputs());
    particle_count_ = simulation.particle_count();
    writer_ = std::make_unique<io::TrajectoryWriter>(file, simulation.header(), options);
  }
  void append(PySimulation& simulation) {
    const InUse in_use(busy_);
    io::TrajectoryWriter& writer = open();
    if (simulation.particle_count() != particle_count_)
      throw ConfigError("a run of " + std::to_string(simulation.particle_count()) +
                        " particles does not go into this file (allowed: " + std::to_string(particle_count_) +
                        ", as of the run that its writer was made for). Make a writer of its own");
    if (!contact_names_.empty() && simulation.contact_names() != contact_names_)
      throw ConfigError(
          "the run keeps no count of the forces on the obstacles and walls that this file has. Make it with "
          "Simulation(scene, forces=True), of the scene that the writer was made for");
    const Recorded now = simulation.record(fields_);
    const WithoutGil others_run;
    writer.append(now.frame);
    if (!contact_names_.empty()) writer.append_forces(now.contacts.since(before_.value_or(now.contacts)));
    before_ = now.contacts;
  }
  void finish(int64_t diverged_at_frame) {
    const InUse in_use(busy_);
    io::TrajectoryWriter& writer = open();
    const WithoutGil others_run;
    writer.finish(diverged_at_frame);
    writer_.reset();
  }
  /// The end of a with block; `whole` where it ended without an exception.
  void leave(bool whole) {
    if (whole && writer_) finish(-1);
    const InUse in_use(busy_);
    if (!writer_) return;
    const WithoutGil others_run;
    writer_->leave();
    writer_.reset();
  }

 private:
  io::TrajectoryWriter& open() {
    if (!writer_) throw ConfigError("the writer is finished. Make a new one");
    return *writer_;
  }
  FieldSet fields_;
  std::vector<std::string> contact_names_;  ///< of the forces in the file
  std::optional<ContactSums> before_;       ///< at the frame before
  std::size_t particle_count_ = 0;
  std::unique_ptr<io::TrajectoryWriter> writer_;
  std::atomic<bool> busy_ = false;
};

}  // namespace

void bind_simulation(nb::module_& module) {
  using namespace nb::literals;
  nb::class_<PySimulation>(
      module, "Simulation",
      "A run of the material point method, frame by frame.\n\n"
      "Long calls release the GIL, use all threads (set_num_threads()) and end with Ctrl-C.\n"
      "One Python thread at a time may use a run; a second one gets a RuntimeError.\n"
      "Arrays are read-only views without a copy of the state when they were asked for. They stay\n"
      "valid and unchanged after later frames and after the run's end. Those of a run on a GPU are there (GpuArray).")
      .def(nb::init<const PyScene&, const std::string&, const std::string&, std::optional<uint64_t>, bool>(), "scene"_a,
           "device"_a = "cpu", "precision"_a = "f32", "seed"_a = nb::none(), "forces"_a = false,
           "Samples the sources and builds the obstacles.\n\n"
           "device: 'cpu', 'cuda' or 'auto'; precision: 'f32' or 'f64' (CPU alone); seed of the particle sampling,\n"
           "default the scene's; forces: keep count of contact_forces(). Raises ConfigError for what cannot run,\n"
           "InputError for geometry that cannot be used.")
      .def("step", &PySimulation::step,
           "One substep of the solver; True once the frame is done. On a GPU it may be the whole frame.")
      .def("advance_frame", &PySimulation::advance_frame,
           "To the end of the frame: Scene.frame_time seconds. Raises DivergedError.\n\n"
           "Ctrl-C ends it between two substeps; the next call goes on from there.")
      .def("run", &PySimulation::run, "frames"_a = nb::none(), "progress"_a = nb::none(),
           nb::sig("def run(self, frames: int | None = None, progress: Callable[[int], object] | None = None) -> None"),
           "So many frames, default the scene's; progress(frame) after each.")
      .def_prop_ro("positions", &PySimulation::positions, nb::sig("def positions(self) -> numpy.ndarray | GpuArray"),
                   "f32 [particles, 3], m. The order never changes.")
      .def_prop_ro("velocities", &PySimulation::velocities, nb::sig("def velocities(self) -> numpy.ndarray | GpuArray"),
                   "f32 [particles, 3], m/s.")
      .def_prop_ro("active", &PySimulation::active, nb::rv_policy::automatic,
                   "u8 [particles]: 0 for particles that are not in the run (yet, any more).")
      .def_prop_ro("particle_types", &PySimulation::particle_types, nb::rv_policy::automatic,
                   "i32 [particles], ids of the material's model; docs/reference/file_formats.md.")
      .def_prop_ro(
          "volumes", &PySimulation::volumes, nb::rv_policy::automatic,
          "f64 [particles] m^3, of the matter before it deforms; with_particles(volumes=run.volumes) keeps masses.")
      .def("field", &PySimulation::field, "name"_a, nb::sig("def field(self, name: str) -> numpy.ndarray | GpuArray"),
           "f32: 'stress' [n, 6] Pa (Kirchhoff: xx, xy, xz, yy, yz, zz), 'affine' [n, 3, 3] 1/s,\n"
           "'deformation_gradient' [n, 3, 3] (elastic part), 'plastic' [n].")
      .def("balance", &PySimulation::balance, nb::sig("def balance(self) -> dict"),
           "Sums over all particles: mass kg, momentum kg m/s, kinetic, elastic, gravitational J.")
      .def(
          "contact_forces", &PySimulation::contact_forces, nb::sig("def contact_forces(self) -> dict"),
          "What the matter did to each obstacle and wall in the frame before, with Simulation(scene, forces=True):\n"
          "'names' [k], and f64 [k, 3] 'impulse' N s, 'force' N and 'torque' N m (means of the frame), 'reference' m,\n"
          "the point that the torque is about. Inside of a frame, after step(), of the part of it that is done; zeros\n"
          "before the first and after load_state(). Raises ConfigError without forces=True.")
      .def("save_state", &PySimulation::save_state,
           "The whole state between two frames as bytes; a run of the same build that loads it goes on exactly.")
      .def("load_state", &PySimulation::load_state, "state"_a,
           "Raises InputError when the state is of another scene, seed, precision or device, or damaged.")
      .def_prop_ro("time", &PySimulation::time, "[s].")
      .def_prop_ro("substeps", &PySimulation::substeps, "So far.")
      .def_prop_ro("particle_count", &PySimulation::particle_count)
      .def_prop_ro("scene", &PySimulation::scene)
      .def(
          "_on_device",
          [](const PySimulation& run, const std::string& name) {
            if (name == "positions") return run.on_device(ParticleQuantity::position);
            if (name == "velocities") return run.on_device(ParticleQuantity::velocity);
            return run.on_device(quantity_of(field_named(name)));
          },
          "name"_a, "The GpuArray of a run on a GPU, in the memory of whatever device the run is on: for tests.");

  nb::class_<PyWriter>(module, "TrajectoryWriter",
                       "Writes a run to an HDF5 file frame by frame; a context manager.\n\n"
                       "The file is path.part until finish(); after an exception the frames stay there.\n"
                       "One Python thread at a time may use it; a second one gets a RuntimeError.")
      .def(nb::init<const nb::object&, PySimulation&, const std::string&, bool>(), "path"_a, "simulation"_a,
           "fields"_a = "", "velocities"_a = true,
           nb::sig("def __init__(self, path: str | os.PathLike, simulation: Simulation, fields: str = '', velocities: "
                   "bool = True) -> None"),
           "fields: names of Simulation.field(), comma-separated. Of a Simulation(scene, forces=True) the forces\n"
           "are stored too: Trajectory.forces. Raises IoError, also for a folder or a device, and ConfigError for a\n"
           "file that the scene was read from.")
      .def("append", &PyWriter::append, "simulation"_a,
           "Adds the state now as a frame, with the forces since the frame before.\n\n"
           "Raises IoError, and ConfigError for a run with another number of particles, or without the forces that\n"
           "the file has.")
      .def("finish", &PyWriter::finish, "diverged_at_frame"_a = -1, "Completes the file and gives it its name.")
      .def(
          "__enter__", [](PyWriter& writer) -> PyWriter& { return writer; }, nb::rv_policy::reference)
      .def(
          "__exit__", [](PyWriter& writer, nb::handle type, nb::handle, nb::handle) { writer.leave(type.is_none()); },
          "type"_a.none(), "value"_a.none(), "traceback"_a.none());
}

}  // namespace graupel::python
