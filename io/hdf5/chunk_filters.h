// The filters of chunks (byte shuffle, deflate, Fletcher-32) outside the HDF5 library, whose calls run one at a time:
// so several threads compress and expand chunks at once. Bytes are those of the library's own filters.
#pragma once

#include <cstddef>
#include <cstdint>
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

/// Values of a chunk, `size` bytes. Throws hdf5::Failure for a wrong checksum or size and for damaged data.
std::vector<std::byte> unfilter_chunk(const FilteredChunk& chunk, const ChunkFilters& filters, std::size_t size);

}  // namespace graupel::io
