#include "io/hdf5/chunk_filters.h"

#include <algorithm>
#include <array>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "core/system/error.h"
#include "io/hdf5/deflate.h"
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

/// Elements of four bytes from their four planes, `n` bytes apart; returns how many were put in order.
std::size_t unshuffle_words(const std::byte* planes, std::size_t n, std::span<std::byte> out) {
  std::size_t i = 0;
#ifdef __SSE2__
  const auto load = [&](std::size_t plane) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(planes + plane * n + i));
  };
  for (; 4 * (i + 16) <= out.size(); i += 16) {
    const __m128i a = load(0), b = load(1), c = load(2), d = load(3);
    const __m128i low[2] = {_mm_unpacklo_epi8(a, b), _mm_unpackhi_epi8(a, b)};
    const __m128i high[2] = {_mm_unpacklo_epi8(c, d), _mm_unpackhi_epi8(c, d)};
    auto* to = reinterpret_cast<__m128i*>(out.data() + 4 * i);
    for (int half = 0; half < 2; ++half) {
      _mm_storeu_si128(to++, _mm_unpacklo_epi16(low[half], high[half]));
      _mm_storeu_si128(to++, _mm_unpackhi_epi16(low[half], high[half]));
    }
  }
#endif
  return i;
}

/// The largest sum that counts as `sum` modulo 65535 in 16 bits: only 0 stays 0.
uint64_t folded(uint64_t sum) {
  while (sum > 0xffff) sum = (sum & 0xffff) + (sum >> 16);
  return sum;
}

uint64_t swapped(uint64_t word) { return (word << 8 & 0xff00) | word >> 8; }

/// Fletcher-32 over 16-bit words, first byte high, as HDF5 counts it (an odd last byte is the high one of its word).
/// Modulo 65535 to swap the bytes of a word is to multiply by 256, so that the sums are swapped in place of the words.
/// Lanes of a block are summed at once: word i = k m + l of K m words counts K m - k m - l times in the second sum.
uint32_t fletcher32(std::span<const std::byte> bytes) {
  constexpr std::size_t lanes = 16, most_rows = 256;  // before a lane's second sum can overflow
  uint64_t first = 0, second = 0;
  std::size_t at = 0;
  while (bytes.size() - at >= 2 * lanes) {
    const std::size_t rows = std::min(most_rows, (bytes.size() - at) / (2 * lanes));
    std::array<uint32_t, lanes> sum{}, sum_of_sums{};
    for (std::size_t row = 0; row < rows; ++row, at += 2 * lanes) {
      std::array<uint16_t, lanes> word;
      std::memcpy(word.data(), bytes.data() + at, sizeof word);
      for (std::size_t l = 0; l < lanes; ++l) sum[l] += word[l];
      for (std::size_t l = 0; l < lanes; ++l) sum_of_sums[l] += sum[l];
    }
    second += rows * lanes * first;
    for (std::size_t l = 0; l < lanes; ++l) {
      first += sum[l];
      second += lanes * uint64_t{sum_of_sums[l]} - l * uint64_t{sum[l]};
    }
    first = folded(first);
    second = folded(second);
  }
  for (; at < bytes.size(); at += 2) {
    first += std::to_integer<uint64_t>(bytes[at]);
    if (at + 1 < bytes.size()) first += std::to_integer<uint64_t>(bytes[at + 1]) << 8;
    second += first;
  }
  return static_cast<uint32_t>(swapped(folded(second)) << 16 | swapped(folded(first)));
}

uint32_t stored_checksum(const std::byte* at) {
  uint32_t sum = 0;
  for (std::size_t i = 0; i < checksum_bytes; ++i) sum |= std::to_integer<uint32_t>(at[i]) << 8 * i;
  return sum;
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

ExpandedChunk::ExpandedChunk(const FilteredChunk& chunk, const ChunkFilters& filters, std::size_t size)
    : bytes_(chunk.bytes), shuffled_element_(filters.shuffle && (chunk.skipped & 1) == 0 ? filters.element_bytes : 1) {
  const uint32_t deflate = bit_of_deflate(filters), checksum = filters.deflate > 0 ? deflate << 1 : deflate;
  if (filters.checksum && (chunk.skipped & checksum) == 0) {
    if (bytes_.size() < checksum_bytes) throw hdf5::Failure("a chunk is too short");
    bytes_ = bytes_.first(bytes_.size() - checksum_bytes);
    if (fletcher32(bytes_) != stored_checksum(bytes_.data() + bytes_.size()))
      throw hdf5::Failure("a chunk's checksum is wrong");
  }
  if (filters.deflate > 0 && (chunk.skipped & deflate) == 0) {
    expanded_ = std::make_unique_for_overwrite<std::byte[]>(size);
    if (!inflate_into(bytes_, {expanded_.get(), size})) throw hdf5::Failure("a chunk cannot be expanded to its size");
    bytes_ = {expanded_.get(), size};
  }
  if (bytes_.size() != size) throw hdf5::Failure("a chunk has another size than its dataset's");
}

void ExpandedChunk::copy(std::size_t first, std::span<std::byte> out) const {
  GRAUPEL_ASSERT(first + out.size() <= bytes_.size());
  const std::size_t element = shuffled_element_;
  if (element == 1) {
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(first), out.size(), out.begin());
    return;
  }
  const std::size_t n = bytes_.size() / element, count = out.size() / element;
  const std::byte* planes = bytes_.data() + first / element;
  for (std::size_t i = element == 4 ? unshuffle_words(planes, n, out) : 0; i < count; ++i)
    for (std::size_t b = 0; b < element; ++b) out[i * element + b] = planes[b * n + i];
}

}  // namespace graupel::io
