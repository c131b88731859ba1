#include "core/system/atomic_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <new>

#include "core/system/error.h"
#include "core/system/standard_output.h"
#include "core/system/unfinished_file.h"

namespace graupel {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail(const std::string& what, const std::string& path) {
  const int code = errno;
  std::string hint = "Check the disk or choose another folder";
  if (code == ENOSPC || code == EDQUOT) hint = "Free space on that disk or choose another folder";
  if (code == EACCES || code == EROFS || code == EPERM) hint = "Choose a folder you may write to";
  if (code == ENAMETOOLONG) hint = "Choose a shorter name";
  if (code == EMFILE || code == ENFILE) hint = "Allow more open files (ulimit -n)";
  throw IoError("cannot " + what + " '" + path + "' (" + std::strerror(code) + "). " + hint);
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

void write_all(int fd, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0) {
      if (errno == EINTR) continue;
      fail("write " + std::to_string(bytes.size()) + " bytes to", path);
    }
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
}

void write_all(int fd, const std::vector<std::string_view>& pieces, const std::string& path) {
  for (const std::string_view piece : pieces) write_all(fd, piece, path);
}

/// Some files, as a folder on a network, cannot be synced (EINVAL): that is no error.
void sync_descriptor(int fd, const std::string& path) {
  while (::fsync(fd) != 0) {
    if (errno == EINVAL) return;
    if (errno != EINTR) fail("sync", path);
  }
}

void sync_path(const std::string& path, int flags) {
  const Descriptor fd(::open(path.c_str(), flags));
  if (fd.get() < 0) fail("open", path);
  sync_descriptor(fd.get(), path);
}

/// Creates a file beside `path` that no other thread or process writes. It is known as unfinished before it is there.
std::unique_ptr<UnfinishedFile> create_aside(const std::string& path) {
  static std::atomic<int> number = 0;
  for (;;) {
    const std::string name = path + "." + std::to_string(::getpid()) + "-" + std::to_string(number++) + ".part";
    auto part = std::make_unique<UnfinishedFile>(name);
    const Descriptor fd(::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL, 0644));
    if (fd.get() >= 0) return part;
    const int reason = errno;
    part->keep();  // another's, or none
    errno = reason;
    if (reason != EEXIST) fail("create", name);
  }
}

std::string read_pipe(std::istream& stream, const std::string& path, std::size_t limit) {
  std::string bytes;
  std::vector<char> piece(1 << 16);
  do {
    stream.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    bytes.append(piece.data(), static_cast<std::size_t>(stream.gcount()));
    if (bytes.size() > limit)
      throw InputError("'" + path + "' is too large (more than " + std::to_string(limit) +
                       " bytes). Name another file");
  } while (stream);
  if (stream.bad()) throw InputError("cannot read '" + path + "' (it cannot be read like a file). Name another file");
  return bytes;
}

}  // namespace

LinkTarget follow_links(const std::string& path) {
  constexpr int most_links = 40;  // as Linux
  fs::path at = path;
  for (int links = 0; links <= most_links; ++links) {
    std::error_code code;
    if (!fs::is_symlink(fs::symlink_status(at, code))) return {at.string()};
    const fs::path parent = at.has_parent_path() ? at.parent_path() : fs::path(".");
    const std::string folder = fs::canonical(parent, code).string();
    if (folder == "/dev" || folder.starts_with("/proc/")) return {at.string(), true};
    const fs::path next = fs::read_symlink(at, code);
    if (code) return {at.string()};
    at = next.is_absolute() ? next : parent / next;
  }
  errno = ELOOP;
  fail("write", path);
}

void replace_file(const std::string& part, const std::string& path) {
  if (std::rename(part.c_str(), path.c_str()) != 0) fail("rename the finished file to", path);
  const std::string folder = fs::absolute(path).parent_path().string();
  sync_path(folder, O_RDONLY | O_DIRECTORY);
}

void finish_part_file(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode))
    throw IoError("cannot write '" + path +
                  "' (it is no regular file, and would be replaced). What was written is in '" + path + ".part'");
  sync_path(path + ".part", O_RDONLY);
  replace_file(path + ".part", follow_links(path).path);
}

void write_part_file(const std::string& path, const std::function<void(const std::string& part)>& write) {
  UnfinishedFile part(path + ".part");
  try {
    write(part.path());
    finish_part_file(path);
    part.keep();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw IoError("cannot write '" + path + "' (" + error.what() + "). Free space there or choose another folder");
  }
}

void write_file_atomically(const std::string& path, std::string_view bytes) {
  write_file_atomically(path, std::vector<std::string_view>{bytes});
}

void write_file_atomically(const std::string& path, const std::vector<std::string_view>& pieces) {
  if (path == "-" || path == "/dev/stdout") return write_all(standard_output(), pieces, "standard output");
  const LinkTarget target = follow_links(path);
  struct stat status {};
  if (target.open_file || (::stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode))) {
    if (S_ISDIR(status.st_mode)) {
      errno = EISDIR;
      fail("write", path);
    }
    Descriptor fd(::open(path.c_str(), O_WRONLY));
    if (fd.get() < 0) fail("open", path);
    write_all(fd.get(), pieces, path);
    return;
  }
  const std::unique_ptr<UnfinishedFile> part = create_aside(target.path);
  {
    const Descriptor fd(::open(part->path().c_str(), O_WRONLY));
    if (fd.get() < 0) fail("open", part->path());
    write_all(fd.get(), pieces, part->path());
    sync_descriptor(fd.get(), part->path());
  }
  replace_file(part->path(), target.path);
  part->keep();
}

void sync_file(const std::string& path) { sync_path(path, O_RDONLY); }

std::string read_file(const std::string& path, std::size_t limit) {
  std::error_code code;
  if (fs::is_directory(path, code)) throw InputError("cannot read '" + path + "' (it is a folder, not a file)");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError("cannot read '" + path + "' (" + std::strerror(errno) + ")");
  stream.seekg(0, std::ios::end);
  const auto end = stream.tellg();
  if (end >= 0 && static_cast<std::size_t>(end) > limit)
    throw InputError("'" + path + "' is too large (" + std::to_string(end) + " bytes, at most " +
                     std::to_string(limit) + ")");
  if (end < 0) {  // a pipe
    stream.clear();
    return read_pipe(stream, path, limit);
  }
  std::string bytes(static_cast<std::size_t>(end), '\0');
  stream.seekg(0);
  stream.read(bytes.data(), end);
  if (!stream) throw InputError("cannot read '" + path + "' (short read)");
  return bytes;
}

void make_folder(const std::string& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code && !fs::is_directory(path))
    throw IoError("cannot create folder '" + path + "' (" + code.message() + "). Choose a folder you may write to");
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  DIR* const open_folder = ::opendir(folder.c_str());
  if (open_folder == nullptr) return names;
  while (const dirent* entry = ::readdir(open_folder)) {
    const std::string name = entry->d_name;
    if (name != "." && name != "..") names.push_back(name);
  }
  ::closedir(open_folder);
  std::sort(names.begin(), names.end());
  return names;
}

void remove_path(const std::string& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISDIR(status.st_mode)) {
    ::unlink(path.c_str());
    return;
  }
  for (const std::string& name : names_in(path)) remove_path(path + "/" + name);
  ::rmdir(path.c_str());
}

}  // namespace graupel
