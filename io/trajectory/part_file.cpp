#include "io/trajectory/part_file.h"

#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/file_lock.h"
#include "io/hdf5/output_driver.h"

namespace graupel::io {

namespace {

ino_t number_of(const std::string& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 ? status.st_ino : 0;
}

off_t size_of(const std::string& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 ? status.st_size : -1;
}

FileLock lock_part_file(const std::string& part) {
  auto hold = FileLock::attempt(part, LockKind::exclusive);
  if (!hold)
    throw IoError("another run is writing or recovering '" + part + "'. Choose another output, or wait until it ends");
  return std::move(*hold);
}

void rename_to(UnfinishedFile& aside, const std::string& part) {
  if (std::rename(aside.path().c_str(), part.c_str()) != 0)
    throw IoError("cannot create '" + part + "' (" + std::strerror(errno) + "). Choose a folder you may write to");
  aside.keep();
}

}  // namespace

/// H5Fcreate cuts a file before it asks for its lock. So the new file is made under a name of its own, where HDF5 locks
/// it undisturbed, and takes the place of the old one, lock and all, while we hold that one's lock.
hdf5::Handle create_part_file(const std::string& part) {
  const FileLock hold = lock_part_file(part);
  UnfinishedFile aside(aside_name(part));
  try {
    hdf5::Handle file = hdf5::create_file(aside.path());
    rename_to(aside, part);
    return file;
  } catch (...) {
    if (size_of(part) == 0) ::unlink(part.c_str());  // made for its lock
    throw;
  }
}

std::string aside_name(const std::string& part) {
  static std::atomic<int> number = 0;
  return part + "." + std::to_string(::getpid()) + "-" + std::to_string(number++);
}

void replace_part_file(UnfinishedFile& aside, const std::string& part) {
  const FileLock hold = lock_part_file(part);
  rename_to(aside, part);
}

/// HDF5's lock ends with the file: ours follows, and what another run put there in between is left to it.
void finish_part_file(hdf5::Handle& file, const std::string& path) {
  const std::string part = path + ".part";
  const ino_t mine = number_of(part);
  hdf5::close_written(file);
  const auto hold = FileLock::attempt(part, LockKind::exclusive);
  if (!hold || number_of(part) != mine)
    throw IoError("another run has taken '" + part + "' while this one ended. Run it again with another output");
  graupel::finish_part_file(path);
}

std::string write_remedy(const std::string& folder, uint64_t needed, const std::string& problem) {
  struct statvfs disk {};
  const bool known = ::statvfs(folder.c_str(), &disk) == 0;
  const uint64_t free_bytes = known ? uint64_t(disk.f_bavail) * disk.f_frsize : 0;
  const auto says = [&](const char* text) { return problem.find(text) != std::string::npos; };
  if (says("No space left") || says("quota") || (known && free_bytes < needed))
    return "(disk full: " + std::to_string(needed) + " bytes needed, " + std::to_string(free_bytes) +
           " free). Free space on that disk or choose another folder";
  return "(" + problem + "). Check the disk or choose another folder";
}

}  // namespace graupel::io
