#include "experiments/viewer/frame_file.h"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

[[noreturn]] void throw_file_error(const std::string& what) {
  throw IoError(what + " a temporary file of frames in '" + std::filesystem::temp_directory_path().string() + "' (" +
                std::strerror(errno) + "). Free space there, or set TMPDIR to another folder");
}

int open_nameless_file() {
  std::error_code code;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(code);
  if (code) throw IoError("there is no folder for temporary files (" + code.message() + "). Set TMPDIR to one");
  std::string name = (folder / "graupel_view_XXXXXX").string();
  const int file = ::mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) throw_file_error("cannot make");
  ::unlink(name.c_str());
  return file;
}

}  // namespace

FrameFile::FrameFile(int64_t frames, std::size_t frame_bytes)
    : file_(open_nameless_file()),
      frame_bytes_(frame_bytes),
      there_(std::make_unique<std::atomic<bool>[]>(static_cast<std::size_t>(frames))) {}

FrameFile::~FrameFile() { ::close(file_); }

void FrameFile::put(int64_t frame, std::span<const std::byte> record) {
  auto at = static_cast<off_t>(static_cast<uint64_t>(frame) * frame_bytes_);
  while (!record.empty()) {
    const ssize_t written = ::pwrite(file_, record.data(), record.size(), at);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw_file_error("cannot write");
    at += written;
    record = record.subspan(static_cast<std::size_t>(written));
  }
  there_[static_cast<std::size_t>(frame)].store(true, std::memory_order_release);
}

void FrameFile::read(int64_t frame, std::size_t offset, std::span<std::byte> out) const {
  auto at = static_cast<off_t>(static_cast<uint64_t>(frame) * frame_bytes_ + offset);
  while (!out.empty()) {
    const ssize_t count = ::pread(file_, out.data(), out.size(), at);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) throw_file_error("cannot read");
    at += count;
    out = out.subspan(static_cast<std::size_t>(count));
  }
}

}  // namespace graupel::experiments
