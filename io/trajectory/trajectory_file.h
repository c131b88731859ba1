// Trajectories and data sets in HDF5, readable by h5py and in the LagrangeBench layout:
//   /00000/position f32 [T, N, 3], /00000/particle_type i32 [N], /00000/velocity f32 [T, N, 3] (optional),
//   /00000/initial_velocity f32 [N, 3], /00000/time f64 [T], /00000/active u8 [T, N] (only where particles come or go;
//   0: not in the run in that frame), /00000/material i32 [N] (only where two materials are of one law;
//   io/trajectory/material_dataset.h), fields that were asked for (core/scene/particle_fields.h), forces that were
//   asked for (io/trajectory/contact_datasets.h); attributes: units, scene_json, seed, version, complete.
//   docs/reference/file_formats.md describes it for users.
// Written as <path>.part, flushed every few frames, synced and renamed, complete=1 last.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/scene/contact_force.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"

namespace graupel::io {

/// Obstacles and walls of which one file keeps the forces: their names are one attribute, of 64 KiB at most.
inline constexpr std::size_t most_contacts = 2048;

struct TrajectoryWriteOptions {
  bool velocity = true;  ///< store every frame's velocity
  bool active = false;   ///< store which particles are in the run in every frame
  FieldSet fields = {};  ///< store these of every frame
  /// contact_names() of the obstacles and walls whose forces are stored; at most most_contacts, empty for none.
  std::vector<std::string> contacts = {};
  int deflate = 1;      ///< 0..9
  int flush_every = 8;  ///< frames between flushes
  int group = 0;        ///< number of the trajectory in the file, "/00000"
};

/// A parameter that tells a trajectory from the others of its data set.
struct NamedValue {
  std::string name, unit;
  double value = 0;
  std::vector<std::string> keys = {};  ///< of the scene that follow it, as dotted paths; the first has its value
  bool operator==(const NamedValue&) const = default;
};

/// Values of every frame that are not of particles.
struct FrameTable {
  std::string name, units, description;
  int columns = 1;
  std::vector<float> values;  ///< [frames, columns]
};

/// Bytes of one particle in one frame, before compression.
int64_t particle_frame_bytes(const TrajectoryWriteOptions& options);

/// Where an interrupted run goes on.
struct TrajectoryCheckpoint {
  int64_t frame = 0;                  ///< number of the last frame to keep
  std::vector<ParticleFrame> recent;  ///< the last ones up to and with it, as TrajectoryWriter::checkpoint() gave them
};

/// Streams one trajectory to a file. Several threads may each have a writer: they compress at once. A destructor
/// without finish() leaves the .part file with every flushed frame.
class TrajectoryWriter {
 public:
  /// Throws IoError also when another run writes the same path. `header` gives particle_type, frame_time, scene_json,
  /// seed, made_by (its frames are ignored).
  TrajectoryWriter(const std::string& path, const Trajectory& header, const TrajectoryWriteOptions& options = {});
  /// Continues the trajectory of an interrupted run: `path`.part or else `path` holds its frames, which are kept up to
  /// the checkpoint's. Where neither is there, a new trajectory begins with that frame. Throws InputError when the file
  /// is of another run, has other datasets, or lacks frames (naming them); it then stays as it was.
  TrajectoryWriter(const std::string& path, const Trajectory& header, const TrajectoryWriteOptions& options,
                   const TrajectoryCheckpoint& checkpoint);
  ~TrajectoryWriter();
  /// Throws IoError (disk full: bytes needed and where).
  /// Throws ConfigError for a frame that is not later than the one before.
  void append(const ParticleFrame& frame);
  /// Adds the forces of the frame that append() added last, in the order of TrajectoryWriteOptions::contacts.
  void append_forces(const std::vector<ContactForce>& forces);
  /// Makes what is written safe on the disk; returns the last frames, which are not written yet. With these a run can
  /// be continued from here, however it ends.
  const std::vector<ParticleFrame>& checkpoint();
  /// Adds an attribute to the trajectory's group.
  void attribute(const std::string& name, const std::string& value);
  /// Stores the parameters of the run, once.
  void parameters(const std::vector<NamedValue>& values);
  /// Adds a dataset to the trajectory's group, once for a name.
  void table(const FrameTable& table);
  /// Writes all frames so far: they stay in the .part file, to be recovered. Nothing may follow. Throws IoError.
  void leave();
  /// Flush, complete=1, close, fsync, rename.
  void finish(int64_t diverged_at_frame = -1);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A trajectory or data-set file of ours, or one in the LagrangeBench layout. HDF5 plugins, external links and external
/// storage are refused. Throws InputError for a damaged, truncated or foreign file. One reader serves one thread at a
/// time.
class TrajectoryReader {
 public:
  explicit TrajectoryReader(const std::string& path);
  ~TrajectoryReader();
  TrajectoryReader(TrajectoryReader&&) noexcept;
  int count() const;  ///< trajectories in the file
  bool complete() const;
  /// Header of trajectory i: everything but the frames' contents; `frames` has the right length with times only.
  Trajectory header(int i) const;
  /// Fields that trajectory i stores.
  FieldSet fields(int i) const;
  /// Frames [first, first + count) of trajectory i; velocity and active from the file, or empty; of the fields those
  /// that are `wanted` and stored.
  std::vector<ParticleFrame> frames(int i, int64_t first, int64_t count, FieldSet wanted = {}) const;
  /// One quantity of frames [first, first + count) alone, [count, particles, components]; all threads expand it. Throws
  /// InputError when it is not stored.
  std::vector<float> positions(int i, int64_t first, int64_t count) const;
  void positions(int i, int64_t first, int64_t count, std::span<float> out) const;  ///< the same, into a buffer
  std::vector<float> velocities(int i, int64_t first, int64_t count) const;
  std::vector<float> values(int i, ParticleField field, int64_t first, int64_t count) const;
  std::vector<Vec3f> initial_velocity(int i) const;  ///< empty when not stored
  std::vector<uint8_t> active(int i) const;          ///< of all frames [frames, n]; empty when not stored
  /// Of frames [first, first + count) [count, n]; empty when not stored.
  std::vector<uint8_t> active(int i, int64_t first, int64_t count) const;
  Trajectory read(int i, FieldSet wanted = {}) const;           ///< whole trajectory
  std::string attribute(int i, const std::string& name) const;  ///< "" when absent
  /// Obstacles and walls whose forces trajectory i stores; empty for none.
  std::vector<std::string> contact_names(int i) const;
  /// Their forces [frames, names]: what the matter did to each in the time before each frame, nothing in the first.
  std::vector<std::vector<ContactForce>> contact_forces(int i) const;
  std::vector<NamedValue> parameters(int i) const;  ///< of the run, in the recipe's order; empty for none

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Recovers `path`.part after a kill: keeps the frames whose checksums pass, returns their number (0: nothing usable).
/// With `finish`, completes and renames the file; its trajectory then has the attribute recovered = "1". Throws
/// InputError, with the cause, for a file that another run still writes or that cannot be read.
int64_t recover_part_file(const std::string& path, bool finish);

/// Merges single-trajectory files into one data-set file with groups /00000.. in the given order (raw chunk copy).
void merge_trajectories(const std::vector<std::string>& parts, const std::string& path);

/// metadata.json of a data set (GNS/LagrangeBench keys: bounds, sequence_length, default_connectivity_radius, dim, dt,
/// vel_mean/std, acc_mean/std, num_particles_max ...). Statistics over all particles and frames of the training file,
/// the same for any number of threads.
void write_data_set_metadata(const std::string& folder, const Scene& any_scene, double connectivity_radius);

}  // namespace graupel::io
