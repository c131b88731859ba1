#include "sparsegrid/radius_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/math/random.h"
#include "core/parallel/device.h"
#include "core/system/error.h"
#include "sparsegrid/cell_list.h"

namespace graupel::sparsegrid {
namespace {

std::vector<Vec3f> cloud(std::size_t n, double low, double high, uint64_t seed = 1) {
  const Random random(seed, RandomPurpose::test);
  std::vector<Vec3f> position(n);
  for (std::size_t i = 0; i < n; ++i)
    for (int d = 0; d < 3; ++d) position[i][d] = static_cast<float>(random.uniform(i, d, low, high));
  return position;
}

RadiusGraph brute_force(const std::vector<Vec3f>& position, double radius, SelfEdges self) {
  RadiusGraph graph;
  const auto limit = static_cast<double>(static_cast<float>(radius));
  for (std::size_t r = 0; r < position.size(); ++r) {
    for (std::size_t s = 0; s < position.size(); ++s)
      if ((s != r || self == SelfEdges::with) &&
          norm2((position[s].cast<double>() - position[r].cast<double>())) <= limit * limit)
        graph.sender.push_back(static_cast<int32_t>(s));
    graph.begin.push_back(static_cast<int32_t>(graph.sender.size()));
  }
  return graph;
}

void expect_equal(const RadiusGraph& a, const RadiusGraph& b) {
  EXPECT_EQ(a.begin, b.begin);
  EXPECT_EQ(a.sender, b.sender);
}

TEST(RadiusGraph, AgreesWithAllPairs) {
  for (const SelfEdges self : {SelfEdges::without, SelfEdges::with})
    for (const double radius : {0.02, 0.1, 0.35, 3.0})
      for (const auto& position : {cloud(700, 0, 1), cloud(500, -1, 0.2, 2), cloud(300, -0.01, 0.01, 3)}) {
        const RadiusGraph graph = build_radius_graph(position, radius, self);
        expect_equal(graph, brute_force(position, radius, self));
        EXPECT_EQ(graph.points(), static_cast<int32_t>(position.size()));
      }
}

TEST(RadiusGraph, FarClumpsTakeTheHashedCells) {
  std::vector<Vec3f> position = cloud(100, 0, 0.1);
  for (const Vec3f& x : cloud(100, -0.1, 0, 5)) position.push_back(x + Vec3f{900, -700, 500});
  expect_equal(build_radius_graph(position, 0.03, SelfEdges::with), brute_force(position, 0.03, SelfEdges::with));
}

TEST(RadiusGraph, NoneOneAndTwoPoints) {
  EXPECT_EQ(build_radius_graph({}, 0.1, SelfEdges::with).begin, std::vector<int32_t>{0});
  EXPECT_EQ(build_radius_graph({{1, 2, 3}}, 0.1, SelfEdges::without).edges(), 0);
  const RadiusGraph one = build_radius_graph({{1, 2, 3}}, 0.1, SelfEdges::with);
  EXPECT_EQ(one.begin, (std::vector<int32_t>{0, 1}));
  EXPECT_EQ(one.sender, std::vector<int32_t>{0});
  const RadiusGraph same_place = build_radius_graph({{1, 2, 3}, {1, 2, 3}}, 0.1, SelfEdges::without);
  EXPECT_EQ(same_place.sender, (std::vector<int32_t>{1, 0}));
}

TEST(RadiusGraph, PointsOnTheRadiusAreNeighbours) {
  // 0.035f is above 0.035; on a cell's border from either side, and at the smallest distance beyond the radius.
  const float r = 0.035f;
  for (const double radius : {0.035, static_cast<double>(r)})
    for (int d = 0; d < 3; ++d)
      for (const float sign : {-1.0f, 1.0f}) {
        Vec3f on = Vec3f::zero(), beyond = Vec3f::zero();
        on[d] = sign * r;
        beyond[d] = sign * std::nextafter(r, 1.0f);
        EXPECT_EQ(build_radius_graph({Vec3f::zero(), on}, radius, SelfEdges::without).edges(), 2);
        EXPECT_EQ(build_radius_graph({Vec3f::zero(), beyond}, radius, SelfEdges::without).edges(), 0);
      }
  // A point a hair below zero and one at the radius round to a distance of the radius, but to cells -1 and 1.
  EXPECT_EQ(build_radius_graph({{-1e-18f, 0, 0}, {r, 0, 0}}, static_cast<double>(r), SelfEdges::without).edges(), 2);
}

TEST(RadiusGraph, EdgesAreMutual) {
  const auto position = cloud(400, -0.3, 0.3, 9);
  const RadiusGraph graph = build_radius_graph(position, 0.15, SelfEdges::with);
  std::set<std::pair<int32_t, int32_t>> edges;
  for (int32_t r = 0; r < graph.points(); ++r)
    for (int32_t e = graph.begin[static_cast<std::size_t>(r)]; e < graph.begin[static_cast<std::size_t>(r) + 1]; ++e)
      edges.insert({graph.sender[static_cast<std::size_t>(e)], r});
  EXPECT_EQ(static_cast<int64_t>(edges.size()), graph.edges());
  for (const auto& [s, r] : edges) EXPECT_TRUE(edges.count({r, s})) << s << " " << r;
}

TEST(RadiusGraph, TheNumberOfThreadsChangesNothing) {
  const auto position = cloud(3000, 0, 0.4, 4);
  set_num_threads(1);
  const RadiusGraph one = build_radius_graph(position, 0.035, SelfEdges::with);
  for (const int threads : {2, 5}) {
    set_num_threads(threads);
    expect_equal(build_radius_graph(position, 0.035, SelfEdges::with), one);
  }
  set_num_threads(0);
}

TEST(RadiusGraph, RefusesWhatHasNoGraph) {
  EXPECT_THROW(build_radius_graph({{0, 0, 0}}, 0, SelfEdges::with), ConfigError);
  EXPECT_THROW(build_radius_graph({{0, 0, 0}}, -1, SelfEdges::with), ConfigError);
  EXPECT_THROW(build_radius_graph({{0, 1e9f, 0}}, 0.01, SelfEdges::with), ConfigError);
  EXPECT_THROW(build_radius_graph({{0, std::nanf(""), 0}}, 0.01, SelfEdges::with), ConfigError);
}

TEST(CellList, HoldsEveryPointOnceInItsCellAscending) {
  const auto position = cloud(500, -1, 1, 6);
  const CellList list(position, 0.3);
  std::vector<int32_t> seen;
  for (int32_t c = 0; c < list.count(); ++c) {
    EXPECT_EQ(list.find(list.cell(c)), c);
    EXPECT_LT(list.begin(c), list.begin(c + 1));
    for (int32_t i = list.begin(c); i < list.begin(c + 1); ++i) {
      const int32_t p = list.point()[static_cast<std::size_t>(i)];
      EXPECT_EQ(list.cell_of(static_cast<std::size_t>(p)), c);
      if (i > list.begin(c)) {
        EXPECT_LT(seen.back(), p);
      }
      for (int d = 0; d < 3; ++d)
        EXPECT_EQ(static_cast<int>(std::floor(position[static_cast<std::size_t>(p)][d] / 0.3)), list.cell(c)[d]);
      seen.push_back(p);
    }
  }
  std::sort(seen.begin(), seen.end());
  for (std::size_t p = 0; p < position.size(); ++p) ASSERT_EQ(seen[p], static_cast<int32_t>(p));
}

}  // namespace
}  // namespace graupel::sparsegrid
