// graupel-check-hdf5: asks the HDF5 library for all that the readers of trajectories ask it for, in a process that may
// end (core/system/checks/file_check.h): links, attributes, headers of datasets, lists of chunks, first and last
// values.
#define H5_USE_110_API
#include <hdf5.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "core/system/checks/file_check_child.h"

namespace {

constexpr int deepest_group = 4;
constexpr hssize_t most_attribute_values = 4096;
constexpr std::size_t longest_text = std::size_t(1) << 24;
constexpr uint64_t most_sampled = uint64_t(64) << 20;  ///< bytes of the values of a dataset that are read at once
constexpr uint64_t read_whole = uint64_t(1) << 20;     ///< smaller datasets are

herr_t look_for_lack_of_memory(unsigned, const H5E_error2_t* error, void* found) {
  if (error->desc != nullptr && std::strstr(error->desc, "memory allocation failed") != nullptr)
    *static_cast<bool*>(found) = true;
  return 0;
}

/// Whether a call went well. Throws std::bad_alloc where it lacked memory.
template <typename Status>
bool ok(Status status) {
  if (status >= 0) return true;
  bool no_memory = false;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, look_for_lack_of_memory, &no_memory);
  if (no_memory) throw std::bad_alloc();
  return false;
}

class Id {
 public:
  Id(hid_t id, herr_t (*closer)(hid_t)) : id_(id), closer_(closer) { ok(id); }
  ~Id() {
    if (id_ >= 0) closer_(id_);
  }
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;
  operator hid_t() const { return id_; }
  explicit operator bool() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*closer_)(hid_t);
};

herr_t collect_link(hid_t, const char* name, const H5L_info_t* info, void* out) {
  if (info->type == H5L_TYPE_HARD) static_cast<std::vector<std::string>*>(out)->push_back(name);
  return 0;
}

herr_t collect_attribute(hid_t, const char* name, const H5A_info_t*, void* out) {
  static_cast<std::vector<std::string>*>(out)->push_back(name);
  return 0;
}

hid_t memory_number(H5T_class_t kind) { return kind == H5T_FLOAT ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT64; }

void read_attribute(hid_t object, const std::string& name) {
  const Id attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose);
  if (!attribute) return;
  const Id space(H5Aget_space(attribute), H5Sclose), type(H5Aget_type(attribute), H5Tclose);
  if (!space || !type) return;
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (count < 1 || count > most_attribute_values) return;
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_STRING && H5Tis_variable_str(type) > 0) {
    std::vector<char*> texts(static_cast<std::size_t>(count), nullptr);
    ok(H5Aread(attribute, type, texts.data()));
    for (char* text : texts) H5free_memory(text);
  } else if (kind == H5T_STRING && H5Tget_size(type) <= longest_text / static_cast<std::size_t>(count)) {
    std::vector<char> text(H5Tget_size(type) * static_cast<std::size_t>(count));
    ok(H5Aread(attribute, type, text.data()));
  } else if (kind == H5T_INTEGER || kind == H5T_FLOAT) {
    std::vector<int64_t> values(static_cast<std::size_t>(count));
    ok(H5Aread(attribute, memory_number(kind), values.data()));
  }
}

void read_attributes(hid_t object) {
  std::vector<std::string> names;
  ok(H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect_attribute, &names));
  for (const std::string& name : names) read_attribute(object, name);
}

/// Bytes of so many elements of 8 bytes; the largest number where they do not fit it.
uint64_t bytes_of(const std::vector<hsize_t>& size) {
  uint64_t bytes = 8;
  for (const hsize_t n : size)
    if (__builtin_mul_overflow(bytes, n, &bytes)) return std::numeric_limits<uint64_t>::max();
  return bytes;
}

/// Rows [first, first + count), converted as the readers convert them.
void read_rows(hid_t dataset, hid_t space, H5T_class_t kind, std::vector<hsize_t> size, hsize_t first, hsize_t count) {
  std::vector<hsize_t> start(size.size(), 0);
  start[0] = first;
  size[0] = count;
  if (bytes_of(size) > most_sampled) return;
  const Id memory(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose);
  if (!memory || !ok(H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr))) return;
  std::vector<std::byte> values(bytes_of(size));
  ok(H5Dread(dataset, memory_number(kind), memory, space, H5P_DEFAULT, values.data()));
}

/// The chunk at `at` as it is stored.
void read_chunk(hid_t dataset, const std::vector<hsize_t>& at) {
  hsize_t bytes = 0;
  if (!ok(H5Dget_chunk_storage_size(dataset, at.data(), &bytes)) || bytes == 0 || bytes > most_sampled) return;
  std::vector<std::byte> packed(bytes);
  uint32_t filters = 0;
  ok(H5Dread_chunk(dataset, H5P_DEFAULT, at.data(), &filters, packed.data()));
}

void read_chunks(hid_t dataset, hid_t space, const std::vector<hsize_t>& size, const std::vector<hsize_t>& chunk) {
  hsize_t count = 0;
  if (!ok(H5Dget_num_chunks(dataset, space, &count)) || count == 0) return;
  std::vector<hsize_t> last(size.size());
  for (std::size_t d = 0; d < size.size(); ++d) last[d] = size[d] == 0 ? 0 : (size[d] - 1) / chunk[d] * chunk[d];
  read_chunk(dataset, std::vector<hsize_t>(size.size(), 0));
  read_chunk(dataset, last);
  unsigned mask = 0;
  haddr_t address = HADDR_UNDEF;
  hsize_t stored = 0;
  ok(H5Dget_chunk_info_by_coord(dataset, last.data(), &mask, &address, &stored));
}

void read_dataset(hid_t dataset, uint64_t file_size) {
  const Id space(H5Dget_space(dataset), H5Sclose), type(H5Dget_type(dataset), H5Tclose),
      creation(H5Dget_create_plist(dataset), H5Pclose);
  if (!space || !type || !creation) return;
  const int rank = H5Sget_simple_extent_ndims(space);
  const H5T_class_t kind = H5Tget_class(type);
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (rank < 1 || rank > H5S_MAX_RANK || (kind != H5T_FLOAT && kind != H5T_INTEGER)) return;
  if (layout == H5D_VIRTUAL || H5Pget_external_count(creation) != 0) return;  // refused by the readers
  std::vector<hsize_t> size(static_cast<std::size_t>(rank)), chunk(size.size());
  if (!ok(H5Sget_simple_extent_dims(space, size.data(), nullptr)) || H5Dget_storage_size(dataset) > file_size) return;
  if (layout == H5D_CHUNKED && H5Pget_chunk(creation, rank, chunk.data()) != rank) return;
  if (layout == H5D_CHUNKED) {
    if (std::count(chunk.begin(), chunk.end(), 0) > 0 || bytes_of(chunk) > most_sampled) return;
    read_chunks(dataset, space, size, chunk);
  }
  if (size[0] == 0) return;
  if (bytes_of(size) <= read_whole) return read_rows(dataset, space, kind, size, 0, size[0]);
  read_rows(dataset, space, kind, size, 0, 1);
  read_rows(dataset, space, kind, size, size[0] - 1, 1);
}

void read_group(hid_t group, uint64_t file_size, int depth) {
  read_attributes(group);
  std::vector<std::string> names;
  ok(H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect_link, &names));
  for (const std::string& name : names) {
    H5O_info_t info;
    if (!ok(H5Oget_info_by_name2(group, name.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT))) continue;
    const Id object(H5Oopen(group, name.c_str(), H5P_DEFAULT), H5Oclose);
    if (!object) continue;
    const H5I_type_t kind = H5Iget_type(object);
    if (kind == H5I_GROUP && depth < deepest_group) read_group(object, file_size, depth + 1);
    if (kind != H5I_DATASET) continue;
    read_attributes(object);
    read_dataset(object, file_size);
  }
}

void read_file(const std::string& path) {
  const Id file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file) return;
  hsize_t size = 0;
  if (ok(H5Fget_filesize(file, &size))) read_group(file, size, 0);
}

}  // namespace

int main(int argc, char** argv) {
  H5dont_atexit();
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  H5PLset_loading_state(0);
  return graupel::run_checker(argc, argv, [](const std::string& path) {
    try {
      read_file(path);
    } catch (...) {
      H5garbage_collect();
      throw;
    }
    H5garbage_collect();
  });
}
