// Which blocks of the grid are in use, and the particles of each: a stable counting sort by owner block. The result
// depends on the particles' slots and owner blocks alone, never on threads.
#pragma once

#include <atomic>
#include <vector>

#include "mpm/grid/grid.h"
#include "mpm/particles/particles.h"

namespace graupel::mpm {

/// Sets a flag that several items may set at once. One that is set is only read, so that its cache line stays shared.
GRAUPEL_HD inline void mark(uint8_t* flag) {
#ifdef __CUDA_ARCH__
  if (*static_cast<volatile uint8_t*>(flag) == 0) *flag = 1;
#else
  if (std::atomic_ref<uint8_t>(*flag).load(std::memory_order_relaxed) != 0) return;
  std::atomic_ref<uint8_t>(*flag).store(1, std::memory_order_relaxed);
#endif
}

/// Blocks in use, for kernels. Home blocks hold particles; node blocks are these and their upper neighbours.
struct BlockView {
  int32_t owner_count, node_count;
  const int32_t* owner_key;      ///< [owner_count] directory index, ascending
  const int32_t* node_key;       ///< [node_count] directory index, ascending
  const int32_t* owner_to_node;  ///< [owner_count, 2^D] node block at each corner (bit d: upper along axis d)
  const int32_t* node_to_owner;  ///< [node_count, 2^D] owner block of which this is that corner; -1 for none
  const int32_t* owner_of_key;   ///< [directory] owner block of a directory index; only where one is
  const int32_t* node_of_key;    ///< [directory] node block of a directory index or -1; null unless asked for
  const int32_t* start;          ///< [owner_count + 1] first entry of each owner block in `order`
  const int32_t* order;          ///< [n] slots, by owner block, ascending inside one; then those without one
};

class BlockTable {
 public:
  BlockTable() = default;
  /// `blocks` along each axis; those of a plane run lie in one layer.
  BlockTable(Device device, const Vec<int, 3>& blocks, int dimensions, int64_t particle_count);

  /// Fills BlockView::node_of_key from now on.
  void keep_node_lookup() { keeps_node_lookup_ = true; }
  /// Home block of every slot, as a directory index, or negative for none: kept up to date by the kernel that moves
  /// particles.
  int32_t* keys() { return keys_.data(); }
  /// Set by that kernel when a key changed.
  uint8_t* changed_flag() { return changed_.data(); }

  /// Brings blocks and order up to date; does nothing while no key changed.
  void update();
  /// Makes the next update() sort whatever the flag says.
  void invalidate() { stale_ = true; }
  BlockView view() const;
  int64_t bytes() const;

 private:
  std::vector<int32_t> occupied_blocks();
  void link_blocks(const std::vector<int32_t>& owner_keys);
  void sort_slots();

  Device device_ = Device::cpu;
  std::size_t corners_ = upper_neighbors<3>;
  GridGeometry<float, 3> geometry_{};  ///< only its numbering of blocks is used
  int64_t count_ = 0;
  bool stale_ = true, keeps_node_lookup_ = false;
  std::vector<int32_t> owner_keys_, node_keys_;
  std::vector<int32_t> node_of_key_;  ///< [directory] -1 where no node block is
  Buffer<int32_t> keys_, owner_of_key_, owner_key_, node_key_, owner_to_node_, node_to_owner_, start_, order_;
  Buffer<int32_t> chunk_counts_, totals_, device_node_of_key_;
  Buffer<uint8_t> occupied_, changed_;
};

}  // namespace graupel::mpm
