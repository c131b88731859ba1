#include "io/hdf5/chunk_filters.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>

#include "io/hdf5/hdf5.h"

namespace graupel::io {

namespace {

constexpr std::size_t checksum_bytes = 4;

/// Byte b of every element, then the next byte of every element; what is no whole element stays at the end.
std::vector<std::byte> shuffled(std::span<const std::byte> values, std::size_t element) {
  std::vector<std::byte> out(values.size());
  const std::size_t n = values.size() / element;
  for (std::size_t b = 0; b < element; ++b)
    for (std::size_t i = 0; i < n; ++i) out[b * n + i] = values[i * element + b];
  std::copy(values.begin() + static_cast<std::ptrdiff_t>(n * element), values.end(),
            out.begin() + static_cast<std::ptrdiff_t>(n * element));
  return out;
}

std::vector<std::byte> unshuffled(std::span<const std::byte> values, std::size_t element) {
  std::vector<std::byte> out(values.size());
  const std::size_t n = values.size() / element;
  for (std::size_t b = 0; b < element; ++b)
    for (std::size_t i = 0; i < n; ++i) out[i * element + b] = values[b * n + i];
  std::copy(values.begin() + static_cast<std::ptrdiff_t>(n * element), values.end(),
            out.begin() + static_cast<std::ptrdiff_t>(n * element));
  return out;
}

uint32_t folded(uint32_t sum) { return (sum & 0xffff) + (sum >> 16); }

/// Fletcher-32 over 16-bit words, first byte high, as HDF5 counts it (an odd last byte is the high one of its word).
uint32_t fletcher32(std::span<const std::byte> bytes) {
  constexpr std::size_t most_words = 360;  // before the second sum can overflow
  uint32_t first = 0, second = 0;
  const std::size_t words = bytes.size() / 2;
  for (std::size_t begin = 0; begin < words; begin += most_words) {
    for (std::size_t w = begin; w < std::min(words, begin + most_words); ++w) {
      first += std::to_integer<uint32_t>(bytes[2 * w]) << 8 | std::to_integer<uint32_t>(bytes[2 * w + 1]);
      second += first;
    }
    first = folded(first);
    second = folded(second);
  }
  if (bytes.size() % 2 != 0) {
    first += std::to_integer<uint32_t>(bytes.back()) << 8;
    second += first;
    first = folded(first);
    second = folded(second);
  }
  return folded(second) << 16 | folded(first);
}

uint32_t stored_checksum(const std::byte* at) {
  uint32_t sum = 0;
  for (std::size_t i = 0; i < checksum_bytes; ++i) sum |= std::to_integer<uint32_t>(at[i]) << 8 * i;
  return sum;
}

/// Empty where the result would be longer than what the library's filter allows for it.
std::vector<std::byte> deflated(const std::vector<std::byte>& values, int level) {
  uLongf size = static_cast<uLongf>(values.size() + (values.size() + 999) / 1000 + 12);
  std::vector<std::byte> out(size);
  const int status = ::compress2(reinterpret_cast<Bytef*>(out.data()), &size,
                                 reinterpret_cast<const Bytef*>(values.data()), values.size(), level);
  if (status == Z_MEM_ERROR) throw std::bad_alloc();
  out.resize(status == Z_OK ? size : 0);
  return out;
}

std::vector<std::byte> inflated(std::span<const std::byte> packed, std::size_t size) {
  std::vector<std::byte> out(size);
  uLongf found = static_cast<uLongf>(size);
  if (::uncompress(reinterpret_cast<Bytef*>(out.data()), &found, reinterpret_cast<const Bytef*>(packed.data()),
                   packed.size()) != Z_OK ||
      found != size)
    throw hdf5::Failure("a chunk cannot be expanded to its size");
  return out;
}

/// Bit of a filter in FilteredChunk::skipped.
uint32_t bit_of_deflate(const ChunkFilters& filters) { return filters.shuffle ? 2 : 1; }

}  // namespace

FilteredChunk filter_chunk(std::span<const std::byte> values, const ChunkFilters& filters) {
  FilteredChunk out;
  out.bytes = filters.shuffle && filters.element_bytes > 1 ? shuffled(values, filters.element_bytes)
                                                           : std::vector<std::byte>(values.begin(), values.end());
  if (filters.deflate > 0) {
    std::vector<std::byte> packed = deflated(out.bytes, filters.deflate);
    if (packed.empty())
      out.skipped |= bit_of_deflate(filters);
    else
      out.bytes = std::move(packed);
  }
  if (!filters.checksum) return out;
  const uint32_t sum = fletcher32(out.bytes);
  for (std::size_t i = 0; i < checksum_bytes; ++i) out.bytes.push_back(static_cast<std::byte>(sum >> 8 * i & 255));
  return out;
}

std::vector<std::byte> unfilter_chunk(const FilteredChunk& chunk, const ChunkFilters& filters, std::size_t size) {
  const uint32_t deflate = bit_of_deflate(filters), checksum = filters.deflate > 0 ? deflate << 1 : deflate;
  std::span<const std::byte> bytes = chunk.bytes;
  if (filters.checksum && (chunk.skipped & checksum) == 0) {
    if (bytes.size() < checksum_bytes) throw hdf5::Failure("a chunk is too short");
    const std::byte* sum = bytes.data() + bytes.size() - checksum_bytes;
    bytes = bytes.first(bytes.size() - checksum_bytes);
    if (fletcher32(bytes) != stored_checksum(sum)) throw hdf5::Failure("a chunk's checksum is wrong");
  }
  std::vector<std::byte> values = filters.deflate > 0 && (chunk.skipped & deflate) == 0
                                      ? inflated(bytes, size)
                                      : std::vector<std::byte>(bytes.begin(), bytes.end());
  if (values.size() != size) throw hdf5::Failure("a chunk has another size than its dataset's");
  const bool shuffle = filters.shuffle && (chunk.skipped & 1) == 0 && filters.element_bytes > 1;
  return shuffle ? unshuffled(values, filters.element_bytes) : values;
}

}  // namespace graupel::io
