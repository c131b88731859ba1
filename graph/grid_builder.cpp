#include "graph/grid_builder.h"

#include <atomic>
#include <bit>
#include <cmath>
#include <memory>
#include <string>

#include "core/error.h"
#include "core/parallel_for_in.h"

namespace graupel::graph {

namespace {

constexpr int corners = 8;
constexpr int word_bits = 32;

/// The cells of one level of one scene that may be active, as bits of words.
struct Box {
  Vec3i low, size;     ///< [cells]
  int32_t first_word;  ///< of all words of all levels
};

GRAUPEL_HD bool inside(const Box& box, const Vec3i& cell) {
  for (int d = 0; d < 3; ++d)
    if (cell[d] < box.low[d] || cell[d] >= box.low[d] + box.size[d]) return false;
  return true;
}

/// Bit of a cell inside the box, over all words.
GRAUPEL_HD int64_t bit_of(const Box& box, const Vec3i& cell) {
  const Vec3i at = cell - box.low;
  return int64_t{word_bits} * box.first_word + (int64_t{at[2]} * box.size[1] + at[1]) * box.size[0] + at[0];
}

GRAUPEL_HD int ones(uint32_t word) {
#ifdef __CUDA_ARCH__
  return __popc(word);
#else
  return std::popcount(word);
#endif
}

/// Number of a word's lowest bit that is set.
GRAUPEL_HD int lowest_one(uint32_t word) {
#ifdef __CUDA_ARCH__
  return __ffs(static_cast<int>(word)) - 1;
#else
  return std::countr_zero(word);
#endif
}

GRAUPEL_HD void set_bit(uint32_t* words, int64_t bit) {
  uint32_t& word = words[bit / word_bits];
  const uint32_t mask = 1u << (bit % word_bits);
#ifdef __CUDA_ARCH__
  if ((*static_cast<volatile uint32_t*>(&word) & mask) == 0) atomicOr(&word, mask);
#else
  std::atomic_ref<uint32_t>(word).fetch_or(mask, std::memory_order_relaxed);
#endif
}

GRAUPEL_HD Vec3i corner_of(const Vec3i& base, int corner) {
  return {base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2 & 1)};
}

GRAUPEL_HD Vec3i coarser(const Vec3i& cell) { return {cell[0] >> 1, cell[1] >> 1, cell[2] >> 1}; }

/// The one of `count` ranges that holds item i; begin[r] <= i < begin[r + 1].
GRAUPEL_HD int range_of(const int32_t* begin, int count, int64_t i) {
  int low = 0, high = count;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (begin[middle] <= i ? low : high) = middle;
  }
  return low;
}

/// What all launches see. Box l * scenes + s is that of level l of scene s.
struct GridCells {
  int levels, scenes;
  double inverse_spacing;
  const Box* box;
  const Vec3d* origin;            ///< [scenes]
  const int32_t* particle_begin;  ///< [scenes + 1]
  const int32_t* word_begin;      ///< [levels * scenes + 1] words of each box
  uint32_t* words;
  const int32_t* rank;         ///< [words + 1] bits in the words before each
  const int32_t* level_begin;  ///< [levels + 1]

  GRAUPEL_HD int boxes() const { return levels * scenes; }
  /// Number of an active cell over all levels, or -1.
  GRAUPEL_HD int32_t number_of(const Box& in, const Vec3i& coordinate) const {
    if (!inside(in, coordinate)) return -1;
    const int64_t bit = bit_of(in, coordinate);
    const uint32_t word = words[bit / word_bits], mask = 1u << (bit % word_bits);
    return (word & mask) == 0 ? -1 : rank[bit / word_bits] + ones(word & (mask - 1));
  }
  /// Coordinate that a bit of a word of a box stands for.
  GRAUPEL_HD static Vec3i coordinate_of(const Box& box, int64_t word, int bit) {
    const int place = static_cast<int>(word - box.first_word) * word_bits + bit;
    return box.low + Vec3i{place % box.size[0], place / box.size[0] % box.size[1], place / box.size[0] / box.size[1]};
  }
};

/// Base cell, offset and weights of a particle; marks its eight cells.
struct Locate {
  GridCells k;
  const Vec3f* position;
  float *weight, *offset;
  Vec3i* base;
  int32_t* overflow;
  GRAUPEL_HD void operator()(int64_t p) const {
    const int s = range_of(k.particle_begin, k.scenes, p);
    const Box& box = k.box[s];
    Vec3i cell;
    Vec3f at;
    for (int d = 0; d < 3; ++d) {
      const double u = (static_cast<double>(position[p][d]) - k.origin[s][d]) * k.inverse_spacing - 0.5;
      const double floored = std::floor(u);
      const bool within = floored >= box.low[d] && floored + 1 < box.low[d] + box.size[d];  // false for NaN
      if (!within) *overflow = 1;
      cell[d] = within ? static_cast<int>(floored) : box.low[d];
      at[d] = within ? static_cast<float>(u - floored) : 0.0f;
      offset[3 * p + d] = at[d];
    }
    base[p] = cell;
    for (int c = 0; c < corners; ++c) {
      float w = 1;
      for (int d = 0; d < 3; ++d) w *= c >> d & 1 ? at[d] : 1 - at[d];
      weight[corners * p + c] = w;
      set_bit(k.words, bit_of(box, corner_of(cell, c)));
    }
  }
};

/// Marks the ancestors of the cells of one word of level 0.
struct MarkAncestors {
  GridCells k;
  GRAUPEL_HD void operator()(int64_t w) const {
    const int s = range_of(k.word_begin, k.scenes, w);
    const Box& box = k.box[s];
    for (uint32_t left = k.words[w]; left != 0; left &= left - 1) {
      Vec3i cell = GridCells::coordinate_of(box, w, lowest_one(left));
      for (int l = 1; l < k.levels; ++l) {
        cell = coarser(cell);
        set_bit(k.words, bit_of(k.box[l * k.scenes + s], cell));
      }
    }
  }
};

struct CountBits {
  const uint32_t* words;
  int32_t* count;
  GRAUPEL_HD void operator()(int64_t w) const { count[w] = ones(words[w]); }
};

/// Coordinates and boxes of the cells of a word; the first cells of levels that begin with it.
struct NumberCells {
  GridCells k;
  int32_t* level_begin;
  Vec3i* coordinate;
  int32_t* cell_box;
  GRAUPEL_HD void operator()(int64_t w) const {
    for (int l = 0; l <= k.levels; ++l)
      if (w == k.word_begin[l * k.scenes]) level_begin[l] = k.rank[w];
    if (w == k.word_begin[k.boxes()]) return;
    int32_t number = k.rank[w];
    const int b = range_of(k.word_begin, k.boxes(), w);
    for (uint32_t left = k.words[w]; left != 0; left &= left - 1, ++number) {
      coordinate[number] = GridCells::coordinate_of(k.box[b], w, lowest_one(left));
      cell_box[number] = b;
    }
  }
};

/// Neighbours, parent and octant of a cell; how many edges it receives and how many children it has.
struct LinkCell {
  GridCells k;
  const Vec3i* coordinate;
  const int32_t* cell_box;
  int32_t *neighbor, *parent, *octant, *edges_in, *children_of;
  GRAUPEL_HD void operator()(int64_t i) const {
    const bool active = i < k.level_begin[k.levels];
    int edges = 0, children = 0;
    if (active) {
      const int b = cell_box[i], level = b / k.scenes;
      const Vec3i at = coordinate[i];
      for (int slot = 0; slot < 6; ++slot) {
        Vec3i next = at;
        next[slot / 2] += 2 * (slot & 1) - 1;
        const int32_t number = k.number_of(k.box[b], next);
        neighbor[6 * i + slot] = number < 0 ? -1 : number - k.level_begin[level];
        edges += number >= 0;
      }
      octant[i] = (at[0] & 1) | (at[1] & 1) << 1 | (at[2] & 1) << 2;
      if (level + 1 < k.levels) parent[i] = k.number_of(k.box[b + k.scenes], coarser(at)) - k.level_begin[level + 1];
      if (level > 0)
        for (int c = 0; c < corners; ++c) children += k.number_of(k.box[b - k.scenes], corner_of(at * 2, c)) >= 0;
    }
    edges_in[i] = edges;
    children_of[i] = children;
  }
};

/// Edges that a cell receives, and its children.
struct WriteLinks {
  GridCells k;
  const Vec3i* coordinate;
  const int32_t *cell_box, *neighbor, *edge_begin, *child_begin;
  int32_t *sender, *receiver, *slot, *reverse, *child, *edge_level;
  GRAUPEL_HD void operator()(int64_t i) const {
    if (i <= k.levels) edge_level[i] = edge_begin[k.level_begin[i]];
    if (i >= k.level_begin[k.levels]) return;
    const int b = cell_box[i], level = b / k.scenes;
    const int32_t first_cell = k.level_begin[level], first_edge = edge_begin[first_cell];
    int32_t edge = edge_begin[i];
    for (int from = 0; from < 6; ++from) {
      const int32_t s = neighbor[6 * i + from];
      if (s < 0) continue;
      sender[edge] = s;
      receiver[edge] = static_cast<int32_t>(i) - first_cell;
      slot[edge] = from;
      // Links are mutual: the sender receives the reverse edge through the opposite slot.
      int32_t back = edge_begin[first_cell + s];
      for (int other = 0; other < (from ^ 1); ++other) back += neighbor[6 * (first_cell + s) + other] >= 0;
      reverse[edge] = back - first_edge;
      ++edge;
    }
    if (level == 0) return;
    int32_t place = child_begin[i];
    for (int c = 0; c < corners; ++c) {
      const int32_t number = k.number_of(k.box[b - k.scenes], corner_of(coordinate[i] * 2, c));
      if (number >= 0) child[place++] = number - k.level_begin[level - 1];
    }
  }
};

/// Cells of a particle's pairs, to be sorted.
struct FindPairs {
  GridCells k;
  const Vec3i* base;
  int32_t *cell, *key, *number;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int64_t p = i / corners;
    const int s = range_of(k.particle_begin, k.scenes, p);
    cell[i] = k.number_of(k.box[s], corner_of(base[p], static_cast<int>(i % corners)));
    key[i] = cell[i];
    number[i] = static_cast<int32_t>(i);
  }
};

/// Where the sorted keys of each cell begin.
struct FindSegments {
  int64_t n;
  const int32_t* sorted_key;
  int32_t* begin;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t before = i == 0 ? -1 : sorted_key[i - 1], here = i == n ? before + 1 : sorted_key[i];
    for (int32_t c = before + 1; c <= here; ++c) begin[c] = static_cast<int32_t>(i);
  }
};

constexpr Grain light{.items = 1024};

int bits_for(int64_t values) { return std::bit_width(static_cast<uint64_t>(values > 1 ? values - 1 : 1)); }

Vec3i lowest_corner(const SceneGrid& scene, const Vec3d& x, double spacing) {
  Vec3i cell;
  for (int d = 0; d < 3; ++d) {
    const double floored = std::floor((x[d] - scene.origin[d]) / spacing - 0.5);
    if (!(std::abs(floored) < (1 << 20)))
      throw ConfigError("a scene does not fit the network's grid (" + std::to_string(x[d]) +
                        " m, at most 2^20 cells of " + std::to_string(spacing) +
                        " m from the origin). Make its domain smaller");
    cell[d] = static_cast<int>(floored);
  }
  return cell;
}

template <typename T>
void clear_in(void* stream, Buffer<T>& buffer) {
#ifdef __CUDACC__
  if (buffer.device() == Device::cuda) {
    GRAUPEL_CUDA_CHECK(cudaMemsetAsync(buffer.data(), 0, buffer.size() * sizeof(T), static_cast<cudaStream_t>(stream)));
    return;
  }
#endif
  static_cast<void>(stream);
  buffer.fill_zero();
}

/// Numbers of the device on the host, copied in a stream's order.
class HostCopy {
 public:
  HostCopy() = default;
  HostCopy(const HostCopy&) = delete;
  HostCopy& operator=(const HostCopy&) = delete;
#ifdef __CUDACC__
  ~HostCopy() { cudaFreeHost(locked_); }
#endif
  void copy(const Buffer<int32_t>& from, void* stream) {
    device_ = from.device();
#ifdef __CUDACC__
    if (device_ == Device::cuda) {
      if (locked_size_ < from.size()) {
        cudaFreeHost(locked_);
        locked_ = nullptr;
        GRAUPEL_CUDA_CHECK(cudaMallocHost(&locked_, from.size() * sizeof(int32_t)));
        locked_size_ = from.size();
      }
      GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(locked_, from.data(), from.size() * sizeof(int32_t), cudaMemcpyDeviceToHost,
                                         static_cast<cudaStream_t>(stream)));
      return;
    }
#endif
    static_cast<void>(stream);
    values_ = from.download();
  }
  const int32_t* wait(void* stream) const {
#ifdef __CUDACC__
    if (device_ == Device::cuda) {
      GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(static_cast<cudaStream_t>(stream)));
      return locked_;
    }
#endif
    static_cast<void>(stream);
    return values_.data();
  }

 private:
  Device device_ = Device::cpu;
  std::vector<int32_t> values_;
#ifdef __CUDACC__
  int32_t* locked_ = nullptr;
  std::size_t locked_size_ = 0;
#endif
};

}  // namespace

struct GridBuilder::Arrays {
  explicit Arrays(Device device) : scratch(device) {
    const auto place = [&](auto&... buffer) { ((buffer = std::decay_t<decltype(buffer)>(device, 0)), ...); };
    place(box, origin, particle_begin, word_begin, words, word_count, rank, tally, cell_box, coordinate, neighbor,
          parent, octant, edges_in, edge_begin, sender, receiver, slot, reverse, children_of, child_begin, child, base,
          cell, weight, offset, pair_key, pair_number, sorted_key, pair, pair_begin);
  }
  void resize(int64_t particles, int64_t n_words, int64_t cells, int64_t cells_of_level0, int levels);

  ListScratch scratch;
  Buffer<Box> box;
  Buffer<Vec3d> origin;
  Buffer<int32_t> particle_begin, word_begin;
  Buffer<uint32_t> words;
  Buffer<int32_t> word_count, rank, cell_box;
  Buffer<int32_t> tally;  ///< level_begin, edge_level, overflow: read back after each build
  Buffer<Vec3i> coordinate;
  Buffer<int32_t> neighbor, parent, octant, edges_in, edge_begin, sender, receiver, slot, reverse;
  Buffer<int32_t> children_of, child_begin, child;
  Buffer<Vec3i> base;  ///< [particles] lower corner
  Buffer<int32_t> cell;
  Buffer<float> weight, offset;
  Buffer<int32_t> pair_key, pair_number, sorted_key, pair, pair_begin;
  HostCopy read_back;
  int32_t *level_begin = nullptr, *edge_level = nullptr, *overflow = nullptr;  ///< parts of the tally
};

void GridBuilder::Arrays::resize(int64_t particles, int64_t n_words, int64_t cells, int64_t cells_of_level0,
                                 int levels) {
  const auto resize_all = [](int64_t size, auto&... buffer) {
    (buffer.resize_discard(static_cast<std::size_t>(size)), ...);
  };
  resize_all(n_words, words, word_count);
  resize_all(n_words + 1, rank);
  resize_all(2 * levels + 3, tally);
  level_begin = tally.data();
  edge_level = level_begin + levels + 1;
  overflow = edge_level + levels + 1;
  resize_all(cells, cell_box, coordinate, parent, octant, edges_in, children_of, child);
  resize_all(cells + 1, edge_begin, child_begin);
  resize_all(6 * cells, neighbor, sender, receiver, slot, reverse);
  resize_all(particles, base);
  resize_all(3 * particles, offset);
  resize_all(corners * particles, cell, weight, pair_key, pair_number, sorted_key, pair);
  resize_all(cells_of_level0 + 1, pair_begin);
}

GridBuilder::GridBuilder(Device device, double spacing, int levels, int margin)
    : device_(device), spacing_(spacing), levels_(levels), margin_(margin), arrays_(std::make_unique<Arrays>(device)) {
  GRAUPEL_ASSERT(spacing > 0 && levels >= 1 && levels <= most_levels && margin >= 0);
}
GridBuilder::~GridBuilder() = default;

void GridBuilder::prepare(const std::vector<SceneGrid>& scenes, void* stream) {
  GRAUPEL_ASSERT(!scenes.empty());
  std::vector<Box> boxes;
  std::vector<Vec3d> origins;
  std::vector<int32_t> particle_begin = {0}, word_begin = {0};
  most_cells_ = 0;
  for (int l = 0; l < levels_; ++l) {
    int64_t cells = 0;
    for (const SceneGrid& scene : scenes) {
      Box box{};
      int64_t volume = 1;
      const Vec3i low = lowest_corner(scene, scene.low, spacing_), high = lowest_corner(scene, scene.high, spacing_);
      for (int d = 0; d < 3; ++d) {
        box.low[d] = (low[d] - margin_) >> l;
        box.size[d] = ((high[d] + 1 + margin_) >> l) - box.low[d] + 1;
        volume *= box.size[d];
      }
      box.first_word = word_begin.back();
      const int64_t words = box.first_word + (volume + word_bits - 1) / word_bits;
      if (words > (1 << 25))
        throw ConfigError("the scenes do not fit the network's grid (" + std::to_string(words * word_bits) +
                          " cells, at most 2^30). Use fewer scenes at once or smaller domains");
      word_begin.push_back(static_cast<int32_t>(words));
      boxes.push_back(box);
      cells += std::min(volume, corners * scene.particles);
    }
    if (l == 0) most_level0_ = cells;
    most_cells_ += cells;
  }
  particles_ = 0;
  for (const SceneGrid& scene : scenes) {
    particles_ += scene.particles;
    particle_begin.push_back(static_cast<int32_t>(particles_));
    origins.push_back(scene.origin);
  }
  scenes_ = static_cast<int>(scenes.size());
  words_ = word_begin.back();
  arrays_->resize(particles_, words_, most_cells_, most_level0_, levels_);
  level0_words_ = word_begin[scenes.size()];
  upload_in(stream, arrays_->box, boxes);
  upload_in(stream, arrays_->origin, origins);
  upload_in(stream, arrays_->particle_begin, particle_begin);
  upload_in(stream, arrays_->word_begin, word_begin);
}

void GridBuilder::build(const Vec3f* position, void* stream) {
  Arrays& a = *arrays_;
  const GridCells cells{levels_,
                        scenes_,
                        1 / spacing_,
                        a.box.data(),
                        a.origin.data(),
                        a.particle_begin.data(),
                        a.word_begin.data(),
                        a.words.data(),
                        a.rank.data(),
                        a.level_begin};
  const auto launch = [&](int64_t n, const auto& body) { parallel_for_in(stream, device_, n, body, light); };
  // The cells
  clear_in(stream, a.words);
  clear_in(stream, a.tally);
  launch(particles_, Locate{cells, position, a.weight.data(), a.offset.data(), a.base.data(), a.overflow});
  if (levels_ > 1) launch(level0_words_, MarkAncestors{cells});
  launch(words_, CountBits{a.words.data(), a.word_count.data()});
  running_sums(device_, words_, a.word_count.data(), a.rank.data(), a.scratch, stream);
  launch(words_ + 1, NumberCells{cells, a.level_begin, a.coordinate.data(), a.cell_box.data()});
  // Their links
  launch(most_cells_, LinkCell{cells, a.coordinate.data(), a.cell_box.data(), a.neighbor.data(), a.parent.data(),
                               a.octant.data(), a.edges_in.data(), a.children_of.data()});
  running_sums(device_, most_cells_, a.edges_in.data(), a.edge_begin.data(), a.scratch, stream);
  running_sums(device_, most_cells_, a.children_of.data(), a.child_begin.data(), a.scratch, stream);
  launch(most_cells_ + 1, WriteLinks{cells, a.coordinate.data(), a.cell_box.data(), a.neighbor.data(),
                                     a.edge_begin.data(), a.child_begin.data(), a.sender.data(), a.receiver.data(),
                                     a.slot.data(), a.reverse.data(), a.child.data(), a.edge_level});
  // Their pairs
  const int64_t pairs = corners * particles_;
  launch(pairs, FindPairs{cells, a.base.data(), a.cell.data(), a.pair_key.data(), a.pair_number.data()});
  sort_by_key(device_, pairs, bits_for(most_level0_), a.pair_key.data(), a.pair_number.data(), a.sorted_key.data(),
              a.pair.data(), a.scratch, stream);
  launch(pairs + 1, FindSegments{pairs, a.sorted_key.data(), a.pair_begin.data()});
  a.read_back.copy(a.tally, stream);
}

GridCounts GridBuilder::counts(void* stream) const {
  const int32_t* const cells = arrays_->read_back.wait(stream);
  const int32_t* const edges = cells + levels_ + 1;
  GridCounts counts;
  counts.levels = levels_;
  counts.overflow = edges[levels_ + 1] != 0;
  for (int l = 0; l < levels_; ++l) {
    counts.cells[static_cast<std::size_t>(l)] = cells[l + 1] - cells[l];
    counts.edges[static_cast<std::size_t>(l)] = edges[l + 1] - edges[l];
  }
  return counts;
}

GridLinks GridBuilder::links() const {
  const Arrays& a = *arrays_;
  return {a.level_begin,    a.edge_level,         a.coordinate.data(), a.neighbor.data(), a.parent.data(),
          a.octant.data(),  a.edge_begin.data(),  a.sender.data(),     a.receiver.data(), a.slot.data(),
          a.reverse.data(), a.child_begin.data(), a.child.data(),      a.cell.data(),     a.weight.data(),
          a.offset.data(),  a.pair_begin.data(),  a.pair.data()};
}

}  // namespace graupel::graph
