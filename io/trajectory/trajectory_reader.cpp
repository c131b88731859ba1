// Reads trajectories and data sets, and distrusts every number in the file.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/config/json_node.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/trajectory/contact_datasets.h"
#include "io/trajectory/field_datasets.h"
#include "io/trajectory/material_dataset.h"
#include "io/trajectory/run_parameters.h"
#include "io/trajectory/trajectory_file.h"
#include "io/trajectory/trajectory_layout.h"

namespace graupel::io {

namespace {

constexpr double default_frame_time = 1.0 / 60;

/// The trajectory that was read last stays open, with its cache of chunks.
struct OpenTrajectory {
  int number = -1;
  hdf5::Handle group;
  hdf5::Dataset position;
  std::optional<hdf5::Dataset> velocity, active;
  std::map<ParticleField, hdf5::Dataset> fields;
  std::vector<double> times;
};

/// dt * write_every of the metadata.json beside a data set of another program.
std::optional<double> metadata_frame_time(const std::string& path) {
  const auto metadata = std::filesystem::absolute(path).parent_path() / "metadata.json";
  if (!std::filesystem::is_regular_file(metadata)) return std::nullopt;
  JsonNode root;
  try {
    root = parse_json(read_file(metadata.string(), std::size_t(16) << 20), metadata.string());
  } catch (const Error& error) {
    throw InputError(error.what());
  }
  const JsonNode* dt = root.find("dt");
  if (!dt || !dt->is_number() || !(dt->as_double() > 0)) return std::nullopt;
  const JsonNode* every = root.find("write_every");
  return dt->as_double() * (every && every->is_number() && every->as_double() >= 1 ? every->as_double() : 1);
}

/// What to do where `path` is not there: data of GNS (.npz) are converted first.
std::string remedy_for_missing(const std::string& path) {
  const std::filesystem::path archive = std::filesystem::path(path).replace_extension(".npz");
  if (!std::filesystem::exists(archive)) return "Give a trajectory or data-set file (.h5)";
  const std::string folder = std::filesystem::absolute(archive).parent_path().string();
  return "'" + archive.string() + "' is of geoelements/gns: convert it first, by graupel convert " + folder +
         " OUT --set gravity=[0,-9.8,0]";
}

}  // namespace

struct TrajectoryReader::Impl {
  std::string path;
  uint64_t file_size = 0;
  hdf5::Handle file;
  std::vector<std::string> groups;
  std::optional<double> metadata_time;
  mutable OpenTrajectory current;

  void open();
  const OpenTrajectory& trajectory(int i) const;
  void open_trajectory(int i) const;
  bool is_whole() const;
  void check_whole(hdf5::Dataset& dataset, const std::string& name) const;
  double frame_time(hid_t group) const;
  std::vector<double> read_times(hid_t group, hsize_t frames) const;
  Trajectory header(int i) const;
  std::vector<ParticleFrame> frames(int i, int64_t first, int64_t count, FieldSet wanted) const;
  std::vector<float> rows(const hdf5::Dataset& dataset, int components, int64_t first, int64_t count) const;
  void rows(const hdf5::Dataset& dataset, int components, int64_t first, int64_t count, std::span<float> out) const;

  /// Runs HDF5 calls; a failure becomes an InputError.
  template <typename Body>
  auto guarded(Body&& body) const {
    try {
      return body();
    } catch (const hdf5::Failure& failure) {
      throw InputError("cannot read '" + path + "' (" + failure.what() +
                       "). The file is damaged, cut short or of another kind; make it again or choose another");
    }
  }
  /// The same for trajectory i, which errors name in files of several.
  template <typename Body>
  auto guarded(int i, Body&& body) const {
    return guarded([&] {
      try {
        return body();
      } catch (const hdf5::Failure& failure) {
        if (groups.size() == 1) throw;
        throw hdf5::Failure("trajectory " + std::to_string(i) + ": " + failure.what());
      }
    });
  }
};

void TrajectoryReader::Impl::open() {
  file = hdf5::open_file(path);
  if (const auto format = hdf5::string_attribute(file, "format"); format && *format != trajectory_format)
    throw hdf5::Failure("its format is '" + format->substr(0, 60) + "', not '" + trajectory_format + "'");
  const int64_t version = hdf5::integer_attribute(file, "format_version").value_or(trajectory_format_version);
  if (version > trajectory_format_version)
    throw hdf5::Failure("its format version " + std::to_string(version) + " is newer than this program's " +
                        std::to_string(trajectory_format_version));
  for (const std::string& name : hdf5::member_names(file)) {
    H5O_info_t info;
    hdf5::check(H5Oget_info_by_name2(file, name.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT), "cannot read a member");
    if (info.type != H5O_TYPE_GROUP) continue;
    const hdf5::Handle group(H5Gopen2(file, name.c_str(), H5P_DEFAULT), H5Gclose, "cannot open a group");
    if (hdf5::has_member(group, "position")) groups.push_back(name);
  }
  if (groups.empty()) throw hdf5::Failure("there is no trajectory in it (no group with 'position')");
  metadata_time = metadata_frame_time(path);
}

double TrajectoryReader::Impl::frame_time(hid_t group) const {
  const double value = hdf5::real_attribute(group, "frame_time").value_or(metadata_time.value_or(default_frame_time));
  if (!(value > 0) || value > 1e6) throw hdf5::Failure("its frame_time is not a time (" + std::to_string(value) + ")");
  return value;
}

std::vector<double> TrajectoryReader::Impl::read_times(hid_t group, hsize_t frames) const {
  std::vector<double> times(frames);
  if (!hdf5::has_member(group, "time")) {
    for (hsize_t k = 0; k < frames; ++k) times[k] = static_cast<double>(k) * frame_time(group);
    return times;
  }
  hdf5::Dataset dataset = hdf5::open_dataset(group, "time", 1, hdf5::NumberKind::real, file_size);
  check_whole(dataset, "time");
  if (dataset.size[0] != frames) throw hdf5::Failure("'time' and 'position' have different numbers of frames");
  if (frames > 0) dataset.read_rows(0, frames, hdf5::Element::float64, times.data());
  for (hsize_t k = 0; k < frames; ++k)
    if (!std::isfinite(times[k]) || (k > 0 && times[k] < times[k - 1]))
      throw hdf5::Failure("the time of frame " + std::to_string(k) + " is " + std::to_string(times[k]) +
                          " s (allowed: finite, not before that of the frame before)");
  return times;
}

/// Files of other programs do not say; what can be opened counts as whole.
bool TrajectoryReader::Impl::is_whole() const { return hdf5::integer_attribute(file, "complete").value_or(1) == 1; }

/// Of a file that says that it is whole.
void TrajectoryReader::Impl::check_whole(hdf5::Dataset& dataset, const std::string& name) const {
  if (!is_whole()) return;
  if (const hsize_t missing = dataset.missing_chunks(); missing > 0)
    throw hdf5::Failure(std::to_string(missing) + " chunks of '" + name + "' are missing");
  dataset.is_whole = true;
}

void TrajectoryReader::Impl::open_trajectory(int i) const {
  OpenTrajectory next;
  next.number = i;
  next.group = hdf5::Handle(H5Gopen2(file, groups[static_cast<std::size_t>(i)].c_str(), H5P_DEFAULT), H5Gclose,
                            "cannot open a group");
  next.position = hdf5::open_dataset(next.group, "position", 3, hdf5::NumberKind::real, file_size);
  check_whole(next.position, "position");
  const auto& size = next.position.size;
  if (size[2] != 2 && size[2] != 3) throw hdf5::Failure("'position' is not 2- or 3-dimensional");
  if (size[0] > (hsize_t(1) << 31) || size[1] == 0 || size[1] > (hsize_t(1) << 31))
    throw hdf5::Failure("'position' has a number of frames or particles that is not believable");
  if (hdf5::has_member(next.group, "velocity")) {
    next.velocity = hdf5::open_dataset(next.group, "velocity", 3, hdf5::NumberKind::real, file_size);
    check_whole(*next.velocity, "velocity");
    if (next.velocity->size != size) throw hdf5::Failure("'velocity' and 'position' have different sizes");
  }
  if (hdf5::has_member(next.group, "active")) {
    next.active = hdf5::open_dataset(next.group, "active", 2, hdf5::NumberKind::integer, file_size);
    check_whole(*next.active, "active");
    if (next.active->size != std::vector<hsize_t>{size[0], size[1]})
      throw hdf5::Failure("'active' and 'position' have different sizes");
  }
  next.fields = open_field_datasets(next.group, size[1], file_size);
  for (auto& [field, dataset] : next.fields) {
    const std::string name = info_of(field).name;
    if (dataset.size[0] != size[0]) throw hdf5::Failure("'" + name + "' and 'position' have different sizes");
    check_whole(dataset, name);
  }
  next.times = read_times(next.group, size[0]);
  current = std::move(next);
}

const OpenTrajectory& TrajectoryReader::Impl::trajectory(int i) const {
  if (i < 0 || i >= static_cast<int>(groups.size()))
    throw ConfigError("'" + path + "' has no trajectory " + std::to_string(i) + " (allowed: 0 to " +
                      std::to_string(groups.size() - 1) + "). Ask for one of them");
  if (current.number != i) open_trajectory(i);
  return current;
}

Trajectory TrajectoryReader::Impl::header(int i) const {
  const OpenTrajectory& open = trajectory(i);
  Trajectory out;
  auto types = hdf5::open_dataset(open.group, "particle_type", 1, hdf5::NumberKind::integer, file_size);
  check_whole(types, "particle_type");
  if (types.size[0] != open.position.size[1])
    throw hdf5::Failure("'particle_type' and 'position' have different numbers of particles");
  out.particle_type.resize(types.size[0]);
  types.read_rows(0, types.size[0], hdf5::Element::int32, out.particle_type.data());
  out.materials = read_materials(open.group, out.particle_type, file_size, is_whole());
  out.frame_time = frame_time(open.group);
  out.scene_json = hdf5::string_attribute(open.group, "scene_json").value_or("");
  out.seed = hdf5::natural_attribute(open.group, "seed").value_or(0);
  out.made_by = hdf5::string_attribute(open.group, "made_by").value_or("");
  out.diverged_at_frame = hdf5::integer_attribute(open.group, "diverged_at_frame").value_or(-1);
  out.frames.resize(open.times.size());
  for (std::size_t k = 0; k < open.times.size(); ++k) out.frames[k].time = open.times[k];
  return out;
}

std::vector<ParticleFrame> TrajectoryReader::Impl::frames(int i, int64_t first, int64_t count, FieldSet wanted) const {
  const OpenTrajectory& open = trajectory(i);
  const auto last = static_cast<int64_t>(open.times.size());
  if (first < 0 || count < 0 || first > last - count)
    throw ConfigError("'" + path + "' has no " + std::to_string(count) + " frames from " + std::to_string(first) +
                      " on (it has " + std::to_string(last) + "). Ask for those that it has");
  std::vector<ParticleFrame> out(static_cast<std::size_t>(count));
  const std::size_t particles = open.position.size[1];
  for (int64_t k = 0; k < count; ++k) {
    ParticleFrame& frame = out[static_cast<std::size_t>(k)];
    const auto row = static_cast<hsize_t>(first + k);
    frame.time = open.times[row];
    frame.position.assign(particles, Vec3f::zero());
    open.position.read_rows(row, 1, hdf5::Element::float32, frame.position.data());
    if (open.active) {
      frame.active.assign(particles, 0);
      open.active->read_rows(row, 1, hdf5::Element::uint8, frame.active.data());
    }
    for (const auto& [field, dataset] : open.fields)
      if (wanted.contains(field)) read_field_row(dataset, field, row, frame.fields);
    if (!open.velocity) continue;
    frame.velocity.assign(particles, Vec3f::zero());
    open.velocity->read_rows(row, 1, hdf5::Element::float32, frame.velocity.data());
  }
  return out;
}

std::vector<float> TrajectoryReader::Impl::rows(const hdf5::Dataset& dataset, int components, int64_t first,
                                                int64_t count) const {
  std::vector<float> out(static_cast<std::size_t>(count) * dataset.size[1] * static_cast<std::size_t>(components));
  rows(dataset, components, first, count, out);
  return out;
}

void TrajectoryReader::Impl::rows(const hdf5::Dataset& dataset, int components, int64_t first, int64_t count,
                                  std::span<float> out) const {
  GRAUPEL_ASSERT(first >= 0 && count >= 0 && first + count <= static_cast<int64_t>(dataset.size[0]));
  GRAUPEL_ASSERT(out.size() ==
                 static_cast<std::size_t>(count) * dataset.size[1] * static_cast<std::size_t>(components));
  if (count > 0)
    dataset.read_rows(static_cast<hsize_t>(first), static_cast<hsize_t>(count), hdf5::Element::float32, out.data());
}

TrajectoryReader::TrajectoryReader(const std::string& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  std::error_code code;
  impl_->file_size = std::filesystem::file_size(path, code);
  if (code) throw InputError("cannot read '" + path + "' (" + code.message() + "). " + remedy_for_missing(path));
  if (::faccessat(AT_FDCWD, path.c_str(), R_OK, AT_EACCESS) != 0 && errno == EACCES)
    throw InputError("cannot read '" + path + "' (" + std::strerror(EACCES) + "). Have its owner allow you to read it");
  impl_->guarded([&] { impl_->open(); });
}

TrajectoryReader::~TrajectoryReader() = default;
TrajectoryReader::TrajectoryReader(TrajectoryReader&&) noexcept = default;

int TrajectoryReader::count() const { return static_cast<int>(impl_->groups.size()); }

bool TrajectoryReader::complete() const {
  return impl_->guarded([&] { return impl_->is_whole(); });
}

Trajectory TrajectoryReader::header(int i) const {
  return impl_->guarded(i, [&] { return impl_->header(i); });
}

FieldSet TrajectoryReader::fields(int i) const {
  return impl_->guarded(i, [&] {
    FieldSet stored;
    for (const auto& [field, dataset] : impl_->trajectory(i).fields) stored.add(field);
    return stored;
  });
}

std::vector<ParticleFrame> TrajectoryReader::frames(int i, int64_t first, int64_t count, FieldSet wanted) const {
  return impl_->guarded(i, [&] { return impl_->frames(i, first, count, wanted); });
}

std::vector<float> TrajectoryReader::positions(int i, int64_t first, int64_t count) const {
  return impl_->guarded(i, [&] { return impl_->rows(impl_->trajectory(i).position, 3, first, count); });
}

void TrajectoryReader::positions(int i, int64_t first, int64_t count, std::span<float> out) const {
  impl_->guarded(i, [&] { impl_->rows(impl_->trajectory(i).position, 3, first, count, out); });
}

std::vector<float> TrajectoryReader::velocities(int i, int64_t first, int64_t count) const {
  return impl_->guarded(i, [&] {
    const auto& velocity = impl_->trajectory(i).velocity;
    if (!velocity) throw hdf5::Failure("it stores no velocities");
    return impl_->rows(*velocity, 3, first, count);
  });
}

std::vector<float> TrajectoryReader::values(int i, ParticleField field, int64_t first, int64_t count) const {
  return impl_->guarded(i, [&] {
    const auto& fields = impl_->trajectory(i).fields;
    const auto at = fields.find(field);
    if (at == fields.end()) throw hdf5::Failure("it lacks the field '" + std::string(info_of(field).name) + "'");
    return impl_->rows(at->second, info_of(field).components, first, count);
  });
}

std::vector<Vec3f> TrajectoryReader::initial_velocity(int i) const {
  return impl_->guarded(i, [&] {
    const OpenTrajectory& open = impl_->trajectory(i);
    std::vector<Vec3f> values;
    if (!hdf5::has_member(open.group, "initial_velocity")) return values;
    auto dataset = hdf5::open_dataset(open.group, "initial_velocity", 2, hdf5::NumberKind::real, impl_->file_size);
    impl_->check_whole(dataset, "initial_velocity");
    if (dataset.size != std::vector<hsize_t>{open.position.size[1], 3})
      throw hdf5::Failure("'initial_velocity' and 'position' have different sizes");
    values.resize(dataset.size[0]);
    dataset.read_rows(0, dataset.size[0], hdf5::Element::float32, values.data());
    for (std::size_t p = 0; p < values.size(); ++p)
      if (!std::all_of(values[p].a, values[p].a + 3, [](float x) { return std::isfinite(x); }))
        throw hdf5::Failure("'initial_velocity' of particle " + std::to_string(p) + " is not finite");
    return values;
  });
}

std::vector<uint8_t> TrajectoryReader::active(int i) const {
  return active(i, 0, impl_->guarded(i, [&] { return static_cast<int64_t>(impl_->trajectory(i).times.size()); }));
}

std::vector<uint8_t> TrajectoryReader::active(int i, int64_t first, int64_t count) const {
  return impl_->guarded(i, [&] {
    const auto& dataset = impl_->trajectory(i).active;
    std::vector<uint8_t> values;
    if (!dataset) return values;
    GRAUPEL_ASSERT(first >= 0 && count >= 0 && first + count <= static_cast<int64_t>(dataset->size[0]));
    values.resize(static_cast<std::size_t>(count) * dataset->size[1]);
    if (!values.empty())
      dataset->read_rows(static_cast<hsize_t>(first), static_cast<hsize_t>(count), hdf5::Element::uint8, values.data());
    return values;
  });
}

Trajectory TrajectoryReader::read(int i, FieldSet wanted) const {
  Trajectory out = header(i);
  out.frames = frames(i, 0, static_cast<int64_t>(out.frames.size()), wanted);
  return out;
}

std::string TrajectoryReader::attribute(int i, const std::string& name) const {
  return impl_->guarded(
      i, [&] { return hdf5::string_attribute(impl_->trajectory(i).group, name).value_or(std::string()); });
}

std::vector<std::string> TrajectoryReader::contact_names(int i) const {
  return impl_->guarded(i, [&] {
    const auto contacts = open_contact_datasets(impl_->trajectory(i).group, impl_->file_size);
    return contacts ? contacts->names : std::vector<std::string>();
  });
}

std::vector<std::vector<ContactForce>> TrajectoryReader::contact_forces(int i) const {
  return impl_->guarded(i, [&] {
    const OpenTrajectory& open = impl_->trajectory(i);
    std::vector<FrameForces> forces;
    auto contacts = open_contact_datasets(open.group, impl_->file_size);
    if (!contacts) return forces;
    if (contacts->row_count() != open.times.size())
      throw hdf5::Failure("its forces and 'position' have different numbers of frames");
    for (hdf5::Dataset& dataset : contacts->datasets) impl_->check_whole(dataset, "the forces");
    for (hsize_t row = 0; row < contacts->row_count(); ++row) forces.push_back(contacts->read(row));
    return forces;
  });
}

std::vector<NamedValue> TrajectoryReader::parameters(int i) const {
  return impl_->guarded(i, [&] { return read_parameters(impl_->trajectory(i).group); });
}

}  // namespace graupel::io
