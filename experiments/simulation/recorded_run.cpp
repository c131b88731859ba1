#include "experiments/simulation/recorded_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/printable.h"
#include "core/system/stopwatch.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "experiments/simulation/saved_run.h"
#include "experiments/simulation/scene_file_error.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

namespace {

/// A frame that may take longer keeps its first state, so that a stop need not wait for its end [s].
constexpr double long_frame = 0.4;

/// When emitters may send out the first particle [s].
double first_birth(const std::vector<Emitter>& emitters) {
  double first = std::numeric_limits<double>::infinity();
  for (const Emitter& emitter : emitters)
    first = std::min(first, emitter.emission == Emission::stream ? emitter.start_time : emitter.times.front());
  return first;
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

}  // namespace

RecordedRun::RecordedRun(const SimulateOptions& options, const Scene& scene, const mpm::SimulationOptions& simulation,
                         const std::optional<io::SavedRun>& saved)
    : options_(options), scene_(scene), write_(options.write_options(scene)), saved_(saved) {
  run_ = naming_file(options.scene_file(), [&] {
    const mpm::PreparedScene prepared(scene, simulation);
    header_.materials = kept_materials(scene.materials, prepared.particles.material);
    return mpm::Simulation::create(prepared);
  });
  if (!options.write_obstacles.empty()) run_->obstacles().write_vdb(options.write_obstacles);
  header_.particle_type = run_->particle_type();
  header_.frame_time = scene.frame_time;
  header_.scene_json = saved ? io::with_frames(saved->scene_json, scene.frames) : scene.source;
  header_.seed = simulation.seed;
  header_.made_by = "mpm";
  if (!saved) {
    writer_ = std::make_unique<io::TrajectoryWriter>(output(), header_, write_);
    append_frame();
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

void RecordedRun::finish() {
  // A state that is asked for is saved first: nothing else may end the run.
  const StopPolicyScope policy(options_.save_state.empty() ? StopPolicy::within_a_second : StopPolicy::finish);
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

void RecordedRun::advance() {
  try {
    advance_substeps();
  } catch (const DivergedError& error) {
    writer_->finish(frame_ + 1);  // the frames before are worth more than the bad state
    write_blowup(output(), header_, *run_, error.what());
    throw DivergedError(fmt::format("{}. Frames 0-{} are in '{}', the bad state in '{}.blowup.h5'", error.what(),
                                    frame_, output(), output()));
  }
  ++frame_;
  append_frame();
}

void RecordedRun::advance_substeps() {
  const bool keeps_state = !options_.save_state.empty();
  const std::vector<std::byte> first =
      keeps_state && frame_seconds_ > long_frame ? run_->save_state() : std::vector<std::byte>();
  const Stopwatch watch;
  while (!run_->advance_substep())
    if (interrupted() && keeps_state == !first.empty()) stop(&first);
  frame_seconds_ = watch.seconds();
}

void RecordedRun::append_frame() {
  writer_->append(mpm::frame_with_fields(*run_, write_.fields));
  if (options_.forces) writer_->append_forces(run_->contact_forces());
}

/// `state`: that of the last whole frame; null: it is the run's.
void RecordedRun::stop(const std::vector<std::byte>* state) {
  if (options_.save_state.empty()) {
    writer_->leave();
    throw_interrupted(fmt::format(
        "; '{0}.part' holds the frames so far, recover them with 'graupel inspect --recover {0}'", output()));
  }
  save(writer_->checkpoint(), state);
  throw_interrupted(fmt::format("; '{0}' holds the state of frame {1}, go on with 'graupel simulate --resume {0}'",
                                options_.save_state, frame_),
                    AfterStop::goes_on);
}

void RecordedRun::save(const std::vector<ParticleFrame>& recent, const std::vector<std::byte>* bytes) const {
  io::SavedRun state;
  state.version = version_text();
  state.device = options_.common.device;
  state.precision = options_.precision;
  state.seed = header_.seed;
  state.frame = frame_;
  state.time = static_cast<double>(frame_) * scene_.frame_time;
  state.particles = static_cast<int64_t>(run_->particle_count());
  state.scene_json = header_.scene_json;
  state.output = std::filesystem::absolute(output()).lexically_normal();
  state.velocity = write_.velocity;
  state.active = write_.active;
  state.fields = write_.fields;
  state.forces = options_.forces;
  state.recent = recent;
  state.state = bytes != nullptr ? *bytes : run_->save_state();
  io::write_state_file(options_.save_state, state);
}

/// Coefficients of friction that the scene gives surfaces to which matter sticks.
void RecordedRun::warn_of_unused_friction() const {
  for (std::size_t i = 0; i < scene_.obstacles.size(); ++i)
    if (const Obstacle& obstacle = scene_.obstacles[i]; obstacle.contact == Contact::stick && obstacle.friction > 0)
      warn(fmt::format("obstacle {}: 'friction' ({:g}) has no effect, 'contact' is \"stick\"", i, obstacle.friction));
  const Domain& domain = scene_.domain;
  if (domain.wall_friction > 0 && !domain.has_wall(Wall::slip) && !domain.has_wall(Wall::separate))
    warn(fmt::format("'wall_friction' ({:g}) has no effect, no wall has the contact \"slip\" or \"separate\"",
                     domain.wall_friction));
}

void RecordedRun::report() const {
  const auto s = run_->statistics();
  const double updates =
      static_cast<double>(s.substeps - substeps_before_) * static_cast<double>(run_->particle_count());
  const double speed = s.solver_seconds > 0 ? updates / s.solver_seconds : 0;
  std::fprintf(stderr, "%s: %zu particles, %lld frames, %lld substeps, %s in the solver (%.2f M particle-updates/s)\n",
               printable(output()).c_str(), run_->particle_count(), static_cast<long long>(scene_.frames),
               static_cast<long long>(s.substeps), human_time(s.solver_seconds).c_str(), 1e-6 * speed);
  if (s.sound_courant > 1)
    warn(fmt::format("the sound CFL reached {:.2f}, for {:.2f}% of the particles over 1 in a substep", s.sound_courant,
                     100 * s.share_over_courant));
  if (s.loads_without_carriers > 0)
    warn(fmt::format("{} of {} loads began where there was no matter that can move, and did nothing",
                     s.loads_without_carriers, scene_.loads.size()));
  const double end = static_cast<double>(scene_.frames) * scene_.frame_time;
  if (!scene_.emitters.empty() && first_birth(scene_.emitters) >= end)
    warn(fmt::format("the emitters sent out no particle: the first comes at {:g} s, and the run ends at {:g} s",
                     first_birth(scene_.emitters), end));
  if (s.removed == 0 && !scene_.sinks.empty()) warn("no particle reached a sink");
  warn_of_unused_friction();
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
      {"load_momentum", {s.load_momentum[0], s.load_momentum[1], s.load_momentum[2]}},
      {"loads_without_carriers", s.loads_without_carriers},
      {"sound_courant", s.sound_courant},
      {"share_over_courant", s.share_over_courant},
      {"peak_bytes", s.peak_bytes},
      {"device", options_.common.device},
      {"threads", num_threads()}};
  if (saved_) result["resumed_from_frame"] = saved_->frame;
  if (!options_.save_state.empty()) result["saved_state"] = options_.save_state;
  options_.common.write_json(result);
}

}  // namespace graupel::experiments
