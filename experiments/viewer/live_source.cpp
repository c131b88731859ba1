#include "experiments/viewer/live_source.h"

#include <filesystem>

#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/simulation/scene_file_error.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

LiveSource::LiveSource(const LiveRequest& request, uint32_t run) {
  const Scene scene = io::read_scene(request.scene, request.set);
  mpm::SimulationOptions options = request.options;
  if (!request.seed_given) options.seed = scene.seed;
  simulation_ = naming_file(request.scene, [&] {
    const mpm::PreparedScene prepared(scene, options);
    facts_.materials = kept_materials(scene.materials, prepared.particles.material);
    return mpm::Simulation::create(prepared);
  });
  set_scene(facts_, scene);
  facts_.name = std::filesystem::path(request.scene).filename().string();
  facts_.made_by = "mpm";
  facts_.particle_type = simulation_->particle_type();
  for (int64_t k = 0; k <= scene.frames; ++k) facts_.times.push_back(static_cast<double>(k) * scene.frame_time);
  facts_.live = true;
  facts_.run = run;
  limits_ = facts_.limits();
  frames_ = std::make_unique<FrameFile>(scene.frames + 1, facts_.record_bytes());
  status_.state = "running";
  thread_ = std::thread([this] { this->run(); });
}

LiveSource::~LiveSource() {
  stop();
  thread_.join();
}

RunStatus LiveSource::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void LiveSource::read(int64_t frame, std::size_t offset, std::span<std::byte> out) {
  GRAUPEL_ASSERT(frames_->has(frame));
  frames_->read(frame, offset, out);
}

void LiveSource::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

void LiveSource::pause(bool on) {
  const std::lock_guard lock(mutex_);
  paused_ = on;
  if (status_.state == "running" || status_.state == "paused") status_.state = on ? "paused" : "running";
  changed_.notify_all();
}

bool LiveSource::stopped() const {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

void LiveSource::run() {
  std::string state = "done", message;
  try {
    add_frame();
    for (std::size_t k = 1; k < facts_.times.size(); ++k) {
      if (!wait_while_paused()) return;
      const Stopwatch watch;
      if (!advance()) return;
      add_frame();
      const std::lock_guard lock(mutex_);
      status_.frame_seconds = watch.seconds();
    }
  } catch (const std::exception& error) {
    state = "failed";
    message = error.what();
  }
  const std::lock_guard lock(mutex_);
  status_.state = state;
  status_.message = message;
}

/// False once the run is to end.
bool LiveSource::wait_while_paused() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !paused_ || stopped_; });
  return !stopped_;
}

/// By substeps, so that the end of the program is not kept waiting; false once it comes.
bool LiveSource::advance() {
  while (!simulation_->advance_substep())
    if (stopped()) return false;
  return true;
}

void LiveSource::add_frame() {
  const ParticleFrame frame = simulation_->frame();
  FrameToEncode encoded;
  encoded.time = frame.time;
  encoded.position = frame.position;
  encoded.active = frame.active;
  encoded.obstacle_pose = facts_.obstacle_poses(frame.time);
  encoded.run = facts_.run;
  frames_->put(status().frames, encode_frame(encoded, limits_));
  const std::lock_guard lock(mutex_);
  ++status_.frames;
}

}  // namespace graupel::experiments
