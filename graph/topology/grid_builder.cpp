#include "graph/topology/grid_builder.h"

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "core/parallel/parallel_for_in.h"
#include "core/system/error.h"
#include "graph/topology/grid_at_once.h"
#include "graph/topology/grid_launch.h"

namespace graupel::graph {

using namespace grid;

namespace {

constexpr Grain light{.items = 1024};

/// Numbers that say where levels begin, and whether the grid has overflowed.
std::size_t tally_size(int levels) { return 2 * (static_cast<std::size_t>(levels) + 1) + 1; }

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
  void copy(Device device, const int32_t* from, std::size_t size, void* stream) {
    device_ = device;
#ifdef __CUDACC__
    if (device_ == Device::cuda) {
      if (locked_size_ < size) {
        cudaFreeHost(locked_);
        locked_ = nullptr;
        GRAUPEL_CUDA_CHECK(cudaMallocHost(&locked_, size * sizeof(int32_t)));
        locked_size_ = size;
      }
      GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(locked_, from, size * sizeof(int32_t), cudaMemcpyDeviceToHost,
                                         static_cast<cudaStream_t>(stream)));
      return;
    }
#endif
    static_cast<void>(stream);
    values_.assign(from, from + size);
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
    place(box, origin, particle_begin, word_begin, cleared, rank, cell_box, coordinate, neighbor, parent, octant,
          link_count, link_begin, edge_begin, sender, receiver, slot, reverse, child_begin, child, children, base, cell,
          weight, offset, pair_place, listed, pair, pair_begin, at_once);
  }
  void resize(int64_t particles, int64_t n_words, int64_t cells, int64_t cells_of_level0, int levels, bool edges);

  ListScratch scratch;
  Buffer<Box> box;
  Buffer<Vec3d> origin;
  Buffer<int32_t> particle_begin, word_begin;
  Buffer<int32_t> cleared;  ///< the following parts, zero before each build
  uint32_t* words = nullptr;
  int32_t *level_begin = nullptr, *edge_level = nullptr, *overflow = nullptr;  ///< read back after each build
  int32_t* pair_count = nullptr;
  Buffer<int32_t> rank, cell_box;
  Buffer<Vec3i> coordinate;
  Buffer<LinkCount> link_count, link_begin;
  Buffer<int32_t> neighbor, parent, octant, edge_begin, sender, receiver, slot, reverse;
  Buffer<int32_t> child_begin, child, children;
  Buffer<Vec3i> base;  ///< [particles] lower corner
  Buffer<int32_t> cell;
  Buffer<float> weight, offset;
  Buffer<int32_t> pair_place, listed, pair, pair_begin;
  Buffer<int32_t> at_once;  ///< pairs by bit and by word of level 0, and one more (graph/topology/grid_at_once.h)
  HostCopy read_back;
};

void GridBuilder::Arrays::resize(int64_t particles, int64_t n_words, int64_t cells, int64_t cells_of_level0, int levels,
                                 bool edges) {
  const auto resize_all = [](int64_t size, auto&... buffer) {
    (buffer.resize_discard(static_cast<std::size_t>(size)), ...);
  };
  resize_all(n_words + static_cast<int64_t>(tally_size(levels)) + cells_of_level0 + 1, cleared);
  words = reinterpret_cast<uint32_t*>(cleared.data());
  level_begin = cleared.data() + n_words;
  edge_level = level_begin + levels + 1;
  overflow = edge_level + levels + 1;
  pair_count = overflow + 1;
  resize_all(n_words + 1, rank);
  resize_all(cells, cell_box, coordinate, parent, octant);
  resize_all(6 * cells, neighbor);
  resize_all(corners * cells, children);
  if (edges) {
    resize_all(cells, child);
    resize_all(cells + 1, link_count, link_begin, edge_begin, child_begin);
    resize_all(6 * cells, sender, receiver, slot, reverse);
  }
  resize_all(particles, base);
  resize_all(3 * particles, offset);
  resize_all(corners * particles, cell, weight, pair_place, listed, pair);
  resize_all(cells_of_level0 + 1, pair_begin);
}

GridBuilder::GridBuilder(Device device, double spacing, int levels, int margin, bool with_edges, GridLaunch at_once)
    : device_(device),
      spacing_(spacing),
      levels_(levels),
      margin_(margin),
      with_edges_(with_edges),
      wanted_launch_(std::move(at_once)),
      arrays_(std::make_unique<Arrays>(device)) {
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
  arrays_->resize(particles_, words_, most_cells_, most_level0_, levels_, with_edges_);
  upload_in(stream, arrays_->box, boxes);
  upload_in(stream, arrays_->origin, origins);
  upload_in(stream, arrays_->particle_begin, particle_begin);
  upload_in(stream, arrays_->word_begin, word_begin);
  fine_words_ = word_begin[static_cast<std::size_t>(scenes_)];
  launch_ = wanted_launch_;
  if (!launch_ && device_ == Device::cuda && builds_grid_at_once(scenes_, words_)) launch_ = build_grid;
  if (!launch_) return;
  arrays_->at_once.resize_discard(static_cast<std::size_t>((word_bits + 1) * fine_words_ + 1));
  clear_in(stream, arrays_->at_once);
  clear_in(stream, arrays_->cleared);
}

void GridBuilder::build(const Vec3f* position, void* stream, bool with_counts) {
  Arrays& a = *arrays_;
  const GridCells cells{
      levels_, scenes_,       1 / spacing_, a.box.data(), a.origin.data(), a.particle_begin.data(), a.word_begin.data(),
      a.words, a.rank.data(), a.level_begin};
  const auto launch = [&](int64_t n, const auto& body) { parallel_for_in(stream, device_, n, body, light); };
  const int64_t bits = words_ * word_bits, pairs = corners * particles_;
  const Locate locate{cells, position, a.weight.data(), a.offset.data(), a.base.data(), a.overflow};
  const LinkCell link{cells,
                      bits,
                      a.level_begin,
                      a.coordinate.data(),
                      a.cell_box.data(),
                      a.neighbor.data(),
                      a.parent.data(),
                      a.octant.data(),
                      a.children.data(),
                      with_edges_ ? a.link_count.data() : nullptr};
  const FindPairs find{cells, a.base.data(), a.cell.data(), a.pair_place.data(), a.pair_count};
  const ListPairs list{a.cell.data(), a.pair_place.data(), a.pair_begin.data(), a.listed.data()};
  const OrderPairs order{a.cell.data(), a.pair_begin.data(), a.listed.data(), a.pair.data()};
  if (launch_) {
    int32_t* const bit_pairs = a.at_once.data();
    int32_t* const word_pairs = bit_pairs + word_bits * fine_words_;
    launch_({particles_, words_, fine_words_, position, a.weight.data(), a.offset.data(), bit_pairs, word_pairs,
             word_pairs + fine_words_, a.rank.data(), link, a.cell.data(), a.pair_place.data(), a.pair_begin.data(),
             a.listed.data(), a.pair.data(), a.overflow},
            stream);
  } else {
    clear_in(stream, a.cleared);
    launch(particles_, locate);
    count_bits(device_, words_, a.words, a.rank.data(), a.scratch, stream);
    launch(bits + pairs, Both<LinkCell, FindPairs>{bits, link, find});
    prefix_sums(device_, most_level0_, a.pair_count, a.pair_begin.data(), a.scratch, stream, a.level_begin + 1);
    launch(pairs, list);
    launch(pairs, order);
  }
  if (with_edges_) {
    prefix_sums(device_, most_cells_, a.link_count.data(), a.link_begin.data(), a.scratch, stream,
                a.level_begin + levels_);
    launch(most_cells_ + 1,
           WriteLinks{cells, a.cell_box.data(), a.neighbor.data(), a.children.data(), a.link_begin.data(),
                      a.edge_begin.data(), a.child_begin.data(), a.sender.data(), a.receiver.data(), a.slot.data(),
                      a.reverse.data(), a.child.data(), a.edge_level});
  }
  if (with_counts) a.read_back.copy(device_, a.level_begin, tally_size(levels_), stream);
}

GridCounts GridBuilder::counts(void* stream) const {
  const int32_t* const cells = arrays_->read_back.wait(stream);
  const int32_t* const edges = cells + levels_ + 1;
  GridCounts counts;
  counts.levels = levels_;
  counts.overflow = edges[levels_ + 1] != 0;
  GRAUPEL_ASSERT(cells[levels_] <= most_cells_);
  for (int l = 0; l < levels_; ++l) {
    GRAUPEL_ASSERT(cells[l] <= cells[l + 1] && edges[l] <= edges[l + 1]);
    counts.cells[static_cast<std::size_t>(l)] = cells[l + 1] - cells[l];
    counts.edges[static_cast<std::size_t>(l)] = edges[l + 1] - edges[l];
  }
  return counts;
}

GridLinks GridBuilder::links() const {
  const Arrays& a = *arrays_;
  return {a.level_begin,    a.edge_level,         a.coordinate.data(), a.neighbor.data(), a.parent.data(),
          a.octant.data(),  a.edge_begin.data(),  a.sender.data(),     a.receiver.data(), a.slot.data(),
          a.reverse.data(), a.child_begin.data(), a.child.data(),      a.children.data(), a.cell.data(),
          a.weight.data(),  a.offset.data(),      a.pair_begin.data(), a.pair.data(),     a.overflow};
}

}  // namespace graupel::graph
