#include "io/hdf5/deflate.h"

#include <zlib.h>

#include <memory>
#include <new>

#ifdef GRAUPEL_LIBDEFLATE
#include <libdeflate.h>
#endif

namespace graupel::io {

std::vector<std::byte> deflated(std::span<const std::byte> values, int level) {
  uLongf size = static_cast<uLongf>(values.size() + (values.size() + 999) / 1000 + 12);
  std::vector<std::byte> out(size);
  const int status = ::compress2(reinterpret_cast<Bytef*>(out.data()), &size,
                                 reinterpret_cast<const Bytef*>(values.data()), values.size(), level);
  if (status == Z_MEM_ERROR) throw std::bad_alloc();
  out.resize(status == Z_OK ? size : 0);
  return out;
}

#ifdef GRAUPEL_LIBDEFLATE

bool inflate_into(std::span<const std::byte> packed, std::span<std::byte> out) {
  using Decompressor = std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)>;
  thread_local const Decompressor decompressor(libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (!decompressor) throw std::bad_alloc();
  return libdeflate_zlib_decompress(decompressor.get(), packed.data(), packed.size(), out.data(), out.size(),
                                    nullptr) == LIBDEFLATE_SUCCESS;
}

#else

bool inflate_into(std::span<const std::byte> packed, std::span<std::byte> out) {
  uLongf found = static_cast<uLongf>(out.size());
  const int status = ::uncompress(reinterpret_cast<Bytef*>(out.data()), &found,
                                  reinterpret_cast<const Bytef*>(packed.data()), packed.size());
  if (status == Z_MEM_ERROR) throw std::bad_alloc();
  return status == Z_OK && found == out.size();
}

#endif

}  // namespace graupel::io
