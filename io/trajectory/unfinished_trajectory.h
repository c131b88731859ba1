// The file of one trajectory, finished or left by a killed run, opened with as little trust as possible.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "io/hdf5/hdf5_dataset.h"
#include "io/trajectory/contact_datasets.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::io {

class UnfinishedTrajectory {
 public:
  /// Throws hdf5::Failure.
  explicit UnfinishedTrajectory(const std::string& file);

  hsize_t row_count() const { return position_.size[0]; }
  /// Times of the rows up to the first that the file lacks, whatever its checksums say.
  std::vector<double> times() const;
  /// Velocities in the first frame; empty when not stored.
  std::vector<Vec3f> initial_velocity() const;
  /// Without frames.
  Trajectory header() const;
  /// Which datasets it has.
  TrajectoryWriteOptions contents() const;
  /// The frame at `row`, or nothing when a chunk is missing or fails its checksum, or forces are missing. The first one
  /// has velocities where only these are stored.
  std::optional<ParticleFrame> read(hsize_t row) const;
  /// Forces at `row`, of a file whose contents() has contacts; zeros where they are missing.
  FrameForces contact_forces(hsize_t row) const;
  /// The same; throws InputError where they are missing.
  FrameForces kept_forces(hsize_t row) const;
  /// Text attributes of the trajectory, without those of its parameters.
  std::map<std::string, std::string> attributes() const;
  std::vector<NamedValue> parameters() const;

 private:
  bool has_chunks(hsize_t row) const;

  uint64_t size_;
  hdf5::Handle file_, group_;
  hdf5::Dataset position_, time_;
  std::optional<hdf5::Dataset> velocity_, active_;
  std::map<ParticleField, hdf5::Dataset> fields_;
  std::optional<ContactDatasets> contacts_;
};

/// Calls `use(frame)` with each frame up to the first that is not usable; returns their number.
template <typename Use>
int64_t for_usable_frames(const UnfinishedTrajectory& trajectory, Use&& use) {
  double previous = -std::numeric_limits<double>::infinity();
  int64_t count = 0;
  for (hsize_t row = 0; row < trajectory.row_count(); ++row, ++count) {
    const auto frame = trajectory.read(row);
    if (!frame || !(frame->time > previous)) break;  // times that were not written yet are 0
    previous = frame->time;
    use(*frame);
  }
  return count;
}

}  // namespace graupel::io
