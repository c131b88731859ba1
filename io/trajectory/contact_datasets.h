// Datasets of the forces on obstacles and walls in a trajectory (core/scene/contact_force.h): contact_impulse [N s],
// contact_force [N], contact_torque [N m], contact_reference [m], f64 [frame, obstacle or wall, axis] each, and the
// attribute contact_names.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/contact_force.h"
#include "io/hdf5/hdf5_dataset.h"

namespace graupel::io {

/// Of one frame, in the order of contact_names.
using FrameForces = std::vector<ContactForce>;

/// Streams them. A row goes to the library at once, so that the frames that a file holds never lack theirs.
class ContactWriter {
 public:
  /// Throws hdf5::Failure as all of its members do.
  ContactWriter(hid_t group, const std::vector<std::string>& names);
  void append(const FrameForces& forces);
  hsize_t row_count() const { return rows_; }
  void close();

 private:
  std::array<hdf5::Handle, 4> datasets_;
  hsize_t surfaces_, rows_ = 0;
};

/// Those of a group.
struct ContactDatasets {
  std::vector<std::string> names;
  std::array<hdf5::Dataset, 4> datasets;

  hsize_t row_count() const;
  FrameForces read(hsize_t row) const;
};

/// Nothing where a group has none. Throws hdf5::Failure where they do not belong together.
std::optional<ContactDatasets> open_contact_datasets(hid_t group, uint64_t file_size);

}  // namespace graupel::io
