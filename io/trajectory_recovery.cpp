// Recovers what a killed writer left, and merges finished trajectories into data sets.
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/file_lock.h"
#include "io/hdf5_dataset.h"
#include "io/part_file.h"
#include "io/trajectory_file.h"
#include "io/trajectory_layout.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

/// The unfinished file of one trajectory, opened with as little trust as possible.
struct PartFile {
  hdf5::Handle file, group;
  hdf5::Dataset position, time;
  std::optional<hdf5::Dataset> velocity, active;
};

PartFile open_part(const std::string& part) {
  PartFile out;
  const uint64_t size = fs::file_size(part);
  out.file = hdf5::open_file(part);
  const auto names = hdf5::member_names(out.file);
  if (names.size() != 1) throw hdf5::Failure("it does not hold one trajectory");
  out.group = hdf5::Handle(H5Gopen2(out.file, names[0].c_str(), H5P_DEFAULT), H5Gclose, "cannot open a group");
  out.position = hdf5::open_dataset(out.group, "position", 3, hdf5::NumberKind::real, size);
  out.time = hdf5::open_dataset(out.group, "time", 1, hdf5::NumberKind::real, size);
  if (hdf5::has_member(out.group, "velocity"))
    out.velocity = hdf5::open_dataset(out.group, "velocity", 3, hdf5::NumberKind::real, size);
  if (hdf5::has_member(out.group, "active"))
    out.active = hdf5::open_dataset(out.group, "active", 2, hdf5::NumberKind::integer, size);
  return out;
}

/// The frame at `row`, or nothing when a chunk is missing or fails its checksum.
std::optional<ParticleFrame> read_frame(const PartFile& part, hsize_t row) {
  ParticleFrame frame;
  frame.position.resize(part.position.size[1]);
  const auto usable = [&](const hdf5::Dataset& dataset) { return row < dataset.size[0] && dataset.has_chunks(row); };
  if (!usable(part.position) || !usable(part.time) || (part.velocity && !usable(*part.velocity)) ||
      (part.active && !usable(*part.active)))
    return std::nullopt;
  try {
    part.position.read_rows(row, 1, hdf5::Element::float32, frame.position.data());
    part.time.read_rows(row, 1, hdf5::Element::float64, &frame.time);
    if (part.velocity) {
      frame.velocity.resize(part.velocity->size[1]);
      part.velocity->read_rows(row, 1, hdf5::Element::float32, frame.velocity.data());
    }
    if (part.active) {
      frame.active.resize(part.active->size[1]);
      part.active->read_rows(row, 1, hdf5::Element::uint8, frame.active.data());
    }
  } catch (const hdf5::Failure&) {
    return std::nullopt;
  }
  return frame;
}

/// Calls `use` with each frame up to the first that is not usable; returns their number.
template <typename Use>
int64_t for_usable_frames(const PartFile& part, Use&& use) {
  double previous = -std::numeric_limits<double>::infinity();
  int64_t count = 0;
  for (hsize_t row = 0; row < part.position.size[0]; ++row, ++count) {
    const auto frame = read_frame(part, row);
    if (!frame || !(frame->time > previous)) break;  // times that were not written yet are 0
    previous = frame->time;
    use(*frame);
  }
  return count;
}

Trajectory part_header(const PartFile& part, const std::string& path) {
  Trajectory header;
  const auto types =
      hdf5::open_dataset(part.group, "particle_type", 1, hdf5::NumberKind::integer, fs::file_size(path + ".part"));
  if (types.size[0] != part.position.size[1] || part.position.size[2] != 3 ||
      (part.velocity && (part.velocity->size[1] != types.size[0] || part.velocity->size[2] != 3)) ||
      (part.active && part.active->size[1] != types.size[0]))
    throw hdf5::Failure("its datasets have different sizes");
  header.particle_type.resize(types.size[0]);
  types.read_rows(0, types.size[0], hdf5::Element::int32, header.particle_type.data());
  header.frame_time = hdf5::real_attribute(part.group, "frame_time").value_or(header.frame_time);
  header.scene_json = hdf5::string_attribute(part.group, "scene_json").value_or("");
  header.seed = hdf5::natural_attribute(part.group, "seed").value_or(0);
  header.made_by = hdf5::string_attribute(part.group, "made_by").value_or("");
  return header;
}

/// Writes the usable frames to a new file, which takes the place of `path`.
void rewrite(const PartFile& part, const std::string& path) {
  const std::string aside = path + ".recovered";
  TrajectoryWriteOptions options;
  options.velocity = part.velocity.has_value();
  options.active = part.active.has_value();
  TrajectoryWriter writer(aside, part_header(part, path), options);
  for (const std::string& name : hdf5::attribute_names(part.group))
    if (name != "scene_json" && name != "made_by")
      if (const auto value = hdf5::string_attribute(part.group, name)) writer.attribute(name, *value);
  writer.attribute("recovered", "1");
  for_usable_frames(part, [&](const ParticleFrame& frame) { writer.append(frame); });
  writer.finish();
}

void merge_into(hid_t out, const std::string& part, int64_t number) {
  const TrajectoryReader reader(part);
  if (!reader.complete())
    throw InputError("'" + part + "' is not complete. Make it again, or recover it, before merging");
  if (reader.count() != 1)
    throw InputError("'" + part + "' has " + std::to_string(reader.count()) +
                     " trajectories (1 expected). Merge single "
                     "trajectories");
  hdf5::Handle file;
  std::string name;
  try {
    file = hdf5::open_file(part);
    name = hdf5::member_names(file).front();
  } catch (const hdf5::Failure& failure) {
    throw InputError("cannot read '" + part + "' (" + failure.what() + "). Make it again");
  }
  hdf5::check(H5Ocopy(file, name.c_str(), out, trajectory_group(number).c_str(), H5P_DEFAULT, H5P_DEFAULT),
              ("cannot copy '" + part + "'").c_str());
}

}  // namespace

int64_t recover_part_file(const std::string& path, bool finish) {
  const std::string part_path = path + ".part";
  if (!fs::is_regular_file(part_path))
    throw InputError("there is no '" + part_path + "' to recover. Name the file the killed run was to write");
  const auto hold = FileLock::attempt(part_path, LockKind::shared);
  if (!hold)
    throw InputError("'" + part_path + "' is still being written by another run. Wait until it ends, or stop it");
  int64_t usable = 0;
  if (fs::file_size(part_path) == 0) return 0;  // killed before the first flush
  try {
    PartFile part = open_part(part_path);
    usable = for_usable_frames(part, [](const ParticleFrame&) {});
    if (usable == 0 || !finish) return usable;
    rewrite(part, path);
  } catch (const hdf5::Failure& failure) {
    throw InputError("cannot recover '" + part_path + "' (" + failure.what() +
                     "). It is damaged or of another kind; run it again");
  }
  fs::rename(path + ".recovered", path);
  fs::remove(part_path);
  return usable;
}

void merge_trajectories(const std::vector<std::string>& parts, const std::string& path) {
  if (parts.empty()) throw InputError("there are no trajectories to merge into '" + path + "'. Make some first");
  uint64_t bytes = 0;
  for (const auto& part : parts) {
    std::error_code code;
    const uint64_t size = fs::file_size(part, code);
    if (!code) bytes += size;
  }
  try {
    hdf5::Handle out = create_part_file(path + ".part");
    hdf5::write_attribute(out, "format", trajectory_format);
    hdf5::write_attribute(out, "format_version", trajectory_format_version);
    hdf5::write_attribute(out, "complete", int64_t(0));
    for (std::size_t i = 0; i < parts.size(); ++i) merge_into(out, parts[i], static_cast<int64_t>(i));
    hdf5::check(H5Fflush(out, H5F_SCOPE_LOCAL), "cannot flush");
    hdf5::write_attribute(out, "complete", int64_t(1));
    hdf5::check(H5Fflush(out, H5F_SCOPE_LOCAL), "cannot flush");
    finish_part_file(out, path);
  } catch (const hdf5::Failure& failure) {
    throw IoError("cannot merge " + std::to_string(parts.size()) + " trajectories into '" + path + "' (" +
                  std::to_string(bytes) + " bytes needed; " + failure.what() +
                  "). Free space on that disk or choose another folder");
  }
}

}  // namespace graupel::io
