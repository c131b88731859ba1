// graupel simulate: scene -> MPM trajectory.
#include <fmt/format.h>
#include <sys/resource.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/common_options.h"
#include "apps/outputs.h"
#include "apps/progress.h"
#include "apps/verbs.h"
#include "core/command_line.h"
#include "core/error.h"
#include "io/scene_reader.h"
#include "io/trajectory_file.h"
#include "mpm/simulation.h"

namespace graupel::apps {

namespace {

struct SimulateOptions {
  CommonOptions common;
  std::string scene, output, precision = "f32", write_obstacles;
  std::vector<std::string> set;
  int64_t frames = -1;
  bool dry_run = false, print_defaults = false, no_velocity = false;
};

mpm::SimulationOptions simulation_options(const SimulateOptions& options, const Scene& scene, Device device) {
  mpm::SimulationOptions simulation;
  simulation.device = device;
  simulation.precision = options.precision == "f64" ? mpm::Precision::f64 : mpm::Precision::f32;
  simulation.seed = options.common.seed_given ? options.common.seed : scene.seed;
  return simulation;
}

void dry_run(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation) {
  const mpm::Estimate e = mpm::estimate(scene, simulation);
  const double disk =
      static_cast<double>(e.particles) * static_cast<double>(scene.frames + 1) * (options.no_velocity ? 12 : 24);
  std::printf(
      "particles        %lld\ngrid nodes       %lld (active at the start)\nsubsteps         %lld\n"
      "memory           %s\ndisk, at most    %s\n",
      static_cast<long long>(e.particles), static_cast<long long>(e.grid_nodes), static_cast<long long>(e.substeps),
      human_bytes(static_cast<double>(e.memory_bytes)).c_str(), human_bytes(disk).c_str());
  // The time is measured on this machine: a few substeps of the real scene.
  Scene probe = scene;
  probe.frames = 1;
  auto run = mpm::Simulation::create(probe, simulation);
  run->advance_frame();
  const auto statistics = run->statistics();
  const double seconds = statistics.solver_seconds / static_cast<double>(std::max<int64_t>(1, statistics.substeps)) *
                         static_cast<double>(e.substeps);
  std::printf("time, about      %s (from the first frame on this machine)\n", human_time(seconds).c_str());
  options.common.write_json({{"particles", e.particles},
                             {"grid_nodes", e.grid_nodes},
                             {"substeps", e.substeps},
                             {"memory_bytes", e.memory_bytes},
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

void simulate(SimulateOptions& options) {
  if (options.print_defaults) {
    std::fputs(io::scene_defaults().c_str(), stdout);
    return;
  }
  if (options.scene.empty())
    throw ConfigError(
        "simulate needs a scene file. Example: graupel simulate scenes/shared/water_steps.json -o steps.h5");
  const Device device = options.common.apply();
  if (options.frames >= 0) options.set.push_back("frames=" + std::to_string(options.frames));
  const Scene scene = io::read_scene(options.scene, options.set);
  const auto simulation = simulation_options(options, scene, device);
  if (options.dry_run) return dry_run(options, scene, simulation);
  const std::string output = options.output.empty() ? default_output(scene) : options.output;

  check_output_file(output);
  check_output_file(options.write_obstacles);
  auto run = mpm::Simulation::create(scene, simulation);
  if (!options.write_obstacles.empty()) run->obstacles().write_vdb(options.write_obstacles);
  Trajectory header;
  header.particle_type = run->particle_type();
  header.frame_time = scene.frame_time;
  header.scene_json = scene.source;
  header.seed = simulation.seed;
  header.made_by = "mpm";
  io::TrajectoryWriteOptions write;
  write.velocity = !options.no_velocity;
  write.active = scene.has_inactive_particles();
  io::TrajectoryWriter writer(output, header, write);
  writer.append(run->frame());
  Progress progress(fmt::format("simulate {} ({} particles)", scene.name, run->particle_count()), scene.frames);
  const std::string what_now =
      fmt::format("; '{0}.part' holds the frames so far, recover them with 'graupel inspect --recover {0}'", output);
  for (int64_t f = 1; f <= scene.frames; ++f) {
    stop_if_interrupted(what_now);
    try {
      run->advance_frame();
    } catch (const DivergedError& error) {
      write_blowup(output, header, *run, error.what());
      writer.finish(f);
      throw DivergedError(fmt::format("{}. Frames 0-{} are in '{}', the bad state in '{}.blowup.h5'", error.what(),
                                      f - 1, output, output));
    }
    writer.append(run->frame());
    progress.update(f, fmt::format("{} substeps", run->statistics().substeps));
  }
  writer.finish();
  progress.done();

  const auto s = run->statistics();
  const double updates = static_cast<double>(s.substeps) * static_cast<double>(run->particle_count());
  std::fprintf(
      stderr,
      "%s: %zu particles, %lld frames, %lld substeps, %s in the solver (%.2f M particle-updates/s), %lld pushed out\n",
      output.c_str(), run->particle_count(), static_cast<long long>(scene.frames), static_cast<long long>(s.substeps),
      human_time(s.solver_seconds).c_str(), 1e-6 * updates / s.solver_seconds, static_cast<long long>(s.pushed_out));
  if (s.sound_courant > 1)
    std::fprintf(stderr,
                 "graupel: warning: the sound CFL reached %.2f, for %.2f%% of the particles over 1 in a substep\n",
                 s.sound_courant, 100 * s.share_over_courant);
  options.common.write_json(
      {{"output", output},
       {"particles", run->particle_count()},
       {"frames", scene.frames},
       {"substeps", s.substeps},
       {"solver_seconds", s.solver_seconds},
       {"updates_per_second", updates / s.solver_seconds},
       {"pushed_out", s.pushed_out},
       {"pushed_out_momentum", {s.pushed_out_momentum[0], s.pushed_out_momentum[1], s.pushed_out_momentum[2]}},
       {"born", s.born},
       {"removed", s.removed},
       {"scripted_momentum", {s.scripted_momentum[0], s.scripted_momentum[1], s.scripted_momentum[2]}},
       {"sound_courant", s.sound_courant},
       {"share_over_courant", s.share_over_courant},
       {"peak_bytes", s.peak_bytes},
       {"device", name_of(device)},
       {"threads", num_threads()}});
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* verb = app.add_subcommand("simulate", "Run a scene with the material point method");
  verb->add_option("scene", options->scene, "Scene file (JSON)");
  verb->add_option("-o,--output", options->output, "Trajectory file; default NAME.h5");
  verb->add_option("--frames", options->frames, "Frames to run; default the scene's")->check(whole_number(0));
  verb->add_option("--set", options->set, "Change a scene key: --set domain.dx=0.02 (repeatable)")
      ->allow_extra_args(false);
  verb->add_option("--precision", options->precision, "f32 or f64")
      ->check(CLI::IsMember({"f32", "f64"}))
      ->capture_default_str();
  verb->add_flag("--no-velocity", options->no_velocity, "Store positions only");
  verb->add_option("--write-obstacles", options->write_obstacles,
                   "Write the obstacles' signed distances to this .vdb file");
  verb->add_flag("--dry-run", options->dry_run, "Print particles, grid, substeps, memory, disk and time, then stop");
  verb->add_flag("--print-defaults", options->print_defaults, "Print every scene key with its default");
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel simulate scenes/shared/water_steps.json -o steps.h5\n"
      "  graupel simulate scenes/shared/water_steps.json --dry-run --set domain.dx=0.0078125");
  verb->callback([options] { simulate(*options); });
}

}  // namespace graupel::apps
