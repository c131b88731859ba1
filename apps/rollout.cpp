// graupel rollout: weights + scene (or a trajectory) -> predicted trajectory.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "experiments/process/common_options.h"
#include "experiments/rollout/reduced_rollout.h"
#include "apps/verbs.h"
#include "compare/metrics/position_error.h"
#include "core/scene/held_particles.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "experiments/models/bundle_times.h"
#include "experiments/process/outputs.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "graph/learned_simulator.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/sampling.h"

namespace graupel::apps {

using namespace experiments;

bool is_trajectory(const std::string& path) { return path.ends_with(".h5"); }

Trajectory chosen_header(const io::TrajectoryReader& reader, const RolloutOptions& options) {
  if (options.trajectory >= reader.count())
    throw ConfigError(fmt::format("--trajectory {} is not in '{}' (allowed: 0 to {})", options.trajectory,
                                  options.input, reader.count() - 1));
  Trajectory header = reader.header(static_cast<int>(options.trajectory));
  if (header.scene_json.empty())
    throw InputError("'" + options.input +
                     "' holds no scene, so its walls and obstacles are unknown. Give the scene file instead");
  return header;
}

Scene stored_scene(const Trajectory& header, const RolloutOptions& options) {
  return io::parse_stored_scene(header.scene_json, options.input, options.input, options.set);
}

namespace {

struct Start {
  Scene scene;
  std::vector<int32_t> particle_type;
  std::vector<std::vector<Vec3f>> history;  ///< oldest first
  std::vector<std::vector<Vec3f>> rest;     ///< of a trajectory: its frames after the start
  uint64_t seed = 0;
  bool unknown_gravity = false;  ///< other programs' data do not say it
};

/// The scene's particles at rest or at their initial velocity, with a ballistic past.
Start start_from_scene(const RolloutOptions& options, int history) {
  Start start;
  start.scene = io::read_scene(options.input, options.set);
  start.seed = options.common.seed_given ? options.common.seed : start.scene.seed;
  const mpm::SampledParticles particles = mpm::sample_sources(start.scene, start.seed);
  std::vector<Vec3f> position, velocity;
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    position.push_back(particles.position[p].cast<float>());
    velocity.push_back(particles.velocity[p].cast<float>());
    start.particle_type.push_back(particle_type_of(
        start.scene.materials.at(particles.material_names[static_cast<std::size_t>(particles.material[p])]).model));
  }
  start.history = graph::start_history(position, velocity, start.scene.gravity, start.scene.frame_time, history,
                                       held_particles(start.particle_type));
  return start;
}

/// Positions of usable frames from `first` on, at most `count` of them (-1: all).
std::vector<std::vector<Vec3f>> read_rest(const io::TrajectoryReader& reader, int index, const Trajectory& header,
                                          int64_t first, int64_t count) {
  int64_t usable = static_cast<int64_t>(header.frame_count());
  if (header.diverged_at_frame >= 0) usable = std::min(usable, header.diverged_at_frame);
  const int64_t there = std::max<int64_t>(0, usable - first);
  std::vector<std::vector<Vec3f>> positions;
  for (auto& frame : reader.frames(index, first, count < 0 ? there : std::min(there, count)))
    positions.push_back(std::move(frame.position));
  return positions;
}

/// "scene": frame 0 with a ballistic past; "truth:N": the first N frames of the trajectory.
Start start_from_trajectory(const RolloutOptions& options, int history) {
  const io::TrajectoryReader reader(options.input);
  const Trajectory header = chosen_header(reader, options);
  const int index = static_cast<int>(options.trajectory);
  Start start;
  start.scene = stored_scene(header, options);
  start.particle_type = header.particle_type;
  start.seed = header.seed;
  start.unknown_gravity = header.made_by.starts_with("converted from") && norm2(start.scene.gravity) == 0;
  start.rest = read_rest(reader, index, header, options.start == "scene" ? 1 : history, options.frames);
  if (options.start == "scene") {
    auto velocity = reader.initial_velocity(index);
    const auto first = reader.frames(index, 0, 1).front();
    if (velocity.empty()) velocity = first.velocity;
    if (velocity.empty())
      throw InputError("'" + options.input +
                       "' stores no velocity of the first frame. Use --start truth:" + std::to_string(history));
    start.history = graph::start_history(first.position, velocity, start.scene.gravity, start.scene.frame_time, history,
                                         held_particles(start.particle_type));
    return start;
  }
  for (auto& frame : reader.frames(index, 0, history)) start.history.push_back(std::move(frame.position));
  return start;
}

/// Flags that mean nothing for the kind of input.
void check_flags(const RolloutOptions& options) {
  if (is_trajectory(options.input) && options.common.seed_given)
    throw ConfigError("--seed has no effect on '" + options.input +
                      "' (a trajectory's particles are given; --seed samples a scene's). Leave it out");
  if (!is_trajectory(options.input) && options.trajectory > 0)
    throw ConfigError("--trajectory needs a data set (.h5) as input, not '" + options.input + "'. Leave it out");
  check_output_file(options.output);
}

/// Flags that the kind of model does not know.
void check_flags_of_network(const RolloutOptions& options) {
  const char* flag = options.step_factor                     ? "--step-factor"
                     : options.refine                        ? "--refine"
                     : options.stride != 1                   ? "--stride"
                     : options.arithmetic == Arithmetic::f64 ? "--f64"
                                                             : nullptr;
  if (flag != nullptr)
    throw ConfigError(
        fmt::format("{} is of reduced-order models, and '{}' is a graph network. Leave it out", flag, options.weights));
}

void check_flags_of_reduced_model(const RolloutOptions& options) {
  if (options.start != "scene")
    throw ConfigError(fmt::format(
        "--start {} is of graph networks; '{}' is a reduced-order model, which starts with its scene (allowed: scene). "
        "Leave it out",
        options.start, options.weights));
  if (options.no_project)
    throw ConfigError("--no-project is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which moves no particle out of obstacles. Leave it out");
  if (options.no_free_flight)
    throw ConfigError("--no-free-flight is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which changes no momentum. Leave it out");
  if (options.density_limit)
    throw ConfigError("--density-limit is of graph networks; '" + options.weights +
                      "' is a reduced-order model, which keeps the volume of its matter itself. Leave it out");
}

/// How far a rollout is from the rest of the trajectory that it started from.
struct RolloutError {
  std::size_t frames = 0;     ///< compared
  double first = 0, all = 0;  ///< position MSE [m^2] of the first 20 frames, and of all
};
constexpr std::size_t first_frames = 20;

/// `rest` is used up.
RolloutError error_of(Trajectory& trajectory, std::vector<std::vector<Vec3f>>& rest) {
  if (rest.empty()) return {};
  compare::ParticleRun truth, run;
  truth.trajectory.particle_type = trajectory.particle_type;
  truth.trajectory.frames.push_back(trajectory.frames.front());
  run.trajectory = std::move(trajectory);
  for (std::vector<Vec3f>& position : rest) {
    truth.trajectory.frames.emplace_back();
    truth.trajectory.frames.back().position = std::move(position);
  }
  const auto curve = compare::position_error_curve(truth, run);
  trajectory = std::move(run.trajectory);
  return {curve.size(), compare::mean_of_first(curve, first_frames), compare::mean_of_first(curve, curve.size())};
}

void check_scene(const Start& start, const RolloutOptions& options) {
  if (start.scene.domain.is_plane() && options.density_limit.value_or(0) > 0)
    throw ConfigError(fmt::format(
        "--density-limit {} is for scenes in space, and '{}' has two dimensions (allowed there: 0). Leave it out",
        *options.density_limit, options.input));
}

void rollout_network(const RolloutOptions& options, Device device) {
  const graph::LearnedSimulator simulator(options.weights);
  const int history = static_cast<int>(simulator.config().history) + 1;
  const std::string truth = "truth:" + std::to_string(history);
  if (options.start != "scene" && options.start != truth)
    throw ConfigError("--start '" + options.start + "' is not usable with these weights (allowed: scene, " + truth +
                      ")");
  if (options.start != "scene" && !is_trajectory(options.input))
    throw ConfigError("--start " + options.start + " needs a trajectory (.h5) as input, not a scene");
  Start start =
      is_trajectory(options.input) ? start_from_trajectory(options, history) : start_from_scene(options, history);
  check_scene(start, options);
  const graph::Surroundings surroundings(start.scene);

  graph::LearnedSimulator::RolloutOptions run;
  const int64_t given = options.start == "scene" ? start.scene.frames : static_cast<int64_t>(start.rest.size());
  run.frames = options.frames >= 0 ? options.frames : given;
  run.project = !options.no_project;
  run.density_limit = options.density_limit.value_or(run.density_limit);
  run.free_flight = !options.no_free_flight && !start.unknown_gravity;
  run.given = &start.rest;
  run.device = device;
  if (start.unknown_gravity && !options.no_free_flight)
    std::fprintf(stderr,
                 "rollout: the data do not say their gravity, so that free flight is left to the network; "
                 "--set gravity=[0,-9.8,0] says it\n");
  Progress progress(fmt::format("rollout {} ({} particles)", start.scene.name, start.particle_type.size()), run.frames);
  BundleTimes times(simulator.config().bundle, run.frames);
  run.progress = [&](int64_t frame, const graph::FrameTiming& timing) {
    stop_if_interrupted();
    times.add(frame, timing.total());
    progress.update(frame, fmt::format("{:.0f} ms a frame", 1e3 * timing.total()));
  };
  Trajectory trajectory = simulator.rollout(start.scene, surroundings, start.particle_type, start.history, run);
  if (trajectory.diverged_at_frame < 0) progress.done();
  trajectory.seed = start.seed;
  trajectory.made_by = options.weights;
  io::TrajectoryWriteOptions write;
  write.velocity = false;
  io::TrajectoryWriter writer(options.output, trajectory, write);
  for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
  writer.finish(trajectory.diverged_at_frame);

  std::vector<double> seconds = times.times();
  const RolloutError error = error_of(trajectory, start.rest);
  std::sort(seconds.begin(), seconds.end());
  const double median = seconds.empty() ? 0 : seconds[seconds.size() / 2];
  std::fprintf(stderr, "%s: %zu particles, %zu frames, %s a frame (median)\n", options.output.c_str(),
               trajectory.particle_count(), trajectory.frame_count() - 1, human_time(median).c_str());
  nlohmann::ordered_json json = {{"output", options.output},
                                 {"particles", trajectory.particle_count()},
                                 {"frames", trajectory.frame_count() - 1},
                                 {"seconds_per_frame", median},
                                 {"diverged_at_frame", trajectory.diverged_at_frame}};
  if (error.frames > 0) {
    std::fprintf(stderr, "position MSE against '%s': %.3g m^2 over %zu frames, %.3g m^2 over %zu\n",
                 options.input.c_str(), error.first, std::min(error.frames, first_frames), error.all, error.frames);
    json["compared_frames"] = error.frames;
    json["position_mse_20"] = error.first;
    json["position_mse_all"] = error.all;
  }
  options.common.write_json(json);
  if (trajectory.diverged_at_frame >= 0)
    throw DivergedError(fmt::format("the rollout diverged at frame {}; the frames before it are in '{}'",
                                    trajectory.diverged_at_frame, options.output));
}

void rollout(RolloutOptions& options) {
  check_flags(options);
  const bool reduced = is_reduced_model(options.weights);
  // Learned simulators take the GPU where it is asked for.
  const Device device = options.common.device == "auto" ? Device::cpu : parse_device(options.common.device);
  options.common.apply();
  reduced ? check_flags_of_reduced_model(options) : check_flags_of_network(options);
  reduced ? rollout_reduced(options) : rollout_network(options, device);
}

}  // namespace

void add_rollout(CLI::App& app) {
  auto options = std::make_shared<RolloutOptions>();
  CLI::App* verb = app.add_subcommand(
      "rollout", "Predict a scene with a learned simulator: a graph network or a reduced-order model");
  verb->add_option("weights", options->weights, "Weights file (.safetensors)")->required();
  verb->add_option("input", options->input, "Scene (.json) or trajectory (.h5)")->required();
  verb->add_option("-o,--output", options->output, "Trajectory file")->capture_default_str();
  verb->add_option("--frames", options->frames,
                   "Frames to predict; default the scene's, of truth:N the rest of the input")
      ->check(whole_number(0));
  verb->add_option("--set", options->set, "Change a scene key: --set gravity=[0,-5,0] (repeatable)")
      ->allow_extra_args(false);
  verb->add_option("--start", options->start,
                   "Of networks. scene: frame 0 with a ballistic past; truth:N: the first N frames of the input. Of a "
                   "trajectory the rest is compared with")
      ->capture_default_str();
  verb->add_option("--trajectory", options->trajectory, "Which trajectory of a data set")
      ->check(whole_number(0))
      ->capture_default_str();
  verb->add_flag("--no-project", options->no_project, "Of networks: do not move particles out of obstacles");
  verb->add_flag("--no-free-flight", options->no_free_flight,
                 "Of networks: let them change the momentum of what flies freely");
  verb->add_option("--density-limit", options->density_limit,
                   "Of networks: largest density of the matter, of that at rest; default 1, 0: none")
      ->check(real_number(0, 10));
  verb->add_option("--step-factor", options->step_factor, "Of reduced-order models: steps over those of the training")
      ->check(real_number(LowerBound::above_zero));
  verb->add_flag_callback(
      "--f64", [options] { options->arithmetic = Arithmetic::f64; }, "Of reduced-order models: double precision");
  verb->add_option("--refine", options->refine,
                   "Of reduced-order models: write so many points in the volume of every particle (positions alone)")
      ->check(whole_number(1, 1000000));
  verb->add_option("--stride", options->stride, "Of reduced-order models: write every n-th frame")
      ->check(whole_number(1))
      ->capture_default_str();
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel rollout models/hgn.safetensors scenes/shared/water_steps.json -o predicted.h5\n"
      "  graupel rollout models/hgn.safetensors steps.h5 --start truth:6 --frames 60\n"
      "  graupel rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --set "
      "materials.sand.friction_angle=33\n"
      "  graupel rollout models/nsf-sand.safetensors scenes/shared/sand_column.json --refine 100 --stride 10");
  verb->callback([options] { rollout(*options); });
}

}  // namespace graupel::apps
