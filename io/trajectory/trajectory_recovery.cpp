// Recovers what a killed writer left, and merges finished trajectories into data sets.
#include <filesystem>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/file_lock.h"
#include "core/system/unfinished_file.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/hdf5/output_driver.h"
#include "io/hdf5/superblock.h"
#include "io/trajectory/part_file.h"
#include "io/trajectory/recovered_file.h"
#include "io/trajectory/trajectory_file.h"
#include "io/trajectory/trajectory_layout.h"
#include "io/trajectory/unfinished_trajectory.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

/// Writes the usable frames to a new file.
void write_usable(const UnfinishedTrajectory& part, const std::string& path) {
  TrajectoryWriter writer(path, part.header(), part.contents());
  for (const auto& [name, value] : part.attributes())
    if (name != "scene_json" && name != "made_by") writer.attribute(name, value);
  writer.parameters(part.parameters());
  writer.attribute("recovered", "1");
  const bool has_forces = !part.contents().contacts.empty();
  hsize_t row = 0;
  for_usable_frames(part, [&](const ParticleFrame& frame) {
    writer.append(frame);
    if (has_forces) writer.append_forces(part.contact_forces(row++));
  });
  writer.finish();
}

/// The same; where that fails, the frames are still in the part file and nothing of the new one stays.
void rewrite(const UnfinishedTrajectory& part, const std::string& path) {
  UnfinishedFile aside(path + ".part");
  write_usable(part, path);
  aside.keep();
}

/// The part file; where the disk lost its end (the power failed, say), a copy that says that it ends where it does.
class ReadablePart {
 public:
  explicit ReadablePart(const std::string& part) : file_(part) {
    const uint64_t size = fs::file_size(part);
    if (hdf5::stated_end(part).value_or(0) <= size) return;
    file_ = copy_ = part + ".cut";
    std::error_code code;
    fs::copy_file(part, copy_, fs::copy_options::overwrite_existing, code);
    if (code) {
      remove_path(copy_);
      throw IoError("cannot copy '" + part + "', whose end is lost, to '" + copy_ + "' (" + code.message() +
                    "). Free space on that disk, or move the file to another");
    }
    hdf5::state_end(copy_, size);
  }
  ~ReadablePart() {
    if (!copy_.empty()) remove_path(copy_);
  }
  ReadablePart(const ReadablePart&) = delete;
  ReadablePart& operator=(const ReadablePart&) = delete;
  const std::string& file() const { return file_; }

 private:
  std::string file_, copy_;
};

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

void write_merged(hid_t out, const std::vector<std::string>& parts) {
  hdf5::write_attribute(out, "format", trajectory_format);
  hdf5::write_attribute(out, "format_version", trajectory_format_version);
  hdf5::write_attribute(out, "complete", int64_t(0));
  for (std::size_t i = 0; i < parts.size(); ++i) {
    merge_into(out, parts[i], static_cast<int64_t>(i));
    hdf5::check_written(out);
  }
  hdf5::check(H5Fflush(out, H5F_SCOPE_LOCAL), "cannot flush");
  hdf5::write_attribute(out, "complete", int64_t(1));
  hdf5::check(H5Fflush(out, H5F_SCOPE_LOCAL), "cannot flush");
  hdf5::check_written(out);
}

/// `whole`: the file to make; "": none, the frames are counted.
int64_t recover(const std::string& path, const std::string& whole) {
  const std::string part_path = path + ".part";
  if (!fs::is_regular_file(part_path))
    throw InputError("there is no '" + part_path + "' to recover. Name the file the killed run was to write");
  const auto hold = FileLock::attempt(part_path, LockKind::shared);
  if (!hold)
    throw InputError("'" + part_path + "' is still being written by another run. Wait until it ends, or stop it");
  int64_t usable = 0;
  if (fs::file_size(part_path) == 0) return 0;  // killed before the first flush
  try {
    const ReadablePart readable(part_path);
    const UnfinishedTrajectory part(readable.file());
    usable = for_usable_frames(part, [](const ParticleFrame&) {});
    if (usable == 0 || whole.empty()) return usable;
    rewrite(part, whole + ".recovered");
  } catch (const hdf5::Failure& failure) {
    throw InputError("cannot recover '" + part_path + "' (" + failure.what() +
                     "). It is damaged or of another kind; run it again");
  }
  replace_file(whole + ".recovered", whole);
  if (whole == path) remove_path(part_path);
  return usable;
}

}  // namespace

int64_t recover_part_file(const std::string& path, bool finish) { return recover(path, finish ? path : ""); }

int64_t recover_part_file_to(const std::string& path, const std::string& destination) {
  return recover(path, destination);
}

void merge_trajectories(const std::vector<std::string>& parts, const std::string& path) {
  if (parts.empty()) throw InputError("there are no trajectories to merge into '" + path + "'. Make some first");
  uint64_t bytes = 0;
  for (const auto& part : parts) {
    std::error_code code;
    const uint64_t size = fs::file_size(part, code);
    if (!code) bytes += size;
  }
  hdf5::Handle out;
  try {
    out = create_part_file(path + ".part");
    UnfinishedFile part(path + ".part");  // of no use to anyone: the trajectories are all there
    write_merged(out, parts);
    finish_part_file(out, path);
    part.keep();
  } catch (const hdf5::Failure& failure) {
    throw IoError("cannot merge " + std::to_string(parts.size()) + " trajectories into '" + path + "' (" +
                  std::to_string(bytes) + " bytes needed; " + failure.what() +
                  "). Free space on that disk or choose another folder");
  }
}

}  // namespace graupel::io
