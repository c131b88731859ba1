// Locks between processes (flock): held until the object or the process ends, however it ends.
#pragma once

#include <optional>
#include <string>
#include <utility>

namespace graupel {

enum class LockKind { shared, exclusive };

class FileLock {
 public:
  /// Waits until no other process holds `path`, which is created when missing. Throws IoError.
  static FileLock wait(const std::string& path);
  /// Nothing while another process holds `path`, or put another file in its place. An exclusive lock creates a missing
  /// file. A file system without locks counts as free. Throws IoError.
  static std::optional<FileLock> attempt(const std::string& path, LockKind kind);

  ~FileLock();
  FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileLock& operator=(FileLock&&) = delete;

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  bool is_on(const std::string& path) const;
  int descriptor_;
};

}  // namespace graupel
