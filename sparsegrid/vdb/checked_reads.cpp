// Functions of OpenVDB 10's library that trust lengths in files, again, for graupel-check-vdb-library alone: the
// library calls these in place of its own, which write or read beyond their memory where these throw FileOverflows.
// Such damage to a heap may not show until later, in the program.
#include <blosc.h>
#include <dlfcn.h>
#include <malloc.h>
#include <openvdb/Exceptions.h>
#include <openvdb/io/Compression.h>
#include <openvdb/points/StreamCompression.h>
#include <zlib.h>

#include <istream>
#include <memory>

#include "core/system/checks/file_check_child.h"

namespace {

using graupel::FileOverflows;

template <typename T>
T take(std::istream& in) {
  T value{};
  in.read(reinterpret_cast<char*>(&value), sizeof value);
  return value;
}

using Packed = std::unique_ptr<char[]>;

Packed read_packed(std::istream& in, std::size_t size) {
  Packed packed(new char[size]);
  in.read(packed.get(), static_cast<std::streamsize>(size));
  return packed;
}

/// Blosc reads as many bytes as these say themselves.
void require_inside(const char* packed, std::size_t size) {
  std::size_t expanded = 0, stated = 0, block = 0;
  if (size >= BLOSC_MIN_HEADER_LENGTH) blosc_cbuffer_sizes(packed, &expanded, &stated, &block);
  if (size < BLOSC_MIN_HEADER_LENGTH || stated > size) throw FileOverflows();
}

/// Values that are not packed: the library reads as many as are there, and compares their number afterwards.
void read_unpacked(std::istream& in, char* data, int64_t stated, std::size_t size) {
  const std::size_t there = std::size_t(0) - static_cast<std::size_t>(stated);
  if (data == nullptr) {
    in.seekg(static_cast<std::streamoff>(there), std::ios_base::cur);
  } else {
    if (there > size) throw FileOverflows();
    in.read(data, static_cast<std::streamsize>(there));
  }
  if (there != size) OPENVDB_THROW(openvdb::RuntimeError, "a chunk of another size");
}

/// Calls expand(packed, size), which returns the number of bytes that it makes of them.
template <typename Expand>
void read_chunk(std::istream& in, char* data, std::size_t size, Expand&& expand) {
  const auto stated = take<int64_t>(in);
  if (stated <= 0) return read_unpacked(in, data, stated, size);
  const auto bytes = static_cast<std::size_t>(stated);
  if (data == nullptr) {
    in.seekg(stated, std::ios_base::cur);
    return;
  }
  const Packed packed = read_packed(in, bytes);
  if (expand(packed.get(), bytes) != size) OPENVDB_THROW(openvdb::RuntimeError, "a chunk of another size");
}

}  // namespace

namespace openvdb::OPENVDB_VERSION_NAME::io {

__attribute__((visibility("default"))) void bloscFromStream(std::istream& in, char* data, size_t size) {
  read_chunk(in, data, size, [&](const char* packed, std::size_t bytes) {
    require_inside(packed, bytes);
    return static_cast<std::size_t>(blosc_decompress_ctx(packed, data, size, /*numinternalthreads=*/1));
  });
}

__attribute__((visibility("default"))) void unzipFromStream(std::istream& in, char* data, size_t size) {
  read_chunk(in, data, size, [&](const char* packed, std::size_t bytes) {
    uLongf expanded = size;
    uncompress(reinterpret_cast<Bytef*>(data), &expanded, reinterpret_cast<const Bytef*>(packed), bytes);
    return static_cast<std::size_t>(expanded);
  });
}

}  // namespace openvdb::OPENVDB_VERSION_NAME::io

namespace openvdb::OPENVDB_VERSION_NAME::compression {

/// Of metadata. How long `packed` is, only malloc() knows.
__attribute__((visibility("default"))) void bloscDecompress(char* values, std::size_t size, std::size_t room,
                                                            const char* packed) {
  require_inside(packed, ::malloc_usable_size(const_cast<char*>(packed)));
  using Function = void (*)(char*, std::size_t, std::size_t, const char*);
  static const auto of_library = [] {
    const auto here = static_cast<Function>(&bloscDecompress);
    Dl_info symbol{};
    ::dladdr(reinterpret_cast<const void*>(here), &symbol);
    return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, symbol.dli_sname));
  }();
  of_library(values, size, room, packed);
}

}  // namespace openvdb::OPENVDB_VERSION_NAME::compression
