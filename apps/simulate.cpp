// graupel simulate: scene -> MPM trajectory.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/parallel/memory.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "experiments/process/outputs.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "experiments/simulation/saved_run.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct SimulateOptions {
  CommonOptions common;
  std::string scene, output, precision = "f32", write_obstacles, fields, save_state, resume;
  std::vector<std::string> set;
  int64_t frames = -1, save_every = 0;
  bool dry_run = false, print_defaults = false, no_velocity = false, precision_given = false;
  bool deterministic = false;  ///< asked for; every solver is

  io::TrajectoryWriteOptions write_options(const Scene& scene_to_run) const {
    io::TrajectoryWriteOptions write;
    write.velocity = !no_velocity;
    write.active = scene_to_run.has_inactive_particles();
    write.fields = FieldSet::parse(fields);
    return write;
  }
};

mpm::SimulationOptions simulation_options(const SimulateOptions& options, const Scene& scene, Device device) {
  mpm::SimulationOptions simulation;
  simulation.device = device;
  simulation.precision = options.precision == "f64" ? mpm::Precision::f64 : mpm::Precision::f32;
  simulation.seed = options.common.seed_given ? options.common.seed : scene.seed;
  return simulation;
}

/// Runs `body`; what it finds wrong with the scene is told with the name of the scene's file.
template <typename Body>
auto of_file(const SimulateOptions& options, const Body& body) {
  try {
    return body();
  } catch (const ConfigError& error) {
    throw ConfigError((options.scene.empty() ? options.resume : options.scene) + ": " + error.what());
  }
}

void dry_run(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation) {
  const mpm::Estimate e = of_file(options, [&] { return mpm::estimate(scene, simulation); });
  const double disk = static_cast<double>(e.particles) * static_cast<double>(scene.frames + 1) *
                      static_cast<double>(io::particle_frame_bytes(options.write_options(scene)));
  std::printf("particles        %lld\ngrid nodes       %lld (active at the start)\nsubsteps         %lld\n",
              static_cast<long long>(e.particles), static_cast<long long>(e.grid_nodes),
              static_cast<long long>(e.substeps));
  // Memory and time are measured on this machine: the first frame of the real scene.
  Scene probe = scene;
  probe.frames = 1;
  auto run = mpm::Simulation::create(probe, simulation);
  run->advance_frame();
  const auto statistics = run->statistics();
  const double memory = static_cast<double>(statistics.peak_bytes);
  const double per_particle = memory / static_cast<double>(e.particles);
  const double seconds = statistics.solver_seconds / static_cast<double>(std::max<int64_t>(1, statistics.substeps)) *
                         static_cast<double>(e.substeps);
  std::printf("memory           %s on the device (%.0f peak bytes per particle), %s available\n",
              human_bytes(memory).c_str(), per_particle,
              human_bytes(static_cast<double>(available_bytes(simulation.device)) + memory).c_str());
  std::printf("disk, at most    %s\ntime, about      %s (from the first frame on this machine)\n",
              human_bytes(disk).c_str(), human_time(seconds).c_str());
  options.common.write_json({{"particles", e.particles},
                             {"grid_nodes", e.grid_nodes},
                             {"substeps", e.substeps},
                             {"memory_bytes", statistics.peak_bytes},
                             {"peak_bytes_per_particle", per_particle},
                             {"disk_bytes", disk},
                             {"seconds", seconds}});
}

std::string default_output(const Scene& scene) {
  return (scene.name.empty() ? std::string("trajectory") : scene.name) + ".h5";
}

/// Keeps the state at which a run blew up beside its trajectory.
void write_blowup(const std::string& output, const Trajectory& header, const mpm::Simulation& run,
                  const std::string& reason) {
  const std::string path = output + ".blowup.h5";
  const ParticleFrame frame = run.frame();
  io::TrajectoryWriteOptions options;
  options.active = !frame.active.empty();
  io::TrajectoryWriter writer(path, header, options);
  writer.append(frame);
  writer.attribute("reason", reason);
  writer.finish(0);
}

/// Takes from the state what the user left open. Throws InputError where the two differ.
io::SavedRun take_saved_run(SimulateOptions& options) {
  RunWishes wishes;
  if (options.common.device != "auto") wishes.device = options.common.device;
  if (options.precision_given) wishes.precision = options.precision;
  if (options.common.seed_given) wishes.seed = std::to_string(options.common.seed);
  wishes.fields = FieldSet::parse(options.fields).names();
  wishes.no_velocity = options.no_velocity;
  io::SavedRun saved = read_saved_run(options.resume, wishes);
  options.common.device = saved.device;
  options.common.seed = saved.seed;
  options.common.seed_given = true;
  options.precision = saved.precision;
  options.fields = saved.fields.names();
  options.no_velocity = !saved.velocity;
  if (options.output.empty()) options.output = saved.output;
  return saved;
}

/// A run with its trajectory and its saved states.
class Run {
 public:
  Run(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation,
      const std::optional<io::SavedRun>& saved)
      : options_(options), scene_(scene), write_(options.write_options(scene)), saved_(saved) {
    run_ = of_file(options, [&] { return mpm::Simulation::create(scene, simulation); });
    if (!options.write_obstacles.empty()) run_->obstacles().write_vdb(options.write_obstacles);
    header_.particle_type = run_->particle_type();
    header_.frame_time = scene.frame_time;
    header_.scene_json = saved ? io::with_frames(saved->scene_json, scene.frames) : scene.source;
    header_.seed = simulation.seed;
    header_.made_by = "mpm";
    if (!saved) {
      writer_ = std::make_unique<io::TrajectoryWriter>(output(), header_, write_);
      writer_->append(frame());
      return;
    }
    restore(*run_, *saved, options.resume, options.scene);
    frame_ = saved->frame;
    substeps_before_ = run_->statistics().substeps;
    if (!std::filesystem::exists(output()) && !std::filesystem::exists(output() + ".part"))
      std::fprintf(stderr, "graupel: note: there is no '%s' to continue; it begins with frame %lld\n", output().c_str(),
                   static_cast<long long>(frame_));
    writer_ = std::make_unique<io::TrajectoryWriter>(output(), header_, write_, checkpoint_of(*run_, *saved));
  }

  void finish() {
    const int64_t first = frame_;
    Progress progress(fmt::format("simulate {} ({} particles)", scene_.name, run_->particle_count()),
                      scene_.frames - first);
    while (frame_ < scene_.frames) {
      if (interrupted()) stop();
      advance();
      if (options_.save_every > 0 && frame_ % options_.save_every == 0 && frame_ < scene_.frames)
        save(writer_->checkpoint());
      progress.update(frame_ - first, fmt::format("{} substeps", run_->statistics().substeps));
    }
    writer_->finish();
    if (!options_.save_state.empty()) save({});
    progress.done();
  }

  void report() const;

 private:
  const std::string& output() const { return options_.output; }
  ParticleFrame frame() const { return mpm::frame_with_fields(*run_, write_.fields); }

  void advance() {
    try {
      run_->advance_frame();
    } catch (const DivergedError& error) {
      write_blowup(output(), header_, *run_, error.what());
      writer_->finish(frame_ + 1);
      throw DivergedError(fmt::format("{}. Frames 0-{} are in '{}', the bad state in '{}.blowup.h5'", error.what(),
                                      frame_, output(), output()));
    }
    ++frame_;
    writer_->append(frame());
  }

  [[noreturn]] void stop() {
    if (options_.save_state.empty())
      stop_if_interrupted(fmt::format(
          "; '{0}.part' holds the frames so far, recover them with 'graupel inspect --recover {0}'", output()));
    save(writer_->checkpoint());
    throw Error(
        ExitCode::interrupted,
        fmt::format("interrupted; '{0}' holds the state of frame {1}, go on with 'graupel simulate --resume {0}'",
                    options_.save_state, frame_));
  }

  void save(const std::vector<ParticleFrame>& recent) const {
    io::SavedRun state;
    state.version = version_text();
    state.device = options_.common.device;
    state.precision = options_.precision;
    state.seed = header_.seed;
    state.frame = frame_;
    state.time = run_->time();
    state.particles = static_cast<int64_t>(run_->particle_count());
    state.scene_json = header_.scene_json;
    state.output = std::filesystem::absolute(output()).lexically_normal();
    state.velocity = write_.velocity;
    state.active = write_.active;
    state.fields = write_.fields;
    state.recent = recent;
    state.state = run_->save_state();
    io::write_state_file(options_.save_state, state);
  }

  const SimulateOptions& options_;
  const Scene& scene_;
  io::TrajectoryWriteOptions write_;
  const std::optional<io::SavedRun>& saved_;
  std::unique_ptr<mpm::Simulation> run_;
  Trajectory header_;
  std::unique_ptr<io::TrajectoryWriter> writer_;
  int64_t frame_ = 0;            ///< finished ones
  int64_t substeps_before_ = 0;  ///< of the run that was saved
};

void Run::report() const {
  const auto s = run_->statistics();
  const double updates =
      static_cast<double>(s.substeps - substeps_before_) * static_cast<double>(run_->particle_count());
  const double speed = s.solver_seconds > 0 ? updates / s.solver_seconds : 0;
  std::fprintf(
      stderr,
      "%s: %zu particles, %lld frames, %lld substeps, %s in the solver (%.2f M particle-updates/s), %lld pushed out\n",
      output().c_str(), run_->particle_count(), static_cast<long long>(scene_.frames),
      static_cast<long long>(s.substeps), human_time(s.solver_seconds).c_str(), 1e-6 * speed,
      static_cast<long long>(s.pushed_out));
  if (s.sound_courant > 1)
    std::fprintf(stderr,
                 "graupel: warning: the sound CFL reached %.2f, for %.2f%% of the particles over 1 in a substep\n",
                 s.sound_courant, 100 * s.share_over_courant);
  nlohmann::ordered_json result = {
      {"output", output()},
      {"particles", run_->particle_count()},
      {"frames", scene_.frames},
      {"substeps", s.substeps},
      {"solver_seconds", s.solver_seconds},
      {"updates_per_second", speed},
      {"pushed_out", s.pushed_out},
      {"pushed_out_momentum", {s.pushed_out_momentum[0], s.pushed_out_momentum[1], s.pushed_out_momentum[2]}},
      {"born", s.born},
      {"removed", s.removed},
      {"scripted_momentum", {s.scripted_momentum[0], s.scripted_momentum[1], s.scripted_momentum[2]}},
      {"sound_courant", s.sound_courant},
      {"share_over_courant", s.share_over_courant},
      {"peak_bytes", s.peak_bytes},
      {"device", options_.common.device},
      {"threads", num_threads()}};
  if (saved_) result["resumed_from_frame"] = saved_->frame;
  if (!options_.save_state.empty()) result["saved_state"] = options_.save_state;
  options_.common.write_json(result);
}

void check_flags(const SimulateOptions& options) {
  if (options.scene.empty() && options.resume.empty())
    throw ConfigError(
        "simulate needs a scene file, or --resume with a saved state. Example: graupel simulate "
        "scenes/shared/water_steps.json -o steps.h5");
  if (options.save_every > 0 && options.save_state.empty())
    throw ConfigError("--save-every needs the file to write (no --save-state given). Add --save-state FILE");
  FieldSet::parse(options.fields);
}

void simulate(SimulateOptions& options) {
  if (options.print_defaults) {
    std::fputs(io::scene_defaults().c_str(), stdout);
    return;
  }
  check_flags(options);
  std::optional<io::SavedRun> saved;
  if (!options.resume.empty()) saved = take_saved_run(options);
  const Device device = options.common.apply();
  options.common.device = name_of(device);
  if (options.frames >= 0) options.set.push_back("frames=" + std::to_string(options.frames));
  const Scene scene =
      saved ? scene_of(*saved, options.resume, options.scene, options.set) : io::read_scene(options.scene, options.set);
  const auto simulation = simulation_options(options, scene, device);
  if (options.dry_run) return dry_run(options, scene, simulation);
  if (options.output.empty()) options.output = default_output(scene);
  for (const std::string& file : {options.output, options.write_obstacles, options.save_state}) check_output_file(file);
  if (!options.save_state.empty() && std::filesystem::absolute(options.save_state).lexically_normal() ==
                                         std::filesystem::absolute(options.output).lexically_normal())
    throw ConfigError("--save-state and --output name the same file ('" + options.output +
                      "'). Give the state its own");
  Run run(options, scene, simulation, saved);
  run.finish();
  run.report();
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* verb = app.add_subcommand("simulate", "Run a scene with the material point method");
  verb->add_option("scene", options->scene, "Scene file (JSON)");
  verb->add_option("-o,--output", options->output, "Trajectory file; default NAME.h5");
  verb->add_option("--frames", options->frames, "Frames of the whole run; default the scene's")->check(whole_number(0));
  verb->add_option("--set", options->set, "Change a scene key: --set domain.dx=0.02 (repeatable)")
      ->allow_extra_args(false);
  verb->add_option("--precision", options->precision, "f32 or f64")
      ->check(CLI::IsMember({"f32", "f64"}))
      ->capture_default_str()
      ->each([options = options.get()](const std::string&) { options->precision_given = true; });
  verb->add_flag("--no-velocity", options->no_velocity, "Store positions only");
  verb->add_option("--fields", options->fields,
                   "Store these of every frame too: stress,affine,deformation_gradient,plastic");
  verb->add_option("--save-state", options->save_state,
                   "Write the whole state to this file at the end, or when stopped");
  verb->add_option("--save-every", options->save_every, "Write it every so many frames as well")
      ->check(whole_number(1));
  verb->add_option("--resume", options->resume, "Go on from this state; the scene file may be left out");
  verb->add_flag("--deterministic", options->deterministic,
                 "Same bytes in every run on the same kind of device (all solvers do this)");
  verb->add_option("--write-obstacles", options->write_obstacles,
                   "Write the obstacles' signed distances to this .vdb file");
  verb->add_flag("--dry-run", options->dry_run, "Print particles, grid, substeps, memory, disk and time, then stop");
  verb->add_flag("--print-defaults", options->print_defaults, "Print every scene key with its default");
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel simulate scenes/shared/water_steps.json -o steps.h5\n"
      "  graupel simulate scenes/shared/water_steps.json -o steps.h5 --save-state steps.state --save-every 50\n"
      "  graupel simulate --resume steps.state --frames 600");
  verb->callback([options] { simulate(*options); });
}

}  // namespace graupel::apps
