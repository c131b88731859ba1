// Datasets of float or integer arrays: created for streaming, opened with distrust, read and written by frames.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/hdf5/chunk_filters.h"
#include "io/hdf5/hdf5.h"

namespace graupel::io::hdf5 {

enum class Element { float32, float64, int32, uint8 };

struct DatasetLayout {
  Element element = Element::float32;
  std::vector<hsize_t> size = {};   ///< 0 in the first place: grows
  std::vector<hsize_t> chunk = {};  ///< empty: one block
  int deflate = 0;                  ///< 0..9
  bool checksum = false;            ///< fletcher32 of each chunk, and byte shuffle before deflate
  bool early = false;               ///< chunks get their place when the dataset grows, not when they are flushed
  std::string units = {};
  std::string description = {};
};

Handle create_dataset(hid_t group, const std::string& name, const DatasetLayout& layout);

/// A dataset that was checked: values inside this file, plain numbers, known filters, a believable size.
struct Dataset {
  Handle id;
  std::vector<hsize_t> size;
  std::vector<hsize_t> chunk;  ///< empty when it is not chunked
  /// Where values are stored as they lie in memory, behind filters that threads can run at once: what they are.
  std::optional<ChunkFilters> filters;
  std::optional<Element> plain_type;
  bool is_whole = false;  ///< that it lacks a chunk is an error of read_rows(), where HDF5 gives zeros

  /// Rows [first, first + count) of the first dimension. When the last dimension is 2, the values are placed 3 apart
  /// and the third is left alone. Chunks of many rows are expanded by all threads.
  void read_rows(hsize_t first, hsize_t count, Element element, void* out) const;
  /// Whether read_rows() expands chunks of this type itself, beside other threads.
  bool expands_chunks(Element element) const;
  /// Chunks of its size that the file does not hold, or the one block where it has none; HDF5 would read zeros.
  hsize_t missing_chunks() const;
  /// Whether the file holds every chunk of the row of chunks that starts at `row`.
  bool has_chunks(hsize_t row) const;

 private:
  bool read_chunk(hsize_t row, hsize_t second, FilteredChunk& packed) const;
  bool expand_chunks(hsize_t row) const;
  void check_chunks(hsize_t first, hsize_t count) const;
  bool expand_rows(hsize_t first, hsize_t count, std::byte* out) const;
  std::size_t particle_bytes() const;

  mutable std::optional<hsize_t> expanded_row_;  ///< first row of the chunks in expanded_
  mutable std::vector<std::byte> expanded_;      ///< rows of the chunks that were read last
};

enum class NumberKind { real, integer };
/// Opens `name` of `group`; fails unless it is a dataset of `rank` dimensions, of that kind, that a file of `file_size`
/// bytes can hold and that stores nothing elsewhere.
Dataset open_dataset(hid_t group, const std::string& name, int rank, NumberKind kind, uint64_t file_size);

/// Chunks of `count` rows that a dataset gets next, ready for the disk: made by several threads, without a call of the
/// library.
struct ChunkRow {
  hsize_t count = 0;
  std::vector<hsize_t> start;  ///< of each chunk, along the second dimension
  std::vector<FilteredChunk> chunks;
};

/// `rows` are the addresses of at most chunk[0] rows of `row_size` elements; missing ones are stored as zeros.
ChunkRow filter_rows(const std::vector<const void*>& rows, const std::vector<hsize_t>& row_size,
                     const std::vector<hsize_t>& chunk, const ChunkFilters& filters);
/// Writes them behind the present end, a multiple of chunk[0].
void append_chunks(hid_t dataset, hsize_t present, const std::vector<hsize_t>& row_size, const ChunkRow& row);

/// Writes rows behind the present end.
void append_rows(hid_t dataset, hsize_t present, hsize_t count, const std::vector<hsize_t>& row_size, Element element,
                 const void* values);
void write_all(hid_t dataset, Element element, const void* values);

}  // namespace graupel::io::hdf5
