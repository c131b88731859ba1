#include "sparsegrid/vdb/plain_vdb.h"

#include <blosc.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <tuple>
#include <vector>

namespace graupel::sparsegrid {

namespace {

struct NotPlain {};

void require(bool condition) {
  if (!condition) throw NotPlain();
}

/// The file from its begin to its end.
class Bytes {
 public:
  explicit Bytes(std::string_view all) : all_(all) {}

  std::string_view skip(std::size_t size) {
    require(size <= all_.size() - at_);
    at_ += size;
    return all_.substr(at_ - size, size);
  }
  template <typename T>
  T take() {
    T value;
    std::memcpy(&value, skip(sizeof value).data(), sizeof value);
    return value;
  }
  std::string_view text() { return skip(take<uint32_t>()); }
  bool truth() {
    const auto value = take<uint8_t>();
    require(value < 2);
    return value == 1;
  }
  std::size_t place() const { return at_; }
  bool is_at(int64_t place) const { return place >= 0 && static_cast<uint64_t>(place) == at_; }
  std::size_t size() const { return all_.size(); }
  bool is_at_end() const { return at_ == all_.size(); }

 private:
  std::string_view all_;
  std::size_t at_ = 0;
};

enum Compression : uint32_t { zip = 1, active_values = 2, blosc = 4 };

/// Blosc's own count of bytes, and of those that it expands to, are what the file says beside.
void require_blosc(std::string_view packed, std::size_t size, std::size_t room) {
  std::size_t stated = 0;
  require(blosc_cbuffer_validate(packed.data(), packed.size(), &stated) == 0 && stated == size);
  const std::unique_ptr<char[]> values(new char[room]);
  require(blosc_decompress_ctx(packed.data(), values.get(), room, /*numinternalthreads=*/1) ==
          static_cast<int64_t>(size));
}

void require_zip(std::string_view packed, std::size_t size) {
  const std::unique_ptr<Bytef[]> values(new Bytef[size]);
  uLongf expanded = size;
  require(uncompress(values.get(), &expanded, reinterpret_cast<const Bytef*>(packed.data()), packed.size()) == Z_OK &&
          expanded == size);
}

/// An array of `size` bytes when it is expanded.
void read_array(Bytes& in, std::size_t size, uint32_t compression) {
  if ((compression & (zip | blosc)) == 0) {
    in.skip(size);
    return;
  }
  const auto packed = in.take<int64_t>();
  if (packed <= 0) {  // not packed
    require(packed == -static_cast<int64_t>(size));
    in.skip(size);
  } else if ((compression & blosc) != 0) {
    require_blosc(in.skip(static_cast<std::size_t>(packed)), size, size);
  } else {
    require_zip(in.skip(static_cast<std::size_t>(packed)), size);
  }
}

/// An array of an entry of "__delayedload": packed by Blosc, or not.
void read_delayed_array(Bytes& in, uint32_t packed, std::size_t size) {
  if (packed == 0)
    in.skip(size);
  else
    require_blosc(in.skip(packed), size, size + BLOSC_MAX_OVERHEAD);
}

/// Where leaves are in the file, for readers that read them later: a flag and a size of each.
void read_delayed_load(Bytes& in, uint32_t size) {
  if (size == 0) return;
  const std::size_t end = in.place() + size;
  const auto leaves = in.take<uint32_t>();
  require(leaves > 0 && leaves <= in.size() / 64);  // each has its mask in the file
  read_delayed_array(in, in.take<uint32_t>(), leaves);
  if (const auto packed = in.take<uint32_t>(); packed != ~uint32_t(0))
    read_delayed_array(in, packed, leaves * sizeof(int64_t));
  require(in.place() == end);
}

/// Kinds of metadata of a fixed size.
constexpr std::pair<std::string_view, uint32_t> sized[] = {
    {"bool", 1},   {"float", 4},  {"double", 8}, {"int32", 4},   {"int64", 8},  {"vec2i", 8},
    {"vec2s", 8},  {"vec2d", 16}, {"vec3i", 12}, {"vec3s", 12},  {"vec3d", 24}, {"vec4i", 16},
    {"vec4s", 16}, {"vec4d", 32}, {"mat4s", 64}, {"mat4d", 128},
};

/// Whether the grid's metadata say that its values are stored in two bytes each.
bool read_metadata(Bytes& in) {
  bool half = false;
  for (auto count = in.take<uint32_t>(); count > 0; --count) {
    const std::string_view name = in.text(), type = in.text();
    const auto size = in.take<uint32_t>();
    const auto* const kind = std::find_if(std::begin(sized), std::end(sized), [&](auto& k) { return k.first == type; });
    const bool is_half = name == "is_saved_as_half_float";
    require(!name.empty() && (!is_half || type == "bool"));
    if (type == "__delayedload") {
      read_delayed_load(in, size);
    } else if (type == "bool") {
      require(size == 1);
      const bool value = in.truth();
      if (is_half) half = value;
    } else {
      require(type == "string" || (kind != std::end(sized) && kind->second == size));
      in.skip(size);
    }
  }
  return half;
}

constexpr std::pair<std::string_view, std::size_t> maps[] = {
    {"AffineMap", 128},
    {"UnitaryMap", 128},
    {"ScaleMap", 120},
    {"UniformScaleMap", 120},
    {"TranslationMap", 24},
    {"ScaleTranslateMap", 144},
    {"UniformScaleTranslateMap", 144},
};

void read_transform(Bytes& in) {
  const std::string_view type = in.text();
  const auto* const map = std::find_if(std::begin(maps), std::end(maps), [&](auto& m) { return m.first == type; });
  require(map != std::end(maps));
  in.skip(map->second);
}

/// What a tree holds at each place.
struct Values {
  std::string_view tree;
  std::size_t bytes, half_bytes;  ///< half_bytes = bytes where there are no halves
};

constexpr Values kinds[] = {
    {"Tree_float_5_4_3", 4, 2}, {"Tree_double_5_4_3", 8, 2}, {"Tree_vec3s_5_4_3", 12, 6},  {"Tree_vec3d_5_4_3", 24, 6},
    {"Tree_int32_5_4_3", 4, 4}, {"Tree_int64_5_4_3", 8, 8},  {"Tree_vec3i_5_4_3", 12, 12},
};

/// A tree: a root, blocks of 32^3 and 16^3 children or values, leaves of 8^3 values.
class Tree {
 public:
  Tree(Bytes& in, const Values& values, uint32_t compression, bool half)
      : in_(in), values_(values), compression_(compression), half_(half) {}

  void read_topology() {
    require(in_.take<int32_t>() == 1);  // array of values a leaf
    in_.skip(values_.bytes);            // of all places that have none
    const auto tiles = in_.take<uint32_t>(), blocks = in_.take<uint32_t>();
    for (uint32_t i = 0; i < tiles; ++i) {
      in_.skip(sizeof(Place) + values_.bytes);
      in_.truth();
      memory_ += 160;
    }
    Place last{};
    for (uint32_t i = 0; i < blocks; ++i) {
      const auto place = in_.take<Place>();
      for (const int32_t x : place) require((x & 4095) == 0);
      require(i == 0 || last < place);  // the library reads leaves in this order
      last = place;
      read_block<5>();
    }
  }

  void read_leaves() {
    for (const std::string_view mask : leaves_) {
      require(in_.skip(mask.size()) == mask);
      read_values(mask);
    }
  }

  /// Bytes that the tree takes in memory, or a few more.
  uint64_t memory() const { return memory_; }

 private:
  using Place = std::array<int32_t, 3>;

  /// A block of 2^(3 log) children or values, and all below it.
  template <int log>
  void read_block() {
    constexpr std::size_t places = std::size_t(1) << (3 * log);
    const std::string_view children = in_.skip(places / 8);
    if constexpr (log == 3) {
      leaves_.push_back(children);  // a leaf's mask of active values
      memory_ += places * values_.bytes + 256;
    } else {
      memory_ += places * std::max<std::size_t>(values_.bytes, 8) + places / 4 + 256;
      read_values(in_.skip(places / 8));
      for (int n = count(children); n > 0; --n) read_block<log - 1>();
    }
  }

  /// The values of a node whose active ones are in the mask.
  void read_values(std::string_view mask) {
    const auto inactive = in_.take<uint8_t>();  // how values that are not active are stored
    require(inactive <= 6);
    in_.skip(values_.bytes * (inactive == 5 ? 2 : inactive == 2 || inactive == 4 ? 1 : 0));
    if (inactive >= 3 && inactive <= 5) in_.skip(mask.size());
    const bool only_active = (compression_ & active_values) != 0 && inactive != 6;
    const std::size_t stored = only_active ? static_cast<std::size_t>(count(mask)) : 8 * mask.size();
    if (half_ && values_.half_bytes != values_.bytes) {
      if (stored > 0) read_array(in_, stored * values_.half_bytes, compression_);
    } else {
      read_array(in_, stored * values_.bytes, compression_);
    }
  }

  static int count(std::string_view mask) {
    int on = 0;
    for (std::size_t i = 0; i < mask.size(); i += 8) {
      uint64_t word;
      std::memcpy(&word, mask.data() + i, 8);
      on += std::popcount(word);
    }
    return on;
  }

  Bytes& in_;
  const Values& values_;
  uint32_t compression_;
  bool half_;
  std::vector<std::string_view> leaves_;
  uint64_t memory_ = 0;
};

/// A grid that begins, has its values and ends where the file says. Returns the bytes that it takes in memory.
uint64_t read_grid(Bytes& in) {
  constexpr std::string_view half_ending = "_HalfFloat";
  constexpr uint64_t grid_alone = 8192;  // without its tree
  in.text();
  std::string_view type = in.text();
  require(in.text().empty());  // an instance of no other grid
  const bool half = type.ends_with(half_ending);
  if (half) type.remove_suffix(half_ending.size());
  const auto begin = in.take<int64_t>(), values = in.take<int64_t>(), end = in.take<int64_t>();
  const auto* const kind = std::find_if(std::begin(kinds), std::end(kinds), [&](auto& k) { return k.tree == type; });
  require(kind != std::end(kinds) && in.is_at(begin));
  const auto compression = in.take<uint32_t>();
  require(compression <= (zip | active_values | blosc) && read_metadata(in) == half);
  read_transform(in);
  Tree tree(in, *kind, compression, half);
  tree.read_topology();
  require(in.is_at(values));
  tree.read_leaves();
  require(in.is_at(end));
  return tree.memory() + grid_alone;
}

void read_all(Bytes& in) {
  constexpr int64_t magic = 0x56444220;
  constexpr std::size_t uuid = 36;
  require(in.take<int64_t>() == magic);
  const auto format = in.take<uint32_t>();
  require(format >= 222 && format <= 224);
  in.skip(2 * sizeof(uint32_t));  // version of the library that wrote it
  require(in.truth());            // places of grids are there
  in.skip(uuid);
  read_metadata(in);
  uint64_t memory = 0;
  for (auto count = in.take<int32_t>(); count > 0; --count) memory += read_grid(in);
  require(in.is_at_end() && memory <= (uint64_t(64) << 20) + 24 * uint64_t(in.size()));
}

}  // namespace

bool is_plain_vdb(std::string_view file) {
  Bytes in(file);
  try {
    read_all(in);
    return true;
  } catch (const NotPlain&) {
    return false;
  }
}

}  // namespace graupel::sparsegrid
