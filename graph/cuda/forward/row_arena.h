// Bump allocator for the activations of an inference pass; nothing is kept for the backward pass.
#pragma once

#include <algorithm>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/cuda/forward/packed_network.h"

namespace graupel::graph {

/// Rows that are given out one after the other and taken back all at once.
class RowArena : public RowMemory {
 public:
  bool keeps_all() const override { return false; }
  float* rows32(int64_t rows) override { return static_cast<float*>(take(rows * layer_width * 4)); }
  uint16_t* rows16(int64_t rows) override { return static_cast<uint16_t*>(take(rows * layer_width * 2)); }
  void reset() {
    // What did not fit into one piece will the next time.
    if (pieces_.size() > 1) {
      uint64_t all = 0;
      for (const Buffer<char>& piece : pieces_) all += piece.size();
      pieces_.clear();
      pieces_.emplace_back(Device::cuda, all);
    }
    used_ = 0;
  }

 private:
  static constexpr uint64_t least_piece = 16 << 20;
  void* take(int64_t bytes) {
    const uint64_t wanted = (static_cast<uint64_t>(bytes) + 255) / 256 * 256;
    if (pieces_.empty() || used_ + wanted > pieces_.back().size()) {
      pieces_.emplace_back(Device::cuda, std::max(wanted, least_piece));
      used_ = 0;
    }
    void* const place = pieces_.back().data() + used_;
    used_ += wanted;
    return place;
  }
  std::vector<Buffer<char>> pieces_;
  uint64_t used_ = 0;  ///< of the last piece
};

}  // namespace graupel::graph
