// Creating, checking, reading and writing HDF5 datasets.
#include "io/hdf5/hdf5_dataset.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/parallel/parallel_for.h"

namespace graupel::io::hdf5 {

namespace {

constexpr uint64_t largest_chunk = uint64_t(1) << 30;
constexpr uint64_t largest_ratio = 1100;  // deflate shrinks at most 1032 times
constexpr std::size_t read_cache = std::size_t(16) << 20;
constexpr const char* missing_chunk = "a chunk is missing";
constexpr std::size_t chunks_at_once = 32;
constexpr uint64_t most_expanded = uint64_t(64) << 20;  // bytes of one row of chunks that are kept

hid_t memory_type(Element element) {
  return element == Element::float32   ? H5T_NATIVE_FLOAT
         : element == Element::float64 ? H5T_NATIVE_DOUBLE
         : element == Element::uint8   ? H5T_NATIVE_UINT8
                                       : H5T_NATIVE_INT32;
}

hid_t stored_type(Element element) {
  return element == Element::float32   ? H5T_IEEE_F32LE
         : element == Element::float64 ? H5T_IEEE_F64LE
         : element == Element::uint8   ? H5T_STD_U8LE
                                       : H5T_STD_I32LE;
}

Handle make_space(const std::vector<hsize_t>& size, const hsize_t* most = nullptr) {
  return {H5Screate_simple(static_cast<int>(size.size()), size.data(), most), H5Sclose, "cannot make an HDF5 space"};
}

Handle creation_properties(const DatasetLayout& layout) {
  const char* what = "cannot set up a dataset";
  Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, what);
  check(H5Pset_obj_track_times(creation, false), what);
  if (layout.chunk.empty()) return creation;
  check(H5Pset_chunk(creation, static_cast<int>(layout.chunk.size()), layout.chunk.data()), what);
  const double zero = 0;  // unused ends of chunks are zeros, so that the same content gives the same bytes
  check(H5Pset_fill_value(creation, H5T_NATIVE_DOUBLE, &zero), what);
  check(H5Pset_fill_time(creation, H5D_FILL_TIME_ALLOC), what);
  if (layout.early) check(H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY), what);
  if (layout.checksum) check(H5Pset_shuffle(creation), what);
  if (layout.deflate > 0) check(H5Pset_deflate(creation, static_cast<unsigned>(layout.deflate)), what);
  if (layout.checksum) check(H5Pset_fletcher32(creation), what);
  return creation;
}

/// Product that fails instead of wrapping around.
uint64_t product(const std::vector<hsize_t>& factors, uint64_t start, const std::string& name) {
  uint64_t value = start;
  for (const hsize_t factor : factors)
    if (__builtin_mul_overflow(value, factor, &value)) throw Failure("the size of '" + name + "' is not believable");
  return value;
}

void check_filters(hid_t creation, const std::string& name) {
  const int filters = check(H5Pget_nfilters(creation), "cannot read filters");
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    const auto filter =
        check(H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, &config),
              "cannot read filters");
    if (filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_FLETCHER32)
      throw Failure("'" + name + "' uses HDF5 filter " + std::to_string(filter) +
                    ", which is not read (shuffle, deflate and fletcher32 are; h5repack -f GZIP=1 converts)");
  }
}

/// Everything lies in this file, in chunks or one block.
std::vector<hsize_t> check_storage(hid_t creation, const std::string& name, int rank) {
  if (check(H5Pget_external_count(creation), "cannot read the storage") > 0)
    throw Failure("'" + name + "' keeps its values in another file, which is refused");
  const H5D_layout_t layout = check(H5Pget_layout(creation), "cannot read the storage");
  if (layout == H5D_VIRTUAL) throw Failure("'" + name + "' is a view of other datasets, which is refused");
  check_filters(creation, name);
  std::vector<hsize_t> chunk;
  if (layout == H5D_CHUNKED) {
    chunk.resize(static_cast<std::size_t>(rank));
    if (H5Pget_chunk(creation, rank, chunk.data()) != rank) throw Failure("'" + name + "' has damaged chunks");
  }
  return chunk;
}

/// The filters of a dataset, where they are those of ExpandedChunk in its order.
std::optional<ChunkFilters> known_filters(hid_t creation, std::size_t element_bytes) {
  constexpr H5Z_filter_t order[] = {H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE, H5Z_FILTER_FLETCHER32};
  ChunkFilters found{.element_bytes = element_bytes, .shuffle = false, .deflate = 0, .checksum = false};
  const int count = check(H5Pget_nfilters(creation), "cannot read filters");
  const H5Z_filter_t* next = std::begin(order);
  for (int i = 0; i < count; ++i) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    const auto filter =
        check(H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, &config),
              "cannot read filters");
    next = std::find(next, std::end(order), filter);
    if (next == std::end(order)) return std::nullopt;
    ++next;
    found.shuffle = found.shuffle || filter == H5Z_FILTER_SHUFFLE;
    found.checksum = found.checksum || filter == H5Z_FILTER_FLETCHER32;
    if (filter == H5Z_FILTER_DEFLATE) found.deflate = 1;
  }
  return found;
}

/// The element type that a dataset stores just as memory holds it.
std::optional<Element> plain_element(hid_t dataset) {
  const Handle type(H5Dget_type(dataset), H5Tclose, "cannot read a type");
  for (const Element element : {Element::float32, Element::float64, Element::int32, Element::uint8})
    if (H5Tequal(type, stored_type(element)) > 0 && H5Tequal(memory_type(element), stored_type(element)) > 0)
      return element;
  return std::nullopt;
}

std::size_t bytes_of(Element element) { return element == Element::uint8 ? 1 : element == Element::float64 ? 8 : 4; }

/// Bytes of one row of `size` elements each.
std::size_t row_bytes(const std::vector<hsize_t>& row_size, std::size_t element_bytes) {
  std::size_t bytes = element_bytes;
  for (const hsize_t n : row_size) bytes *= n;
  return bytes;
}

std::vector<hsize_t> check_shape(hid_t dataset, const std::string& name, int rank) {
  const Handle space(H5Dget_space(dataset), H5Sclose, "cannot read a size");
  if (H5Sis_simple(space) <= 0 || H5Sget_simple_extent_ndims(space) != rank)
    throw Failure("'" + name + "' does not have " + std::to_string(rank) + " dimensions");
  std::vector<hsize_t> size(static_cast<std::size_t>(rank));
  check(H5Sget_simple_extent_dims(space, size.data(), nullptr), "cannot read a size");
  return size;
}

std::size_t check_type(hid_t dataset, const std::string& name, NumberKind kind) {
  const Handle type(H5Dget_type(dataset), H5Tclose, "cannot read a type");
  const H5T_class_t found = H5Tget_class(type);
  if (found != (kind == NumberKind::real ? H5T_FLOAT : H5T_INTEGER))
    throw Failure("'" + name + "' does not hold " + (kind == NumberKind::real ? "real" : "whole") + " numbers");
  const std::size_t bytes = H5Tget_size(type);
  if (bytes == 0 || bytes > 8) throw Failure("'" + name + "' holds numbers of a size that is not read");
  return bytes;
}

}  // namespace

Handle create_dataset(hid_t group, const std::string& name, const DatasetLayout& layout) {
  std::vector<hsize_t> most = layout.size;
  if (!most.empty() && most[0] == 0) most[0] = H5S_UNLIMITED;
  const Handle space = make_space(layout.size, most.data());
  const Handle creation = creation_properties(layout);
  const std::string what = "cannot create '" + name + "'";
  Handle dataset(
      H5Dcreate2(group, name.c_str(), stored_type(layout.element), space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose,
      what.c_str());
  write_attribute(dataset, "units", layout.units);
  write_attribute(dataset, "description", layout.description);
  return dataset;
}

Dataset open_dataset(hid_t group, const std::string& name, int rank, NumberKind kind, uint64_t file_size) {
  H5L_info_t link;
  check(H5Lget_info(group, name.c_str(), &link, H5P_DEFAULT), ("it lacks '" + name + "'").c_str());
  if (link.type != H5L_TYPE_HARD) throw Failure("'" + name + "' is a link that leads elsewhere, which is refused");
  const Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose, "cannot set up HDF5");
  check(H5Pset_chunk_cache(access, 521, read_cache, 1.0), "cannot set up HDF5");
  Dataset dataset;
  const std::string what = "cannot open '" + name + "' as a dataset";
  dataset.id = Handle(H5Dopen2(group, name.c_str(), access), H5Dclose, what.c_str());
  const Handle creation(H5Dget_create_plist(dataset.id), H5Pclose, "cannot read the storage");
  dataset.size = check_shape(dataset.id, name, rank);
  dataset.chunk = check_storage(creation, name, rank);
  const std::size_t bytes = check_type(dataset.id, name, kind);
  const uint64_t limit = std::numeric_limits<uint64_t>::max() / largest_ratio;
  if (product(dataset.size, bytes, name) / largest_ratio > std::min(file_size, limit) ||
      H5Dget_storage_size(dataset.id) > file_size)
    throw Failure("'" + name + "' claims more values than the file can hold");
  if (!dataset.chunk.empty() && product(dataset.chunk, bytes, name) > largest_chunk)
    throw Failure("'" + name + "' has chunks that are too large (at most 1 GiB)");
  dataset.plain_type = plain_element(dataset.id);
  if (!dataset.chunk.empty() && dataset.plain_type) dataset.filters = known_filters(creation, bytes);
  return dataset;
}

bool Dataset::expands_chunks(Element element) const {
  if (!filters || plain_type != element || size.size() < 2) return false;
  // Only the second dimension (particles) may be split, and a row of chunks is kept whole.
  const std::vector<hsize_t> row(size.begin() + 1, size.end());
  const uint64_t bytes = chunk[0] * row_bytes(row, bytes_of(element));
  return bytes <= most_expanded && std::equal(size.begin() + 2, size.end(), chunk.begin() + 2);
}

/// Of one place of the second dimension.
std::size_t Dataset::particle_bytes() const {
  const std::vector<hsize_t> row_size(size.begin() + 1, size.end());
  return row_bytes(row_size, bytes_of(*plain_type)) / std::max<hsize_t>(size[1], 1);
}

/// A chunk as the file has it; false when the file does not hold it.
bool Dataset::read_chunk(hsize_t row, hsize_t second, FilteredChunk& packed) const {
  std::vector<hsize_t> at(size.size(), 0);
  at[0] = row;
  at[1] = second;
  hsize_t bytes = 0;
  if (H5Dget_chunk_storage_size(id, at.data(), &bytes) < 0 || bytes == 0) {
    if (is_whole) throw Failure(missing_chunk);
    return false;
  }
  if (bytes > 2 * chunk[0] * chunk[1] * particle_bytes() + 64)
    throw Failure("a chunk claims more bytes than its values have");
  packed.bytes.resize(bytes);
  check(H5Dread_chunk(id, H5P_DEFAULT, at.data(), &packed.skipped, packed.bytes.data()), "cannot read values");
  return true;
}

/// Reads the row of chunks that starts at `row`; false when the file does not hold all of it.
bool Dataset::expand_chunks(hsize_t row) const {
  if (expanded_row_ == row) return true;
  expanded_row_.reset();
  const std::size_t particle = particle_bytes(), line = particle * size[1], chunk_line = particle * chunk[1];
  expanded_.resize(chunk[0] * line);
  for (hsize_t second = 0; second < size[1]; second += chunk[1]) {
    FilteredChunk packed;
    if (!read_chunk(row, second, packed)) return false;
    const ExpandedChunk values(packed, *filters, chunk[0] * chunk_line);
    const std::size_t here = particle * std::min(chunk[1], size[1] - second);
    for (hsize_t r = 0; r < chunk[0]; ++r)
      values.copy(r * chunk_line, {expanded_.data() + r * line + second * particle, here});
  }
  expanded_row_ = row;
  return true;
}

/// Rows straight to `out`: a few chunks at a time are read, then expanded by all threads. False when the file does not
/// hold one of them.
bool Dataset::expand_rows(hsize_t first, hsize_t count, std::byte* out) const {
  struct Task {
    hsize_t row, second;
    FilteredChunk packed;
  };
  const std::size_t particle = particle_bytes(), line = particle * size[1], chunk_line = particle * chunk[1];
  std::vector<Task> tasks;
  for (hsize_t row = first - first % chunk[0]; row < first + count; row += chunk[0])
    for (hsize_t second = 0; second < size[1]; second += chunk[1]) tasks.push_back({row, second, {}});
  const auto place = [&](Task& task) {
    const ExpandedChunk values(task.packed, *filters, chunk[0] * chunk_line);
    const std::size_t here = particle * std::min(chunk[1], size[1] - task.second);
    const hsize_t begin = std::max(task.row, first), end = std::min(task.row + chunk[0], first + count);
    for (hsize_t r = begin; r < end; ++r)
      values.copy((r - task.row) * chunk_line, {out + (r - first) * line + task.second * particle, here});
    task.packed = {};
  };
  for (std::size_t begin = 0; begin < tasks.size(); begin += chunks_at_once) {
    const std::size_t end = std::min(tasks.size(), begin + chunks_at_once);
    for (std::size_t i = begin; i < end; ++i)
      if (!read_chunk(tasks[i].row, tasks[i].second, tasks[i].packed)) return false;
    parallel_for_cpu(
        static_cast<int64_t>(end - begin), [&](int64_t i) { place(tasks[begin + static_cast<std::size_t>(i)]); },
        Grain{1});
  }
  return true;
}

void Dataset::read_rows(hsize_t first, hsize_t count, Element element, void* out) const {
  const bool expands = expands_chunks(element) && !(size.size() == 3 && size[2] == 2);
  if (expands && count >= chunk[0] && first + count <= size[0] &&
      expand_rows(first, count, static_cast<std::byte*>(out)))
    return;
  for (auto* to = static_cast<std::byte*>(out); expands && count > 0; ++first, --count) {
    if (first >= size[0] || !expand_chunks(first - first % chunk[0])) break;
    const std::size_t line = expanded_.size() / chunk[0];
    std::memcpy(to, expanded_.data() + (first % chunk[0]) * line, line);
    out = to += line;
  }
  if (count == 0) return;
  check_chunks(first, count);
  std::vector<hsize_t> start(size.size(), 0), extent = size, memory_size;
  start[0] = first;
  extent[0] = count;
  memory_size = extent;
  if (size.size() == 3 && size[2] == 2) memory_size[2] = 3;
  const Handle file_space(H5Dget_space(id), H5Sclose, "cannot read values");
  check(H5Sselect_hyperslab(file_space, H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr),
        "cannot read values");
  const Handle memory_space = make_space(memory_size);
  const std::vector<hsize_t> origin(size.size(), 0);
  check(H5Sselect_hyperslab(memory_space, H5S_SELECT_SET, origin.data(), nullptr, extent.data(), nullptr),
        "cannot read values");
  check(H5Dread(id, memory_type(element), memory_space, file_space, H5P_DEFAULT, out), "cannot read values");
}

void Dataset::check_chunks(hsize_t first, hsize_t count) const {
  if (!is_whole || chunk.empty()) return;
  for (hsize_t row = first - first % chunk[0]; row < std::min(first + count, size[0]); row += chunk[0])
    if (!has_chunks(row)) throw Failure(missing_chunk);
}

hsize_t Dataset::missing_chunks() const {
  if (chunk.empty()) {
    H5D_space_status_t status = H5D_SPACE_STATUS_ERROR;
    check(H5Dget_space_status(id, &status), "cannot read the storage");
    return status == H5D_SPACE_STATUS_NOT_ALLOCATED && std::count(size.begin(), size.end(), 0) == 0 ? 1 : 0;
  }
  hsize_t expected = 1, there = 0;
  for (std::size_t d = 0; d < size.size(); ++d) expected *= (size[d] + chunk[d] - 1) / chunk[d];
  const Handle space(H5Dget_space(id), H5Sclose, "cannot read a size");  // HDF5 1.10 takes no H5S_ALL here
  if (H5Dget_num_chunks(id, space, &there) < 0) throw Failure("cannot read the list of chunks");
  return expected > there ? expected - there : 0;
}

bool Dataset::has_chunks(hsize_t row) const {
  if (chunk.empty()) return true;
  std::vector<hsize_t> at(size.size(), 0);
  at[0] = row - row % chunk[0];
  // Only the second dimension (particles) is ever split further.
  for (hsize_t second = 0; second<(size.size() > 1 ? size[1] : 1); second += size.size()> 1 ? chunk[1] : 1) {
    if (size.size() > 1) at[1] = second;
    unsigned mask = 0;
    haddr_t address = HADDR_UNDEF;
    hsize_t stored = 0;
    if (H5Dget_chunk_info_by_coord(id, at.data(), &mask, &address, &stored) < 0) return false;
    if (address == HADDR_UNDEF || stored == 0) return false;
  }
  return true;
}

ChunkRow filter_rows(const std::vector<const void*>& rows, const std::vector<hsize_t>& row_size,
                     const std::vector<hsize_t>& chunk, const ChunkFilters& filters) {
  ChunkRow out;
  out.count = rows.size();
  const std::size_t particle = row_bytes(row_size, filters.element_bytes) / row_size[0];
  const std::size_t chunk_line = particle * chunk[1];
  for (hsize_t start = 0; start < row_size[0]; start += chunk[1]) out.start.push_back(start);
  out.chunks.resize(out.start.size());
  const auto filter = [&](int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    std::vector<std::byte> values(chunk[0] * chunk_line);
    const std::size_t here = particle * std::min(chunk[1], row_size[0] - out.start[i]);
    for (std::size_t r = 0; r < rows.size(); ++r)
      std::memcpy(values.data() + r * chunk_line, static_cast<const std::byte*>(rows[r]) + out.start[i] * particle,
                  here);
    out.chunks[i] = filter_chunk(values, filters);
  };
  parallel_for_cpu(static_cast<int64_t>(out.chunks.size()), filter, Grain{1});
  return out;
}

void append_chunks(hid_t dataset, hsize_t present, const std::vector<hsize_t>& row_size, const ChunkRow& row) {
  std::vector<hsize_t> total = row_size, at(row_size.size() + 1, 0);
  total.insert(total.begin(), present + row.count);
  check(H5Dset_extent(dataset, total.data()), "cannot extend a dataset");
  at[0] = present;
  for (std::size_t i = 0; i < row.chunks.size(); ++i) {
    at[1] = row.start[i];
    const FilteredChunk& packed = row.chunks[i];
    check(H5Dwrite_chunk(dataset, H5P_DEFAULT, packed.skipped, at.data(), packed.bytes.size(), packed.bytes.data()),
          "cannot write values");
  }
}

void append_rows(hid_t dataset, hsize_t present, hsize_t count, const std::vector<hsize_t>& row_size, Element element,
                 const void* values) {
  std::vector<hsize_t> total = {present + count}, start = {present}, extent = {count};
  for (const hsize_t n : row_size) {
    total.push_back(n);
    start.push_back(0);
    extent.push_back(n);
  }
  check(H5Dset_extent(dataset, total.data()), "cannot extend a dataset");
  const Handle file_space(H5Dget_space(dataset), H5Sclose, "cannot write values");
  check(H5Sselect_hyperslab(file_space, H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr),
        "cannot write values");
  const Handle memory_space = make_space(extent);
  check(H5Dwrite(dataset, memory_type(element), memory_space, file_space, H5P_DEFAULT, values), "cannot write values");
}

void write_all(hid_t dataset, Element element, const void* values) {
  check(H5Dwrite(dataset, memory_type(element), H5S_ALL, H5S_ALL, H5P_DEFAULT, values), "cannot write values");
}

}  // namespace graupel::io::hdf5
