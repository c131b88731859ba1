// Rollouts of graph networks and runs of reduced-order models.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <filesystem>
#include <limits>

#include "library/graph.h"
#include "library/python/arrays.h"
#include "library/python/trajectory_frames.h"
#include "library/rom.h"
#include "nn/bf16_gemm.h"

namespace graupel::python {

namespace {

/// progress(frame), with the GIL.
void report(const nb::object& progress, int64_t frame) {
  if (progress.is_none()) return;
  const WithGil gil;
  progress(frame);
}

NetworkHistory history_of(nb::handle positions, nb::handle types) {
  const auto x = array_from<float>("history", positions);
  const auto kinds = array_from<int64_t>("particle_types", types);
  const std::size_t n = x.ndim() == 3 ? x.shape(1) : 0;
  check_shape("history", x, {n, 3}, "[frames, particles, 3]");
  check_shape("particle_types", kinds, {}, "[particles]");
  NetworkHistory history;
  for (std::size_t i = 0; i < kinds.shape(0); ++i) {
    const int64_t kind = kinds.data()[i];
    if (kind < 0 || kind > std::numeric_limits<int32_t>::max())
      throw ConfigError("particle_types[" + std::to_string(i) + "] = " + std::to_string(kind) +
                        " is no particle type (allowed: 0 and more). Correct it");
    history.particle_type.push_back(static_cast<int32_t>(kind));
  }
  for (std::size_t f = 0; f < x.shape(0); ++f) {
    const auto* frame = reinterpret_cast<const Vec3f*>(x.data()) + f * n;
    history.position.emplace_back(frame, frame + n);
  }
  return history;
}

struct PyNetwork {
  explicit PyNetwork(const std::string& weights) : model(weights), file(std::filesystem::absolute(weights).string()) {
    nn::choose_gemm_precision();  // as the program does
  }
  NetworkModel model;
  std::string file;
  std::atomic<bool> busy = false;  ///< on a GPU one thread at a time
};

struct PyReducedModel : ReducedModel {
  explicit PyReducedModel(const std::string& weights)
      : ReducedModel(weights), file(std::filesystem::absolute(weights).string()) {
    nn::choose_gemm_precision();
  }
  std::string file;
};

/// In memory, with what it was made of.
PyTrajectory made_of(Trajectory made, const PyScene& scene, const std::string& weights) {
  std::vector<NamedFile> inputs = files_of(scene);
  inputs.push_back({"the weights", weights});
  PyTrajectory trajectory = in_memory(std::move(made));
  trajectory.inputs = std::move(inputs);
  return trajectory;
}

PyTrajectory roll_out(PyNetwork& network, const PyScene& scene, std::optional<int64_t> frames,
                      const std::string& device, std::optional<uint64_t> seed, double density_limit, bool free_flight,
                      bool keep_out, const nb::object& progress) {
  const InUse in_use(network.busy);
  if (frames && *frames < 0) throw ConfigError("frames must not be negative. Use 0 or more");
  if (!(density_limit >= 0 && density_limit <= 10))
    throw ConfigError("density_limit is not possible (" + std::to_string(density_limit) +
                      ", allowed: 0 to 10, of the density at rest; 0: none). Correct it");
  SignalPoll poll;
  NetworkRollout options;
  options.device = parse_device(device);
  options.frames = frames;
  options.seed = seed;
  options.density_limit = density_limit;
  options.free_flight = free_flight;
  options.keep_out = keep_out;
  options.progress = [&](int64_t frame) {
    poll();
    report(progress, frame);
  };
  Trajectory made;
  {
    const WithoutGil others_run;
    made = network.model.rollout(scene, options);
  }
  return made_of(std::move(made), scene, network.file);
}

PyTrajectory run_reduced(const PyReducedModel& model, const PyScene& scene, std::optional<int64_t> frames,
                         const std::string& device, const std::string& precision, std::optional<uint64_t> seed,
                         const nb::object& progress) {
  if (frames && *frames < 0) throw ConfigError("frames must not be negative. Use 0 or more");
  SignalPoll poll;
  Trajectory made;
  std::string verdict;
  double trust = 0;
  {
    const Device place = parse_device(device);
    const bool f64 = is_f64(precision);
    const WithoutGil others_run;
    ReducedSimulation run(model, scene, {.device = place, .f64 = f64, .seed = seed});
    made = run.header();
    made.frames.push_back(run.frame());
    for (int64_t frame = 1; frame <= frames.value_or(scene.frames); ++frame) {
      try {
        run.advance_frame();
      } catch (const DivergedError&) {
        made.diverged_at_frame = frame;
        break;
      }
      made.frames.push_back(run.frame());
      poll();
      report(progress, frame);
    }
    verdict = run.verdict();
    trust = run.trust_number();
  }
  PyTrajectory trajectory = made_of(std::move(made), scene, model.file);
  trajectory.verdict = verdict;
  trajectory.trust_number = trust;
  return trajectory;
}

}  // namespace

void bind_models(nb::module_& module) {
  using namespace nb::literals;
  nb::class_<PyNetwork>(module, "NetworkModel",
                        "A graph network (HGN, GNS) of a weights file, for any number of scenes.")
      .def(
          "__init__", [](PyNetwork* place, const nb::object& weights) { new (place) PyNetwork(path_of(weights)); },
          "weights"_a, nb::sig("def __init__(self, weights: str | os.PathLike) -> None"),
          "Raises InputError for a file that is missing, damaged or holds no graph network.")
      .def(
          "rollout", &roll_out, "scene"_a, "frames"_a = nb::none(), nb::kw_only(), "device"_a = "cpu",
          "seed"_a = nb::none(), "density_limit"_a = 1.0, "free_flight"_a = true, "keep_out"_a = true,
          "progress"_a = nb::none(),
          nb::sig("def rollout(self, scene: Scene, frames: int | None = None, *, device: str = 'cpu', seed: int | None "
                  "= None, density_limit: float = 1.0, free_flight: bool = True, keep_out: bool = True, progress: "
                  "Callable[[int], object] | None = None) -> Trajectory"),
          "Frames from the scene's start on, default the scene's number.\n\n"
          "density_limit: largest density, of that at rest, 0 to 10, 0: none; free_flight: keep the momentum of what "
          "flies\n"
          "freely; keep_out: move particles out of obstacles and into the walls. progress(frame) after each frame.\n"
          "A rollout that blows up ends before that frame (Trajectory.diverged_at_frame). Raises ConfigError.")
      .def(
          "start",
          [](const PyNetwork& network, const PyScene& scene, std::optional<uint64_t> seed) {
            NetworkHistory start = network.model.start(scene, seed);
            const std::size_t frames = start.position.size(), n = start.particle_type.size();
            std::vector<float> all;
            all.reserve(3 * frames * n);
            for (const std::vector<Vec3f>& frame : start.position)
              for (const Vec3f& x : frame) all.insert(all.end(), {x[0], x[1], x[2]});
            return nb::make_tuple(array_of(std::move(all), {frames, n, 3}),
                                  array_of(std::move(start.particle_type), {n}));
          },
          "scene"_a, "seed"_a = nb::none(),
          nb::sig("def start(self, scene: Scene, seed: int | None = None) -> tuple[numpy.ndarray, numpy.ndarray]"),
          "Positions [history + 1, n, 3] m up to the scene's start, newest last, and particle types [n].")
      .def(
          "features",
          [](const PyNetwork& network, const PyScene& scene, nb::object history, nb::object types) {
            NetworkInput input = network.model.input(scene, history_of(history, types));
            const std::size_t n = input.embedding_row.size(), width = input.width;
            return nb::make_tuple(array_of(std::move(input.features), {n, width}),
                                  array_of(std::move(input.embedding_row), {n}),
                                  nb::make_tuple(input.grid_origin[0], input.grid_origin[1], input.grid_origin[2]));
          },
          "scene"_a, "history"_a, "particle_types"_a,
          nb::sig("def features(self, scene: Scene, history: ArrayLike, particle_types: ArrayLike) -> "
                  "tuple[numpy.ndarray, numpy.ndarray, tuple[float, float, float]]"),
          "Features [n, width], rows of embedding.weight [n], and the origin of HGN's grid [m]; networks.md tells "
          "them.")
      .def(
          "accelerations",
          [](const PyNetwork& network, const PyScene& scene, nb::object history, nb::object types) {
            const NetworkHistory known = history_of(history, types);
            auto made = std::make_shared<std::vector<Vec3f>>();
            {
              const WithoutGil others_run;
              *made = network.model.accelerations(scene, known);
            }
            return rows_of(*made, made);
          },
          "scene"_a, "history"_a, "particle_types"_a,
          nb::sig("def accelerations(self, scene: Scene, history: ArrayLike, particle_types: ArrayLike) -> "
                  "numpy.ndarray"),
          "[n, 3] m/frame^2 of the next frame, before all corrections: x' = 2 x - x_before + a.")
      .def(
          "remarks", [](const PyNetwork& network, const PyScene& scene) { return network.model.remarks(scene); },
          "scene"_a, "What of a scene the network was not trained on, a sentence each.");

  nb::class_<PyReducedModel>(module, "ReducedModel", "A reduced-order model (NSF, CROM) of a weights file.")
      .def(
          "__init__",
          [](PyReducedModel* place, const nb::object& weights) { new (place) PyReducedModel(path_of(weights)); },
          "weights"_a, nb::sig("def __init__(self, weights: str | os.PathLike) -> None"),
          "Raises InputError for a file that is missing, damaged or holds no reduced-order model.")
      .def_prop_ro(
          "scene",
          [](const PyReducedModel& model) {
            return PyScene{model.scene(), model.file};
          },
          "The scene of a training run, which every run starts from.")
      .def_prop_ro(
          "parameters",
          [](const PyReducedModel& model) {
            nb::list all;
            for (const ReducedParameter& p : model.parameters()) {
              nb::dict one;
              one["name"] = p.name;
              one["unit"] = p.unit;
              one["keys"] = p.keys;
              one["low"] = p.low;
              one["high"] = p.high;
              all.append(one);
            }
            return all;
          },
          nb::sig("def parameters(self) -> list[dict]"),
          "Keys of the scene that may differ from run to run: name, unit, keys, and the training's low, high.")
      .def(
          "remarks", [](const PyReducedModel& model, const PyScene& scene) { return model.remarks(scene); }, "scene"_a,
          "What of a scene the model was not trained on. Raises ConfigError for a scene that it cannot run.")
      .def(
          "rollout", &run_reduced, "scene"_a, "frames"_a = nb::none(), nb::kw_only(), "device"_a = "cpu",
          "precision"_a = "f32", "seed"_a = nb::none(), "progress"_a = nb::none(),
          nb::sig("def rollout(self, scene: Scene, frames: int | None = None, *, device: str = 'cpu', precision: str = "
                  "'f32', seed: int | None = None, progress: Callable[[int], object] | None = None) -> Trajectory"),
          "A run of the scene, which may differ from the training's in its parameters alone. The trajectory has a\n"
          "verdict and a trust_number. Raises ConfigError.");
}

}  // namespace graupel::python
