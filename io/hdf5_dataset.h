// Datasets of float or integer arrays: created for streaming, opened with distrust, read and written by frames.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/hdf5.h"

namespace graupel::io::hdf5 {

enum class Element { float32, float64, int32, uint8 };

struct DatasetLayout {
  Element element = Element::float32;
  std::vector<hsize_t> size = {};   ///< 0 in the first place: grows
  std::vector<hsize_t> chunk = {};  ///< empty: one block
  int deflate = 0;                  ///< 0..9
  bool checksum = false;            ///< fletcher32 of each chunk, and byte shuffle before deflate
  std::string units = {};
  std::string description = {};
};

Handle create_dataset(hid_t group, const std::string& name, const DatasetLayout& layout);

/// A dataset that was checked: values inside this file, plain numbers, known filters, a believable size.
struct Dataset {
  Handle id;
  std::vector<hsize_t> size;
  std::vector<hsize_t> chunk;  ///< empty when it is not chunked

  /// Rows [first, first + count) of the first dimension. When the last dimension is 2, the values are placed 3 apart
  /// and the third is left alone.
  void read_rows(hsize_t first, hsize_t count, Element element, void* out) const;
  /// Whether the file holds every chunk of the row of chunks that starts at `row`.
  bool has_chunks(hsize_t row) const;
};

enum class NumberKind { real, integer };
/// Opens `name` of `group`; fails unless it is a dataset of `rank` dimensions, of that kind, that a file of `file_size`
/// bytes can hold and that stores nothing elsewhere.
Dataset open_dataset(hid_t group, const std::string& name, int rank, NumberKind kind, uint64_t file_size);

/// Writes rows behind the present end.
void append_rows(hid_t dataset, hsize_t present, hsize_t count, const std::vector<hsize_t>& row_size, Element element,
                 const void* values);
void write_all(hid_t dataset, Element element, const void* values);

}  // namespace graupel::io::hdf5
