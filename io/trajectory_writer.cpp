// Streams a trajectory to HDF5. Whole chunks only are written, once each, and metadata leaves memory at flushes only:
// a kill can cost the frames since the last flush, never earlier ones.
#include <sys/statvfs.h>

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "io/hdf5_dataset.h"
#include "io/part_file.h"
#include "io/trajectory_file.h"
#include "io/trajectory_layout.h"

namespace graupel::io {

namespace {

constexpr int64_t largest_chunk_bytes = int64_t(4) << 20;
constexpr int64_t most_chunk_frames = 8;
constexpr int64_t particle_bytes = sizeof(Vec3f);
constexpr hsize_t time_chunk = 512;
static_assert(sizeof(Vec3f) == 3 * sizeof(float));

/// " Free space ..." or what else helps.
std::string remedy(const std::string& folder, uint64_t needed, const std::string& problem) {
  struct statvfs disk {};
  const bool known = ::statvfs(folder.c_str(), &disk) == 0;
  const uint64_t free_bytes = known ? uint64_t(disk.f_bavail) * disk.f_frsize : 0;
  if (problem.find("No space left") != std::string::npos || (known && free_bytes < needed))
    return "(disk full: " + std::to_string(needed) + " bytes needed, " + std::to_string(free_bytes) +
           " free). Free space on that disk or choose another folder";
  return "(" + problem + "). Check the disk or choose another folder";
}

}  // namespace

struct TrajectoryWriter::Impl {
  std::string path, part;
  TrajectoryWriteOptions options;
  hsize_t particles = 0;
  hsize_t chunk_frames = 1;
  hsize_t chunk_particles = 1;
  hdf5::Handle file, group, position, velocity, active, time;
  std::vector<Vec3f> pending_position, pending_velocity;
  std::vector<uint8_t> pending_active;
  std::vector<double> pending_time;
  hsize_t written = 0;
  hsize_t flushed = 0;
  bool closed = false;

  void start(const Trajectory& header);
  void write_header(const Trajectory& header);
  void choose_chunks();
  hdf5::Handle frames_dataset(const char* name, const char* units, const char* description);
  void store_initial_velocity(const ParticleFrame& frame);
  void write_pending();
  void flush();
  void close_all(int64_t diverged_at_frame);

  /// Runs HDF5 calls; a failure becomes an IoError, after which the writer is of no more use.
  template <typename Body>
  void guarded(const std::string& doing, Body&& body) {
    try {
      body();
    } catch (const hdf5::Failure& failure) {
      closed = true;
      const std::string folder = std::filesystem::absolute(path).parent_path().string();
      const uint64_t frames = written - flushed + pending_time.size();  // not safely on disk yet
      const uint64_t needed = (frames + 1) * particles * particle_bytes * (options.velocity ? 2 : 1);
      throw IoError("cannot " + doing + " '" + part + "' " + remedy(folder, needed, failure.what()) + "; the " +
                    std::to_string(flushed) + " frames flushed so far can be recovered");
    }
  }
};

void TrajectoryWriter::Impl::choose_chunks() {
  const int64_t frame_bytes = static_cast<int64_t>(particles) * particle_bytes;
  const int64_t flush_every = std::max(options.flush_every, 1);
  chunk_frames = static_cast<hsize_t>(
      std::clamp<int64_t>(largest_chunk_bytes / frame_bytes, 1, std::min(most_chunk_frames, flush_every)));
  chunk_particles = std::min<hsize_t>(particles, largest_chunk_bytes / particle_bytes);
}

hdf5::Handle TrajectoryWriter::Impl::frames_dataset(const char* name, const char* units, const char* description) {
  return hdf5::create_dataset(group, name,
                              {.element = hdf5::Element::float32,
                               .size = {0, particles, 3},
                               .chunk = {chunk_frames, chunk_particles, 3},
                               .deflate = options.deflate,
                               .checksum = true,
                               .units = units,
                               .description = description});
}

void TrajectoryWriter::Impl::write_header(const Trajectory& header) {
  hdf5::write_attribute(file, "format", trajectory_format);
  hdf5::write_attribute(file, "format_version", trajectory_format_version);
  hdf5::write_attribute(file, "complete", int64_t(0));
  hdf5::write_attribute(group, "scene_json", header.scene_json);
  hdf5::write_attribute(group, "seed", header.seed);
  hdf5::write_attribute(group, "made_by", header.made_by);
  hdf5::write_attribute(group, "frame_time", header.frame_time);
  hdf5::write_attribute(group, "diverged_at_frame", int64_t(-1));
}

void TrajectoryWriter::Impl::start(const Trajectory& header) {
  particles = header.particle_count();
  choose_chunks();
  file = create_part_file(part);
  group = hdf5::create_group(file, trajectory_group(options.group));
  write_header(header);
  position = frames_dataset("position", "m", "Particle positions [frame, particle, axis]");
  if (options.velocity) velocity = frames_dataset("velocity", "m/s", "Particle velocities [frame, particle, axis]");
  if (options.active)
    active = hdf5::create_dataset(group, "active",
                                  {.element = hdf5::Element::uint8,
                                   .size = {0, particles},
                                   .chunk = {chunk_frames, chunk_particles},
                                   .deflate = options.deflate,
                                   .checksum = true,
                                   .units = "",
                                   .description = "1 while a particle is in the run [frame, particle]"});
  // Without filters, chunks of times stay in their place when they grow.
  time = hdf5::create_dataset(group, "time",
                              {.element = hdf5::Element::float64,
                               .size = {0},
                               .chunk = {time_chunk},
                               .units = "s",
                               .description = "Time of each frame"});
  const hdf5::Handle types = hdf5::create_dataset(group, "particle_type",
                                                  {.element = hdf5::Element::int32,
                                                   .size = {particles},
                                                   .chunk = {},
                                                   .units = "",
                                                   .description = "3 obstacle, 4 jelly, 5 water, 6 sand, 8 snow"});
  hdf5::write_all(types, hdf5::Element::int32, header.particle_type.data());
  flush();
}

void TrajectoryWriter::Impl::store_initial_velocity(const ParticleFrame& frame) {
  hdf5::Handle dataset = hdf5::create_dataset(group, "initial_velocity",
                                              {.element = hdf5::Element::float32,
                                               .size = {particles, 3},
                                               .chunk = {chunk_particles, 3},
                                               .deflate = options.deflate,
                                               .checksum = true,
                                               .units = "m/s",
                                               .description = "Velocities in the first frame [particle, axis]"});
  hdf5::write_all(dataset, hdf5::Element::float32, frame.velocity.data());
  dataset.close("cannot write the initial velocities");
}

void TrajectoryWriter::Impl::write_pending() {
  const hsize_t count = pending_time.size();
  if (count == 0) return;
  hdf5::append_rows(position, written, count, {particles, 3}, hdf5::Element::float32, pending_position.data());
  if (options.velocity)
    hdf5::append_rows(velocity, written, count, {particles, 3}, hdf5::Element::float32, pending_velocity.data());
  if (options.active)
    hdf5::append_rows(active, written, count, {particles}, hdf5::Element::uint8, pending_active.data());
  hdf5::append_rows(time, written, count, {}, hdf5::Element::float64, pending_time.data());
  written += count;
  pending_position.clear();
  pending_velocity.clear();
  pending_active.clear();
  pending_time.clear();
}

void TrajectoryWriter::Impl::flush() {
  hdf5::check(H5Fflush(file, H5F_SCOPE_LOCAL), "cannot flush");
  flushed = written;
}

void TrajectoryWriter::Impl::close_all(int64_t diverged_at_frame) {
  write_pending();
  hdf5::write_attribute(group, "diverged_at_frame", diverged_at_frame);
  flush();
  position.close("cannot close a dataset");
  velocity.close("cannot close a dataset");
  active.close("cannot close a dataset");
  time.close("cannot close a dataset");
  group.close("cannot close a group");
  hdf5::write_attribute(file, "complete", int64_t(1));
  flush();
  finish_part_file(file, path);
}

TrajectoryWriter::TrajectoryWriter(const std::string& path, const Trajectory& header,
                                   const TrajectoryWriteOptions& options)
    : impl_(std::make_unique<Impl>()) {
  if (header.particle_type.empty()) throw ConfigError("a trajectory needs particles (0 given). Add a source");
  if (options.deflate < 0 || options.deflate > 9)
    throw ConfigError("compression level " + std::to_string(options.deflate) +
                      " does not exist (allowed 0 to 9). Use 1 for speed or 9 for size");
  impl_->path = path;
  impl_->part = path + ".part";
  impl_->options = options;
  impl_->guarded("start", [&] { impl_->start(header); });
}

TrajectoryWriter::~TrajectoryWriter() = default;

void TrajectoryWriter::append(const ParticleFrame& frame) {
  Impl& state = *impl_;
  GRAUPEL_ASSERT(!state.closed);
  GRAUPEL_ASSERT(frame.position.size() == state.particles);
  GRAUPEL_ASSERT(!state.options.velocity || frame.velocity.size() == state.particles);
  GRAUPEL_ASSERT(!state.options.active || frame.active.empty() || frame.active.size() == state.particles);
  const bool first = state.written == 0 && state.pending_time.empty();
  state.pending_position.insert(state.pending_position.end(), frame.position.begin(), frame.position.end());
  if (state.options.velocity)
    state.pending_velocity.insert(state.pending_velocity.end(), frame.velocity.begin(), frame.velocity.end());
  if (state.options.active) {
    const std::vector<uint8_t> all(frame.active.empty() ? state.particles : 0, 1);
    const std::vector<uint8_t>& active = frame.active.empty() ? all : frame.active;
    state.pending_active.insert(state.pending_active.end(), active.begin(), active.end());
  }
  state.pending_time.push_back(frame.time);
  const std::string doing = "write frame " + std::to_string(state.written + state.pending_time.size() - 1) + " to";
  state.guarded(doing, [&] {
    if (first && frame.velocity.size() == state.particles) state.store_initial_velocity(frame);
    if (state.pending_time.size() < state.chunk_frames) return;
    state.write_pending();
    if (state.written - state.flushed >= static_cast<hsize_t>(state.options.flush_every)) state.flush();
  });
}

void TrajectoryWriter::attribute(const std::string& name, const std::string& value) {
  GRAUPEL_ASSERT(!impl_->closed);
  impl_->guarded("write to", [&] { hdf5::write_attribute(impl_->group, name, value); });
}

void TrajectoryWriter::finish(int64_t diverged_at_frame) {
  GRAUPEL_ASSERT(!impl_->closed);
  impl_->guarded("finish", [&] { impl_->close_all(diverged_at_frame); });
  impl_->closed = true;
}

}  // namespace graupel::io
