#include "io/hdf5/superblock.h"

#include <array>
#include <cstring>
#include <fstream>

#include "io/hdf5/hdf5.h"

namespace graupel::io::hdf5 {

namespace {

// HDF5 File Format Specification 3.0, II.A: signature, version of the superblock, size of offsets; end of file address.
constexpr char signature[] = "\x89HDF\r\n\x1a\n";
constexpr std::size_t version_at = 8, offset_size_at = 13, end_at = 40, read_bytes = 48;

}  // namespace

std::optional<uint64_t> stated_end(const std::string& path) {
  std::array<char, read_bytes> begin;
  if (!std::ifstream(path, std::ios::binary).read(begin.data(), begin.size())) return std::nullopt;
  if (std::memcmp(begin.data(), signature, version_at) != 0 || begin[version_at] != 0 || begin[offset_size_at] != 8)
    return std::nullopt;
  uint64_t end = 0;
  for (std::size_t i = 0; i < 8; ++i) end |= uint64_t(static_cast<unsigned char>(begin[end_at + i])) << 8 * i;
  return end;
}

void state_end(const std::string& path, uint64_t end) {
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(end_at);
  for (int i = 0; i < 8; ++i) file.put(static_cast<char>(end >> 8 * i & 255));
  file.close();
  if (!file) throw Failure("cannot change the copy '" + path + "'");
}

}  // namespace graupel::io::hdf5
