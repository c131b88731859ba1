// Creating, checking, reading and writing HDF5 datasets.
#include "io/hdf5_dataset.h"

#include <algorithm>
#include <limits>

namespace graupel::io::hdf5 {

namespace {

constexpr uint64_t largest_chunk = uint64_t(1) << 30;
constexpr uint64_t largest_ratio = 1100;  // deflate shrinks at most 1032 times
constexpr std::size_t read_cache = std::size_t(16) << 20;

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
  return dataset;
}

void Dataset::read_rows(hsize_t first, hsize_t count, Element element, void* out) const {
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
