#include "mpm/grid/block_table.h"

#include <algorithm>
#include <cstring>

#include "core/system/error.h"
#include "mpm/memory_need.h"

namespace graupel::mpm {

namespace {

/// Slots that one item counts and places: in so many items at most, since each has a counter for every block. The order
/// depends neither on it nor on threads.
int64_t chunk_size(Device device, int64_t slots) {
  const int64_t smallest = device == Device::cpu ? 2048 : 256, most_items = device == Device::cpu ? 1024 : 4096;
  return std::max(smallest, (slots + most_items - 1) / most_items);
}

struct MarkOccupied {
  const int32_t* keys;
  uint8_t* occupied;
  GRAUPEL_HD void operator()(int64_t slot) const {
    if (keys[slot] < 0) return;
    mark(occupied + keys[slot]);
  }
};

struct NumberOwners {
  const int32_t* owner_key;
  int32_t* owner_of_key;
  GRAUPEL_HD void operator()(int64_t owner) const { owner_of_key[owner_key[owner]] = static_cast<int32_t>(owner); }
};

/// Place of a slot's owner block in a row of counts: slots without one come last.
GRAUPEL_HD inline int64_t column_of(const int32_t* owner_of_key, int32_t key, int64_t columns) {
  return key < 0 ? columns - 1 : owner_of_key[key];
}

struct CountChunk {
  const int32_t *keys, *owner_of_key;
  int32_t* counts;  ///< [chunks, columns]
  int64_t columns, chunk, slots;
  GRAUPEL_HD void operator()(int64_t item) const {
    int32_t* own = counts + item * columns;
    for (int64_t h = 0; h < columns; ++h) own[h] = 0;
    const int64_t end = (item + 1) * chunk < slots ? (item + 1) * chunk : slots;
    for (int64_t slot = item * chunk; slot < end; ++slot) ++own[column_of(owner_of_key, keys[slot], columns)];
  }
};

/// Counts of a block -> places inside the block at which each chunk begins.
struct ScanChunks {
  int32_t *counts, *totals;
  int64_t columns, chunks;
  GRAUPEL_HD void operator()(int64_t owner) const {
    int32_t sum = 0;
    for (int64_t c = 0; c < chunks; ++c) {
      const int32_t n = counts[c * columns + owner];
      counts[c * columns + owner] = sum;
      sum += n;
    }
    totals[owner] = sum;
  }
};

struct PlaceChunk {
  const int32_t *keys, *owner_of_key, *start;
  int32_t *counts, *order;
  int64_t columns, chunk, slots;
  GRAUPEL_HD void operator()(int64_t item) const {
    int32_t* own = counts + item * columns;
    const int64_t end = (item + 1) * chunk < slots ? (item + 1) * chunk : slots;
    for (int64_t slot = item * chunk; slot < end; ++slot) {
      const int64_t owner = column_of(owner_of_key, keys[slot], columns);
      order[start[owner] + own[owner]++] = static_cast<int32_t>(slot);
    }
  }
};

}  // namespace

BlockTable::BlockTable(Device device, const Vec<int, 3>& blocks, int dimensions, int64_t particle_count)
    : device_(device), corners_(std::size_t{1} << dimensions), count_(particle_count) {
  double size = 1;
  for (int d = 0; d < 3; ++d) size *= blocks[d];
  check_block_count(size);
  geometry_.blocks = blocks;
  const auto directory = static_cast<std::size_t>(geometry_.directory_size());
  const auto n = static_cast<std::size_t>(particle_count);
  node_of_key_.assign(directory, -1);
  for (Buffer<int32_t>* b : {&keys_, &owner_of_key_, &owner_key_, &node_key_, &owner_to_node_, &node_to_owner_, &start_,
                             &order_, &chunk_counts_, &totals_, &device_node_of_key_})
    *b = Buffer<int32_t>(device, 0);
  keys_.resize_discard(n);
  order_.resize_discard(n);
  owner_of_key_.resize_discard(directory);
  occupied_ = Buffer<uint8_t>(device, directory);
  occupied_.fill_zero();
  changed_ = Buffer<uint8_t>(device, 1);
  changed_.fill_zero();
}

void BlockTable::update() {
  uint8_t changed = 0;
  device_copy(Device::cpu, &changed, device_, changed_.data(), 1);
  if (changed == 0 && !stale_) return;
  changed_.fill_zero();
  stale_ = false;
  const std::vector<int32_t> occupied = occupied_blocks();
  if (occupied != owner_keys_) link_blocks(occupied);
  sort_slots();
}

std::vector<int32_t> BlockTable::occupied_blocks() {
  parallel_for(device_, count_, MarkOccupied{keys_.data(), occupied_.data()}, Grain{4096});
  std::vector<uint8_t> copy;
  if (device_ != Device::cpu) copy = occupied_.download();
  const uint8_t* flags = device_ == Device::cpu ? occupied_.data() : copy.data();
  std::vector<int32_t> keys;
  keys.reserve(owner_keys_.size() + 64);
  const auto n = static_cast<int64_t>(occupied_.size());
  for (const uint8_t* p = flags; (p = static_cast<const uint8_t*>(std::memchr(p, 1, flags + n - p))) != nullptr; ++p)
    keys.push_back(static_cast<int32_t>(p - flags));
  if (device_ == Device::cpu)
    for (const int32_t key : keys) occupied_[key] = 0;
  else
    occupied_.fill_zero();
  return keys;
}

void BlockTable::link_blocks(const std::vector<int32_t>& owner_keys) {
  for (const int32_t key : node_keys_) node_of_key_[key] = -1;
  owner_keys_ = owner_keys;
  node_keys_.clear();
  std::vector<int32_t> corner_key(owner_keys.size() * corners_);
  for (std::size_t h = 0; h < owner_keys.size(); ++h)
    for (std::size_t c = 0; c < corners_; ++c) {
      const Vec<int, 3> at = geometry_.block_of(owner_keys[h]) + corner_bits<3>(static_cast<int>(c));
      const int32_t key = geometry_.directory_index(at);
      corner_key[h * corners_ + c] = key;
      if (node_of_key_[key] >= 0) continue;
      node_of_key_[key] = 0;
      node_keys_.push_back(key);
    }
  std::sort(node_keys_.begin(), node_keys_.end());
  for (std::size_t i = 0; i < node_keys_.size(); ++i) node_of_key_[node_keys_[i]] = static_cast<int32_t>(i);
  std::vector<int32_t> owner_to_node(corner_key.size()), node_to_owner(node_keys_.size() * corners_, -1);
  for (std::size_t i = 0; i < corner_key.size(); ++i) {
    owner_to_node[i] = node_of_key_[corner_key[i]];
    node_to_owner[static_cast<std::size_t>(owner_to_node[i]) * corners_ + i % corners_] =
        static_cast<int32_t>(i / corners_);
  }
  owner_key_.upload(owner_keys_);
  node_key_.upload(node_keys_);
  owner_to_node_.upload(owner_to_node);
  node_to_owner_.upload(node_to_owner);
  if (keeps_node_lookup_) device_node_of_key_.upload(node_of_key_);
  parallel_for(device_, static_cast<int64_t>(owner_keys_.size()), NumberOwners{owner_key_.data(), owner_of_key_.data()},
               Grain{4096});
}

void BlockTable::sort_slots() {
  const auto columns = static_cast<int64_t>(owner_keys_.size()) + 1;
  const int64_t chunk = chunk_size(device_, count_), chunks = (count_ + chunk - 1) / chunk;
  chunk_counts_.resize_discard(static_cast<std::size_t>(chunks * columns));
  totals_.resize_discard(static_cast<std::size_t>(columns));
  start_.resize_discard(static_cast<std::size_t>(columns) + 1);
  const Grain grain{device_ == Device::cpu ? 4 : 1};
  parallel_for(device_, chunks,
               CountChunk{keys_.data(), owner_of_key_.data(), chunk_counts_.data(), columns, chunk, count_}, grain);
  parallel_for(device_, columns, ScanChunks{chunk_counts_.data(), totals_.data(), columns, chunks}, Grain{1024});
  std::vector<int32_t> start(static_cast<std::size_t>(columns) + 1, 0);
  device_copy(Device::cpu, start.data() + 1, device_, totals_.data(),
              static_cast<std::size_t>(columns) * sizeof(int32_t));
  for (int64_t h = 0; h < columns; ++h) start[h + 1] += start[h];
  device_copy(device_, start_.data(), Device::cpu, start.data(), start.size() * sizeof(int32_t));
  parallel_for(device_, chunks,
               PlaceChunk{keys_.data(), owner_of_key_.data(), start_.data(), chunk_counts_.data(), order_.data(),
                          columns, chunk, count_},
               grain);
}

BlockView BlockTable::view() const {
  return {static_cast<int32_t>(owner_keys_.size()),
          static_cast<int32_t>(node_keys_.size()),
          owner_key_.data(),
          node_key_.data(),
          owner_to_node_.data(),
          node_to_owner_.data(),
          owner_of_key_.data(),
          keeps_node_lookup_ ? device_node_of_key_.data() : nullptr,
          start_.data(),
          order_.data()};
}

int64_t BlockTable::bytes() const {
  std::size_t n = node_of_key_.size() + occupied_.size() / 4;
  for (const Buffer<int32_t>* b : {&keys_, &owner_of_key_, &owner_key_, &node_key_, &owner_to_node_, &node_to_owner_,
                                   &start_, &order_, &chunk_counts_, &totals_, &device_node_of_key_})
    n += b->size();
  return static_cast<int64_t>(n * sizeof(int32_t));
}

}  // namespace graupel::mpm
