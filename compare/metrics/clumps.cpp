#include "compare/metrics/clumps.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sparsegrid/cell_list.h"

namespace graupel::compare {

namespace {

/// Disjoint sets with halved paths; the representative of a set is its first element.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  int32_t find(int32_t i) {
    while (parent(i) != i) i = parent(i) = parent(parent(i));
    return i;
  }
  void join(int32_t i, int32_t j) {
    i = find(i);
    j = find(j);
    parent(std::max(i, j)) = std::min(i, j);
  }

 private:
  int32_t& parent(int32_t i) { return parent_[static_cast<std::size_t>(i)]; }
  std::vector<int32_t> parent_;
};

/// The cell itself and half of its neighbours, so that every pair of cells is met once.
constexpr int half_of_neighbours[14][3] = {{0, 0, 0},   {1, 0, 0},  {-1, 1, 0}, {0, 1, 0},  {1, 1, 0},
                                           {-1, -1, 1}, {0, -1, 1}, {1, -1, 1}, {-1, 0, 1}, {0, 0, 1},
                                           {1, 0, 1},   {-1, 1, 1}, {0, 1, 1},  {1, 1, 1}};

/// Particles, and the images of those within a radius of the lower end of a periodic axis at its upper end.
struct Points {
  std::vector<Vec3f> position;
  std::vector<int32_t> particle;
};

Points with_images(const std::vector<Vec3f>& position, double radius, const Space& space) {
  Points points{position, std::vector<int32_t>(position.size())};
  std::iota(points.particle.begin(), points.particle.end(), 0);
  for (int d = 0; d < space.axes; ++d) {
    if (!space.is_periodic(d)) continue;
    for (std::size_t i = 0, n = points.position.size(); i < n; ++i) {
      Vec3f image = points.position[i];
      if (image[d] > space.low[d] + radius) continue;
      image[d] += static_cast<float>(space.period[d]);
      points.position.push_back(image);
      points.particle.push_back(points.particle[i]);
    }
  }
  return points;
}

void join_near(const sparsegrid::CellList& cells, const Points& points, double radius, DisjointSets& sets) {
  const auto point = [&](int32_t k) { return static_cast<std::size_t>(cells.point()[static_cast<std::size_t>(k)]); };
  const auto at = [&](std::size_t p) { return points.position[p].cast<double>(); };
  for (int32_t c = 0; c < cells.count(); ++c)
    for (const auto& step : half_of_neighbours) {
      const int32_t other = cells.find(cells.cell(c) + Vec3i{step[0], step[1], step[2]});
      if (other < 0) continue;
      for (int32_t i = cells.begin(c); i < cells.begin(c + 1); ++i)
        for (int32_t j = other == c ? i + 1 : cells.begin(other); j < cells.begin(other + 1); ++j)
          if (norm2(at(point(i)) - at(point(j))) <= radius * radius)
            sets.join(points.particle[point(i)], points.particle[point(j)]);
    }
}

}  // namespace

std::vector<double> clump_masses(const std::vector<Vec3f>& position, const std::vector<double>& mass, double radius,
                                 const Space& space) {
  DisjointSets sets(position.size());
  const Points points = with_images(position, radius, space);
  join_near(sparsegrid::CellList(points.position, radius), points, radius, sets);
  std::vector<double> of_first(position.size(), 0.0), clumps;
  for (std::size_t i = 0; i < position.size(); ++i)
    of_first[static_cast<std::size_t>(sets.find(static_cast<int32_t>(i)))] += mass[i];
  std::copy_if(of_first.begin(), of_first.end(), std::back_inserter(clumps), [](double m) { return m > 0; });
  return clumps;
}

Distribution clump_sizes(const std::vector<double>& clump_mass, double unit) {
  Distribution sizes;
  for (const double m : clump_mass) sizes.add(std::log10(m / unit), m);
  return sizes;
}

}  // namespace graupel::compare
