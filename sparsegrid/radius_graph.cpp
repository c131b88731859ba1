#include "sparsegrid/radius_graph.h"

#include <algorithm>
#include <limits>
#include <string>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "sparsegrid/cell_list.h"

namespace graupel::sparsegrid {

namespace {

/// Cells are a little wider than the radius, so that the rounding of x / size never parts a pair by two cells.
constexpr double cell_margin = 1 + 1e-6;
constexpr int64_t block = 64;  ///< receivers that a thread takes at a time

/// Finds the senders of a receiver.
class Neighbourhood {
 public:
  Neighbourhood(const std::vector<Vec3f>& position, double radius, SelfEdges self)
      : position_(position), cells_(position, radius * cell_margin), radius2_(radius * radius), self_(self) {}

  /// Appends the senders of r, ascending.
  void append(int32_t r, std::vector<int32_t>& senders) const {
    const auto first = static_cast<std::ptrdiff_t>(senders.size());
    const Vec3i& home = cells_.cell(cells_.cell_of(static_cast<std::size_t>(r)));
    for (int z = -1; z <= 1; ++z)
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) append_cell(cells_.find(home + Vec3i{x, y, z}), r, senders);
    if (!std::is_sorted(senders.begin() + first, senders.end())) std::sort(senders.begin() + first, senders.end());
  }

 private:
  void append_cell(int32_t cell, int32_t r, std::vector<int32_t>& senders) const {
    if (cell < 0) return;
    const Vec3d x = position_[static_cast<std::size_t>(r)].cast<double>();
    for (int32_t i = cells_.begin(cell); i < cells_.begin(cell + 1); ++i) {
      const int32_t s = cells_.point()[static_cast<std::size_t>(i)];
      if (norm2(position_[static_cast<std::size_t>(s)].cast<double>() - x) <= radius2_ &&
          (s != r || self_ == SelfEdges::with))
        senders.push_back(s);
    }
  }

  const std::vector<Vec3f>& position_;
  CellList cells_;
  double radius2_;
  SelfEdges self_;
};

}  // namespace

RadiusGraph build_radius_graph(const std::vector<Vec3f>& position, double radius, SelfEdges self) {
  if (!(radius > 0)) throw ConfigError("the radius is not positive (" + std::to_string(radius) + " m)");
  const Neighbourhood neighbourhood(position, static_cast<double>(static_cast<float>(radius)), self);
  const auto n = static_cast<int64_t>(position.size());
  const int64_t blocks = (n + block - 1) / block;
  std::vector<std::vector<int32_t>> found(static_cast<std::size_t>(blocks));
  std::vector<int64_t> end(position.size());  // in its block's list
  parallel_for(
      Device::cpu, blocks,
      [&](int64_t b) {
        std::vector<int32_t>& senders = found[static_cast<std::size_t>(b)];
        for (int64_t r = b * block; r < std::min(n, (b + 1) * block); ++r) {
          neighbourhood.append(static_cast<int32_t>(r), senders);
          end[static_cast<std::size_t>(r)] = static_cast<int64_t>(senders.size());
        }
      },
      Grain{1});

  std::vector<int64_t> first(found.size() + 1, 0);
  for (std::size_t b = 0; b < found.size(); ++b) first[b + 1] = first[b] + static_cast<int64_t>(found[b].size());
  if (first.back() > std::numeric_limits<int32_t>::max())
    throw InputError("the particles have too many neighbours (" + std::to_string(first.back()) +
                     " pairs within the radius, at most 2^31 - 1). They have clumped: use an earlier frame, or a " +
                     "scene with fewer particles");
  RadiusGraph graph;
  graph.begin.assign(position.size() + 1, 0);
  graph.sender.resize(static_cast<std::size_t>(first.back()));
  parallel_for(
      Device::cpu, blocks,
      [&](int64_t b) {
        const auto at = static_cast<std::size_t>(b);
        std::copy(found[at].begin(), found[at].end(), graph.sender.begin() + first[at]);
        for (int64_t r = b * block; r < std::min(n, (b + 1) * block); ++r)
          graph.begin[static_cast<std::size_t>(r) + 1] =
              static_cast<int32_t>(first[at] + end[static_cast<std::size_t>(r)]);
      },
      Grain{1});
  return graph;
}

}  // namespace graupel::sparsegrid
