#include "tests/fuzz/byte_mutator.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "tests/fuzz/fuzz_target.h"

namespace graupel::fuzz {

namespace {

Random& draws() {
  static Random random(1);
  return random;
}

std::size_t below(std::size_t n) { return n == 0 ? 0 : draws()() % n; }

/// Integers and floats at the edges of what they can be, as bytes of a file.
void overwrite_by_edge(std::string& bytes) {
  static constexpr std::array<uint64_t, 10> edges = {0,
                                                     1,
                                                     0x7f,
                                                     0xff,
                                                     0x7fff'ffff,
                                                     0xffff'ffff,
                                                     0x7fff'ffff'ffff'ffff,
                                                     0xffff'ffff'ffff'ffff,
                                                     0x7f80'0000,             // infinity in 32 bits
                                                     0x7ff0'0000'0000'0000};  // and in 64
  const uint64_t edge = edges[below(edges.size())];
  const std::size_t width = std::size_t(1) << below(4);
  if (bytes.size() < width) return;
  std::memcpy(bytes.data() + below(bytes.size() - width + 1), &edge, width);
}

void mutate_once(std::string& bytes, std::size_t most) {
  const std::size_t at = below(bytes.size());
  const std::size_t length = 1 + below(std::min<std::size_t>(bytes.size() - at, 64));
  switch (below(6)) {
    case 0:
      if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
      break;
    case 1:
      if (!bytes.empty()) bytes[at] = static_cast<char>(below(256));
      break;
    case 2:
      overwrite_by_edge(bytes);
      break;
    case 3:
      bytes.erase(at, length);
      break;
    case 4:
      if (bytes.size() + length <= most) bytes.insert(below(bytes.size() + 1), bytes.substr(at, length));
      break;
    default:
      if (!bytes.empty()) bytes.replace(below(bytes.size() - length + 1), length, bytes.substr(at, length));
  }
}

}  // namespace

void seed_byte_mutations(uint32_t seed) { draws().seed(seed); }

std::string mutate_bytes(std::string bytes, std::size_t most) {
  bytes.resize(std::min(bytes.size(), most));
  const std::size_t times = 1 + below(4);
  for (std::size_t k = 0; k < times; ++k) mutate_once(bytes, most);
  return bytes;
}

}  // namespace graupel::fuzz
