#include "io/trajectory/unfinished_trajectory.h"

#include <algorithm>
#include <filesystem>

#include "core/system/error.h"
#include "io/trajectory/field_datasets.h"
#include "io/trajectory/material_dataset.h"
#include "io/trajectory/run_parameters.h"

namespace graupel::io {

UnfinishedTrajectory::UnfinishedTrajectory(const std::string& file) : size_(std::filesystem::file_size(file)) {
  file_ = hdf5::open_file(file);
  const auto names = hdf5::member_names(file_);
  if (names.size() != 1) throw hdf5::Failure("it does not hold one trajectory");
  group_ = hdf5::Handle(H5Gopen2(file_, names[0].c_str(), H5P_DEFAULT), H5Gclose, "cannot open a group");
  position_ = hdf5::open_dataset(group_, "position", 3, hdf5::NumberKind::real, size_);
  time_ = hdf5::open_dataset(group_, "time", 1, hdf5::NumberKind::real, size_);
  const hsize_t particles = position_.size[1];
  if (position_.size[2] != 3) throw hdf5::Failure("'position' is not 3-dimensional");
  if (hdf5::has_member(group_, "velocity"))
    velocity_ = hdf5::open_dataset(group_, "velocity", 3, hdf5::NumberKind::real, size_);
  if (hdf5::has_member(group_, "active"))
    active_ = hdf5::open_dataset(group_, "active", 2, hdf5::NumberKind::integer, size_);
  if ((velocity_ && (velocity_->size[1] != particles || velocity_->size[2] != 3)) ||
      (active_ && active_->size[1] != particles))
    throw hdf5::Failure("its datasets have different sizes");
  fields_ = open_field_datasets(group_, particles, size_);
  contacts_ = open_contact_datasets(group_, size_);
}

Trajectory UnfinishedTrajectory::header() const {
  Trajectory header;
  const auto types = hdf5::open_dataset(group_, "particle_type", 1, hdf5::NumberKind::integer, size_);
  if (types.size[0] != position_.size[1]) throw hdf5::Failure("its datasets have different sizes");
  header.particle_type.resize(types.size[0]);
  types.read_rows(0, types.size[0], hdf5::Element::int32, header.particle_type.data());
  header.materials = read_materials(group_, header.particle_type, size_, false);
  header.frame_time = hdf5::real_attribute(group_, "frame_time").value_or(header.frame_time);
  header.scene_json = hdf5::string_attribute(group_, "scene_json").value_or("");
  header.seed = hdf5::natural_attribute(group_, "seed").value_or(0);
  header.made_by = hdf5::string_attribute(group_, "made_by").value_or("");
  return header;
}

TrajectoryWriteOptions UnfinishedTrajectory::contents() const {
  TrajectoryWriteOptions options;
  options.velocity = velocity_.has_value();
  options.active = active_.has_value();
  for (const auto& [field, dataset] : fields_) options.fields.add(field);
  if (contacts_) options.contacts = contacts_->names;
  return options;
}

bool UnfinishedTrajectory::has_chunks(hsize_t row) const {
  const auto has = [&](const hdf5::Dataset& dataset) { return row < dataset.size[0] && dataset.has_chunks(row); };
  bool all = has(position_) && has(time_) && (!velocity_ || has(*velocity_)) && (!active_ || has(*active_));
  for (const auto& [field, dataset] : fields_) all = all && has(dataset);
  if (contacts_) all = all && row < contacts_->row_count();
  return all;
}

std::vector<Vec3f> UnfinishedTrajectory::initial_velocity() const {
  std::vector<Vec3f> values;
  if (!hdf5::has_member(group_, "initial_velocity")) return values;
  const auto dataset = hdf5::open_dataset(group_, "initial_velocity", 2, hdf5::NumberKind::real, size_);
  if (dataset.size != std::vector<hsize_t>{position_.size[1], 3}) return values;
  values.resize(dataset.size[0]);
  dataset.read_rows(0, dataset.size[0], hdf5::Element::float32, values.data());
  return values;
}

std::vector<double> UnfinishedTrajectory::times() const {
  std::vector<double> times(std::min(time_.size[0], row_count()));
  if (!times.empty()) time_.read_rows(0, times.size(), hdf5::Element::float64, times.data());
  for (std::size_t row = 0; row < times.size(); ++row)
    if (!has_chunks(row) || (row > 0 && !(times[row] > times[row - 1]))) times.resize(row);
  return times;
}

std::optional<ParticleFrame> UnfinishedTrajectory::read(hsize_t row) const {
  if (!has_chunks(row)) return std::nullopt;
  ParticleFrame frame;
  try {
    frame.position.resize(position_.size[1]);
    position_.read_rows(row, 1, hdf5::Element::float32, frame.position.data());
    time_.read_rows(row, 1, hdf5::Element::float64, &frame.time);
    if (velocity_) {
      frame.velocity.resize(position_.size[1]);
      velocity_->read_rows(row, 1, hdf5::Element::float32, frame.velocity.data());
    } else if (row == 0) {
      frame.velocity = initial_velocity();
    }
    if (active_) {
      frame.active.resize(position_.size[1]);
      active_->read_rows(row, 1, hdf5::Element::uint8, frame.active.data());
    }
    for (const auto& [field, dataset] : fields_) read_field_row(dataset, field, row, frame.fields);
  } catch (const hdf5::Failure&) {
    return std::nullopt;
  }
  return frame;
}

FrameForces UnfinishedTrajectory::contact_forces(hsize_t row) const {
  return row < contacts_->row_count() ? contacts_->read(row) : FrameForces(contacts_->names.size());
}

FrameForces UnfinishedTrajectory::kept_forces(hsize_t row) const {
  if (row >= contacts_->row_count())
    throw InputError("the forces of row " + std::to_string(row) +
                     " are not in the trajectory (a recovered one keeps those of its frames alone), so it cannot be "
                     "continued with forces. Name an output that is not there yet, or run the scene again");
  return contacts_->read(row);
}

std::map<std::string, std::string> UnfinishedTrajectory::attributes() const {
  std::map<std::string, std::string> found;
  for (const std::string& name : hdf5::attribute_names(group_))
    if (const auto value = hdf5::string_attribute(group_, name); value && !is_parameter_attribute(name))
      found[name] = *value;
  return found;
}

std::vector<NamedValue> UnfinishedTrajectory::parameters() const { return read_parameters(group_); }

}  // namespace graupel::io
