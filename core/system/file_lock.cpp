#include "core/system/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/system/error.h"

namespace graupel {

namespace {

int open_file(const std::string& path, LockKind kind) {
  const int flags = kind == LockKind::exclusive ? O_RDWR | O_CREAT : O_RDONLY;
  const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC, 0644);
  if (descriptor < 0)
    throw IoError("cannot open '" + path + "' (" + std::strerror(errno) + "). Choose a folder you may write to");
  return descriptor;
}

/// False when another process holds the file.
bool lock(int descriptor, int operation) {
  while (::flock(descriptor, operation) != 0) {
    if (errno == EWOULDBLOCK) return false;
    if (errno != EINTR) return true;  // no locks on this file system
  }
  return true;
}

}  // namespace

FileLock FileLock::wait(const std::string& path) {
  for (;;) {
    FileLock held(open_file(path, LockKind::exclusive));
    lock(held.descriptor_, LOCK_EX);
    if (held.is_on(path)) return held;  // else the last holder removed it
  }
}

std::optional<FileLock> FileLock::attempt(const std::string& path, LockKind kind) {
  FileLock held(open_file(path, kind));
  if (!lock(held.descriptor_, (kind == LockKind::exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB)) return std::nullopt;
  if (!held.is_on(path)) return std::nullopt;
  return held;
}

/// Unlocked by name: closing alone leaves the lock to a process that was just forked and has not reached its exec.
FileLock::~FileLock() {
  if (descriptor_ < 0) return;
  ::flock(descriptor_, LOCK_UN);
  ::close(descriptor_);
}

bool FileLock::is_on(const std::string& path) const {
  struct stat mine {
  }, there{};
  return ::fstat(descriptor_, &mine) == 0 && ::stat(path.c_str(), &there) == 0 && mine.st_dev == there.st_dev &&
         mine.st_ino == there.st_ino;
}

}  // namespace graupel
