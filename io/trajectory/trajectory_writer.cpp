// Streams a trajectory to HDF5. Whole chunks only are written, once each, and metadata leaves memory at flushes only:
// a kill can cost the frames since the last flush, never earlier ones.

#include <algorithm>
#include <filesystem>
#include <functional>
#include <limits>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/hdf5/output_driver.h"
#include "io/trajectory/chunk_shape.h"
#include "io/trajectory/contact_datasets.h"
#include "io/trajectory/field_datasets.h"
#include "io/trajectory/material_dataset.h"
#include "io/trajectory/part_file.h"
#include "io/trajectory/run_parameters.h"
#include "io/trajectory/trajectory_continuation.h"
#include "io/trajectory/trajectory_file.h"
#include "io/trajectory/trajectory_layout.h"

namespace graupel::io {

namespace {

/// A dataset with one row a frame.
struct FrameDataset {
  hdf5::Handle id;
  hdf5::Element element;
  std::vector<hsize_t> row;  ///< size of one frame
  std::vector<hsize_t> chunk;
  std::function<const void*(const ParticleFrame&)> values;
};

}  // namespace

int64_t particle_frame_bytes(const TrajectoryWriteOptions& options) {
  return position_bytes * (options.velocity ? 2 : 1) + (options.active ? 1 : 0) +
         int64_t(sizeof(float)) * options.fields.components();
}

struct TrajectoryWriter::Impl {
  std::string path, part;
  TrajectoryWriteOptions options;
  hsize_t particles = 0;
  hsize_t chunk_frames = 1;
  hdf5::Handle file, group, time;
  std::vector<FrameDataset> datasets;
  std::optional<ContactWriter> contacts;
  std::vector<ParticleFrame> pending;  ///< not written yet
  hsize_t written = 0;
  hsize_t flushed = 0;
  double last_time = -std::numeric_limits<double>::infinity();  ///< [s]
  bool closed = false;

  void start(const Trajectory& header, hdf5::Handle empty_file);
  void start_new_file(const Trajectory& header);
  void write_header(const Trajectory& header);
  void add_dataset(const char* name, const char* units, const char* description, hdf5::Element element, int components,
                   std::function<const void*(const ParticleFrame&)> values);
  void add_datasets();
  void store_initial_velocity(const ParticleFrame& frame);
  ParticleFrame stored_part(const ParticleFrame& frame) const;
  void check_sizes(const ParticleFrame& frame) const;
  void append(const ParticleFrame& frame);
  void continue_from(const Trajectory& header, const TrajectoryCheckpoint& checkpoint);
  std::vector<hdf5::ChunkRow> filter_pending() const;
  void write_pending(const std::vector<hdf5::ChunkRow>& rows);
  void append_forces(const FrameForces& forces);
  void flush();
  void flush_if_due();
  void close_all(int64_t diverged_at_frame);

  /// Runs HDF5 calls; a failure becomes an IoError, after which the writer is of no more use.
  template <typename Body>
  void guarded(const std::string& doing, Body&& body) {
    const auto hold = hdf5::library_lock();
    try {
      body();
      if (file.is_open()) hdf5::check_written(file);
    } catch (const hdf5::Failure& failure) {
      closed = true;
      const std::string folder = std::filesystem::absolute(path).parent_path().string();
      const uint64_t frames = written - flushed + pending.size();  // not safely on disk yet
      const uint64_t needed = (frames + 1) * particles * static_cast<uint64_t>(particle_frame_bytes(options));
      throw IoError(
          "cannot " + doing + " '" + part + "' " + write_remedy(folder, needed, failure.what()) +
          (flushed == 0 ? "" : "; the " + std::to_string(flushed) + " frames flushed so far can be recovered"));
    }
  }
};

void TrajectoryWriter::Impl::add_dataset(const char* name, const char* units, const char* description,
                                         hdf5::Element element, int components,
                                         std::function<const void*(const ParticleFrame&)> values) {
  FrameDataset dataset;
  const int64_t bytes = components * int64_t(element == hdf5::Element::uint8 ? 1 : sizeof(float));
  dataset.element = element;
  dataset.row = {particles};
  if (components > 1) dataset.row.push_back(static_cast<hsize_t>(components));
  dataset.values = std::move(values);
  std::vector<hsize_t> size = dataset.row;
  size.insert(size.begin(), 0);
  dataset.chunk = dataset.row;
  dataset.chunk[0] = particles_in_a_chunk(particles, chunk_frames, bytes);
  dataset.chunk.insert(dataset.chunk.begin(), chunk_frames);
  dataset.id = hdf5::create_dataset(group, name,
                                    {.element = element,
                                     .size = size,
                                     .chunk = dataset.chunk,
                                     .deflate = options.deflate,
                                     .checksum = true,
                                     .units = units,
                                     .description = description});
  datasets.push_back(std::move(dataset));
}

void TrajectoryWriter::Impl::add_datasets() {
  add_dataset("position", "m", "Particle positions [frame, particle, axis]", hdf5::Element::float32, 3,
              [](const ParticleFrame& f) { return f.position.data(); });
  if (options.velocity)
    add_dataset("velocity", "m/s", "Particle velocities [frame, particle, axis]", hdf5::Element::float32, 3,
                [](const ParticleFrame& f) { return f.velocity.data(); });
  if (options.active)
    add_dataset("active", "", "1 while a particle is in the run [frame, particle]", hdf5::Element::uint8, 1,
                [](const ParticleFrame& f) { return f.active.data(); });
  for (const ParticleField field : all_particle_fields) {
    if (!options.fields.contains(field)) continue;
    const ParticleFieldInfo& info = info_of(field);
    add_dataset(info.name, info.units, info.description, hdf5::Element::float32, info.components,
                [field](const ParticleFrame& f) { return f.fields[field].data(); });
  }
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

void TrajectoryWriter::Impl::start(const Trajectory& header, hdf5::Handle empty_file) {
  chunk_frames = frames_in_a_chunk(particles, options.flush_every);
  file = std::move(empty_file);
  group = hdf5::create_group(file, trajectory_group(options.group));
  write_header(header);
  add_datasets();
  // Without filters, chunks of times stay in their place when they grow.
  time = hdf5::create_dataset(group, "time",
                              {.element = hdf5::Element::float64,
                               .size = {0},
                               .chunk = {time_chunk},
                               .early = true,
                               .units = "s",
                               .description = "Time of each frame"});
  const hdf5::Handle types = hdf5::create_dataset(group, "particle_type",
                                                  {.element = hdf5::Element::int32,
                                                   .size = {particles},
                                                   .chunk = {},
                                                   .units = "",
                                                   .description = "3 obstacle, 4 jelly, 5 water, 6 sand, 8 snow"});
  hdf5::write_all(types, hdf5::Element::int32, header.particle_type.data());
  write_materials(group, header.materials);
  if (!options.contacts.empty()) contacts.emplace(group, options.contacts);
  flush();
}

/// Where that fails, the file is removed: it holds nothing.
void TrajectoryWriter::Impl::start_new_file(const Trajectory& header) {
  bool mine = false;
  try {
    guarded("start", [&] {
      hdf5::Handle empty_file = create_part_file(part);
      mine = true;
      start(header, std::move(empty_file));
    });
  } catch (...) {
    if (mine) remove_path(part);
    throw;
  }
}

void TrajectoryWriter::Impl::store_initial_velocity(const ParticleFrame& frame) {
  hdf5::Handle dataset =
      hdf5::create_dataset(group, "initial_velocity",
                           {.element = hdf5::Element::float32,
                            .size = {particles, 3},
                            .chunk = {particles_in_a_chunk(particles, chunk_frames, position_bytes), 3},
                            .deflate = options.deflate,
                            .checksum = true,
                            .units = "m/s",
                            .description = "Velocities in the first frame [particle, axis]"});
  hdf5::write_all(dataset, hdf5::Element::float32, frame.velocity.data());
  dataset.close("cannot write the initial velocities");
}

/// What of a frame the file keeps.
ParticleFrame TrajectoryWriter::Impl::stored_part(const ParticleFrame& frame) const {
  ParticleFrame kept{frame.time, frame.position, {}, {}, {}};
  if (options.velocity) kept.velocity = frame.velocity;
  if (options.active) kept.active = frame.active.empty() ? std::vector<uint8_t>(particles, 1) : frame.active;
  for (const ParticleField field : all_particle_fields)
    if (options.fields.contains(field)) kept.fields[field] = frame.fields[field];
  return kept;
}

/// Throws where the frame lacks rows of what the file keeps.
void TrajectoryWriter::Impl::check_sizes(const ParticleFrame& frame) const {
  const auto check = [&](const std::string& what, std::size_t size, std::size_t needed) {
    if (size == needed) return;
    throw ConfigError("frame " + std::to_string(written + pending.size()) + " of '" + path + "' has " +
                      std::to_string(size) + " values of '" + what + "' (allowed: " + std::to_string(needed) + ", of " +
                      std::to_string(particles) + " particles). Append whole frames, with all that the file keeps");
  };
  check("position", frame.position.size(), particles);
  if (options.velocity) check("velocity", frame.velocity.size(), particles);
  if (options.active && !frame.active.empty()) check("active", frame.active.size(), particles);
  for (const ParticleField field : all_particle_fields)
    if (options.fields.contains(field))
      check(std::string(info_of(field).name), frame.fields[field].size(),
            particles * static_cast<std::size_t>(info_of(field).components));
}

void TrajectoryWriter::Impl::append(const ParticleFrame& frame) {
  GRAUPEL_ASSERT(!closed);
  check_sizes(frame);
  if (!(frame.time > last_time))
    throw ConfigError("frame " + std::to_string(written + pending.size()) + " of '" + path + "' is at " +
                      std::to_string(frame.time) + " s, the one before at " + std::to_string(last_time) +
                      " s (allowed: later ones). Append each frame once, in their order");
  last_time = frame.time;
  const bool first = written == 0 && pending.empty();
  pending.push_back(stored_part(frame));
  const std::string doing = "write frame " + std::to_string(written + pending.size() - 1) + " to";
  if (first && frame.velocity.size() == particles) guarded(doing, [&] { store_initial_velocity(frame); });
  if (pending.size() < chunk_frames) return;
  const auto chunks = filter_pending();
  guarded(doing, [&] {
    write_pending(chunks);
    if (!contacts) flush_if_due();
  });
}

void TrajectoryWriter::Impl::append_forces(const FrameForces& forces) {
  guarded("write forces to", [&] {
    contacts->append(forces);
    flush_if_due();  // with the frame's forces: a flushed frame has them
  });
}

void TrajectoryWriter::Impl::flush_if_due() {
  if (written - flushed >= static_cast<hsize_t>(options.flush_every)) flush();
}

/// The pending frames of every dataset, ready for the disk. Many writers do this at once.
std::vector<hdf5::ChunkRow> TrajectoryWriter::Impl::filter_pending() const {
  std::vector<hdf5::ChunkRow> rows;
  if (pending.empty()) return rows;
  for (const FrameDataset& dataset : datasets) {
    std::vector<const void*> values;
    for (const ParticleFrame& frame : pending) values.push_back(dataset.values(frame));
    const std::size_t element_bytes = dataset.element == hdf5::Element::uint8 ? 1 : sizeof(float);
    rows.push_back(hdf5::filter_rows(
        values, dataset.row, dataset.chunk,
        {.element_bytes = element_bytes, .shuffle = true, .deflate = options.deflate, .checksum = true}));
  }
  return rows;
}

void TrajectoryWriter::Impl::write_pending(const std::vector<hdf5::ChunkRow>& rows) {
  const hsize_t count = pending.size();
  if (count == 0) return;
  for (std::size_t i = 0; i < datasets.size(); ++i)
    hdf5::append_chunks(datasets[i].id, written, datasets[i].row, rows[i]);
  std::vector<double> times;
  for (const ParticleFrame& frame : pending) times.push_back(frame.time);
  hdf5::append_rows(time, written, count, {}, hdf5::Element::float64, times.data());
  written += count;
  pending.clear();
}

void TrajectoryWriter::Impl::flush() {
  hdf5::check(H5Fflush(file, H5F_SCOPE_LOCAL), "cannot flush");
  hdf5::check_written(file);
  flushed = written;
}

void TrajectoryWriter::Impl::close_all(int64_t diverged_at_frame) {
  const auto chunks = filter_pending();
  guarded("finish", [&] {
    write_pending(chunks);
    hdf5::write_attribute(group, "diverged_at_frame", diverged_at_frame);
    flush();
    for (FrameDataset& dataset : datasets) dataset.id.close("cannot close a dataset");
    time.close("cannot close a dataset");
    if (contacts) contacts->close();
    group.close("cannot close a group");
    hdf5::write_attribute(file, "complete", int64_t(1));
    flush();
    finish_part_file(file, path);
  });
}

/// Fills a file of its own, which then replaces what was there: a kill in between costs nothing.
void TrajectoryWriter::Impl::continue_from(const Trajectory& header, const TrajectoryCheckpoint& checkpoint) {
  auto found = find_interrupted(path, header, options, checkpoint);
  if (!found) {
    start_new_file(header);
    append(checkpoint.recent.back());
    if (contacts) append_forces(FrameForces(options.contacts.size()));
    return;
  }
  UnfinishedFile aside(aside_name(part));
  guarded("start", [&] { start(header, hdf5::create_file(aside.path())); });
  hsize_t row = 0;
  copy_kept_frames(*found, checkpoint, header.frame_time, [&](const ParticleFrame& frame) {
    append(frame);
    if (contacts) append_forces(found->frames.kept_forces(row++));
  });
  guarded("write to", [&] { flush(); });
  found.reset();
  replace_part_file(aside, part);
}

namespace {

void check(const Trajectory& header, const TrajectoryWriteOptions& options) {
  if (header.particle_type.empty()) throw ConfigError("a trajectory needs particles (0 given). Add a source");
  if (options.deflate < 0 || options.deflate > 9)
    throw ConfigError("compression level " + std::to_string(options.deflate) +
                      " does not exist (allowed 0 to 9). Use 1 for speed or 9 for size");
  if (options.contacts.size() > most_contacts)
    throw ConfigError("a trajectory cannot keep the forces on " + std::to_string(options.contacts.size()) +
                      " obstacles and walls (allowed: " + std::to_string(most_contacts) +
                      "). Join obstacles, or leave the forces out");
}

}  // namespace

TrajectoryWriter::TrajectoryWriter(const std::string& path, const Trajectory& header,
                                   const TrajectoryWriteOptions& options)
    : impl_(std::make_unique<Impl>()) {
  check(header, options);
  impl_->path = path;
  impl_->part = path + ".part";
  impl_->options = options;
  impl_->particles = header.particle_count();
  impl_->start_new_file(header);
}

TrajectoryWriter::TrajectoryWriter(const std::string& path, const Trajectory& header,
                                   const TrajectoryWriteOptions& options, const TrajectoryCheckpoint& checkpoint)
    : impl_(std::make_unique<Impl>()) {
  check(header, options);
  GRAUPEL_ASSERT(!checkpoint.recent.empty());
  impl_->path = path;
  impl_->part = path + ".part";
  impl_->options = options;
  impl_->particles = header.particle_count();
  impl_->continue_from(header, checkpoint);
}

TrajectoryWriter::~TrajectoryWriter() {
  const auto hold = hdf5::library_lock();
  impl_.reset();
}

void TrajectoryWriter::append(const ParticleFrame& frame) { impl_->append(frame); }

void TrajectoryWriter::append_forces(const std::vector<ContactForce>& forces) {
  GRAUPEL_ASSERT(!impl_->closed && impl_->contacts);
  impl_->append_forces(forces);
}

const std::vector<ParticleFrame>& TrajectoryWriter::checkpoint() {
  GRAUPEL_ASSERT(!impl_->closed);
  impl_->guarded("write to", [&] { impl_->flush(); });
  sync_file(impl_->part);
  return impl_->pending;
}

void TrajectoryWriter::attribute(const std::string& name, const std::string& value) {
  GRAUPEL_ASSERT(!impl_->closed);
  impl_->guarded("write to", [&] { hdf5::write_attribute(impl_->group, name, value); });
}

void TrajectoryWriter::parameters(const std::vector<NamedValue>& values) {
  GRAUPEL_ASSERT(!impl_->closed);
  impl_->guarded("write to", [&] { write_parameters(impl_->group, values); });
}

void TrajectoryWriter::table(const FrameTable& table) {
  GRAUPEL_ASSERT(!impl_->closed && table.columns > 0);
  const auto columns = static_cast<hsize_t>(table.columns);
  impl_->guarded("write to", [&] {
    const hdf5::Handle dataset = hdf5::create_dataset(impl_->group, table.name,
                                                      {.element = hdf5::Element::float32,
                                                       .size = {table.values.size() / columns, columns},
                                                       .units = table.units,
                                                       .description = table.description});
    hdf5::write_all(dataset, hdf5::Element::float32, table.values.data());
  });
}

void TrajectoryWriter::leave() {
  GRAUPEL_ASSERT(!impl_->closed);
  const auto chunks = impl_->filter_pending();
  impl_->guarded("write to", [&] {
    impl_->write_pending(chunks);
    impl_->flush();
  });
  impl_->closed = true;
}

void TrajectoryWriter::finish(int64_t diverged_at_frame) {
  GRAUPEL_ASSERT(!impl_->closed);
  impl_->close_all(diverged_at_frame);
  impl_->closed = true;
}

}  // namespace graupel::io
