// Filters outside the HDF5 library give the library's own bytes, back and forth.
#include "io/hdf5/chunk_filters.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "io/hdf5/hdf5_dataset.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

using hdf5::Element;

std::vector<std::byte> smooth_values(std::size_t n) {
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = std::sin(0.001f * static_cast<float>(i));
  std::vector<std::byte> bytes(n * sizeof(float));
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

std::vector<std::byte> noise(std::size_t n) {
  std::mt19937 random(7);
  std::vector<std::byte> bytes(n);
  for (std::byte& b : bytes) b = static_cast<std::byte>(random() & 255);
  return bytes;
}

std::vector<std::byte> unfilter_chunk(const FilteredChunk& chunk, const ChunkFilters& filters, std::size_t size) {
  std::vector<std::byte> values(size);
  ExpandedChunk(chunk, filters, size).copy(0, values);
  return values;
}

/// The one chunk of a dataset as the library itself writes it.
FilteredChunk library_chunk(const std::string& path, const std::vector<std::byte>& values, Element element,
                            const ChunkFilters& filters) {
  const hdf5::Handle file = hdf5::create_file(path);
  const std::vector<hsize_t> size = {values.size() / filters.element_bytes};
  hdf5::DatasetLayout layout;
  layout.element = element;
  layout.size = layout.chunk = size;
  layout.deflate = filters.deflate;
  layout.checksum = filters.checksum;
  const hdf5::Handle dataset = hdf5::create_dataset(file, "values", layout);
  hdf5::write_all(dataset, element, values.data());
  H5Dflush(dataset);
  const hsize_t at = 0;
  hsize_t bytes = 0;
  H5Dget_chunk_storage_size(dataset, &at, &bytes);
  FilteredChunk chunk;
  chunk.bytes.resize(bytes);
  H5Dread_chunk(dataset, H5P_DEFAULT, &at, &chunk.skipped, chunk.bytes.data());
  return chunk;
}

TEST(ChunkFilters, GiveTheBytesOfTheLibrary) {
  const TemporaryFolder folder;
  for (const int level : {0, 1, 6})
    for (const std::size_t n : {std::size_t(4), std::size_t(12), std::size_t(4 * 361), std::size_t(400004)})
      for (const auto& values : {smooth_values(n / 4), noise(n)}) {
        const ChunkFilters filters{.element_bytes = 4, .shuffle = true, .deflate = level, .checksum = true};
        const FilteredChunk mine = filter_chunk(values, filters);
        const FilteredChunk theirs = library_chunk(folder.file("a.h5"), values, Element::float32, filters);
        EXPECT_EQ(mine.skipped, theirs.skipped);
        EXPECT_TRUE(mine.bytes == theirs.bytes) << n << " bytes, level " << level;
        EXPECT_TRUE(unfilter_chunk(mine, filters, n) == values) << n << " bytes, level " << level;
      }
}

TEST(ChunkFilters, GiveTheBytesOfTheLibraryForSingleBytes) {
  const TemporaryFolder folder;
  const ChunkFilters filters{.element_bytes = 1, .shuffle = true, .deflate = 1, .checksum = true};
  for (const std::size_t n : {1u, 2u, 777u, 65537u}) {
    const auto values = noise(n);
    const FilteredChunk mine = filter_chunk(values, filters);
    EXPECT_TRUE(mine.bytes == library_chunk(folder.file("a.h5"), values, Element::uint8, filters).bytes) << n;
    EXPECT_TRUE(unfilter_chunk(mine, filters, n) == values) << n;
  }
}

TEST(ChunkFilters, PartsOfAChunkAreThoseOfTheWhole) {
  for (const std::size_t element : {std::size_t(1), std::size_t(4), std::size_t(8)})
    for (const int level : {0, 1}) {
      const ChunkFilters filters{.element_bytes = element, .shuffle = true, .deflate = level, .checksum = true};
      const auto values = smooth_values(500);
      const FilteredChunk packed = filter_chunk(values, filters);
      const ExpandedChunk chunk(packed, filters, values.size());
      for (const std::size_t first : {std::size_t(0), 3 * element, 200 * element})
        for (const std::size_t count :
             {std::size_t(0), std::size_t(1), std::size_t(15), std::size_t(16), std::size_t(49)}) {
          std::vector<std::byte> part(count * element);
          chunk.copy(first, part);
          EXPECT_TRUE(std::equal(part.begin(), part.end(), values.begin() + static_cast<std::ptrdiff_t>(first)))
              << element << " bytes, " << count << " from " << first;
        }
    }
}

TEST(ChunkFilters, DamageIsNoticed) {
  const ChunkFilters filters;
  const auto values = smooth_values(1000);
  const FilteredChunk good = filter_chunk(values, filters);
  for (std::size_t at = 0; at < good.bytes.size(); at += 97) {
    FilteredChunk bad = good;
    bad.bytes[at] ^= std::byte{1};
    EXPECT_THROW(unfilter_chunk(bad, filters, values.size()), hdf5::Failure) << at;
  }
  FilteredChunk cut = good;
  cut.bytes.resize(3);
  EXPECT_THROW(unfilter_chunk(cut, filters, values.size()), hdf5::Failure);
  EXPECT_THROW(unfilter_chunk(good, filters, values.size() + 4), hdf5::Failure);
}

}  // namespace
}  // namespace graupel::io
