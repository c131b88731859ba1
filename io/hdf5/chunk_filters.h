// The filters of chunks (byte shuffle, deflate, Fletcher-32) outside the HDF5 library, whose calls run one at a time:
// so several threads compress and expand chunks at once. Bytes are those of the library's own filters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace graupel::io {

/// What a dataset does to each chunk, in this order.
struct ChunkFilters {
  std::size_t element_bytes = 4;
  bool shuffle = true;
  int deflate = 1;  ///< 0: none, else 1..9
  bool checksum = true;
};

struct FilteredChunk {
  std::vector<std::byte> bytes;
  uint32_t skipped = 0;  ///< bit i: filter i was left out, as HDF5 counts them
};

FilteredChunk filter_chunk(std::span<const std::byte> values, const ChunkFilters& filters);

/// A chunk that was checked and expanded; what is copied from it is put in order on the way.
class ExpandedChunk {
 public:
  /// Of `size` bytes, a multiple of the elements'; refers to the bytes of `chunk` where they are not deflated. Throws
  /// hdf5::Failure for a wrong checksum or size and for damaged data.
  ExpandedChunk(const FilteredChunk& chunk, const ChunkFilters& filters, std::size_t size);
  /// The bytes from `first` on. Both it and the size of `out` are multiples of the elements'.
  void copy(std::size_t first, std::span<std::byte> out) const;

 private:
  std::unique_ptr<std::byte[]> expanded_;
  std::span<const std::byte> bytes_;
  std::size_t shuffled_element_;  ///< 1: not shuffled
};

}  // namespace graupel::io
