// Frames of equal size in a temporary file without a name: it goes when the process does, however that ends. What was
// written lately is in the system's page cache.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>

namespace graupel::experiments {

class FrameFile {
 public:
  /// In TMPDIR or /tmp. Throws IoError.
  FrameFile(int64_t frames, std::size_t frame_bytes);
  ~FrameFile();
  FrameFile(const FrameFile&) = delete;
  FrameFile& operator=(const FrameFile&) = delete;

  std::size_t frame_bytes() const { return frame_bytes_; }
  /// Keeps a frame. Throws IoError, with the remedy, when the disk is full.
  void put(int64_t frame, std::span<const std::byte> record);
  bool has(int64_t frame) const { return there_[static_cast<std::size_t>(frame)].load(std::memory_order_acquire); }
  /// A part of a frame that is there. Several threads may read, beside one that puts.
  void read(int64_t frame, std::size_t offset, std::span<std::byte> out) const;

 private:
  int file_ = -1;
  std::size_t frame_bytes_;
  std::unique_ptr<std::atomic<bool>[]> there_;
};

}  // namespace graupel::experiments
