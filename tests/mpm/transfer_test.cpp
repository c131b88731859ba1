// Laws of the transfers: conservation of mass and momenta for any state, exactness for affine fields.
#include "mpm/transfer.h"

#include <gtest/gtest.h>

#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <typename T, int D>
struct Arena {
  alignas(64) T node[arena_size<D>] = {};

  template <typename Visit>
  void for_each_node(Visit&& visit) {
    Vec<int, D> c = Vec<int, D>::zero();
    for (int i = 0; i < (D == 2 ? 36 : 216); ++i) {
      int rest = i;
      for (int d = D - 1; d >= 0; --d) {
        c[d] = rest % arena_width<>;
        rest /= arena_width<>;
      }
      visit(c, node + arena_offset(c));
    }
  }
};

template <typename T, int D>
ArenaPlace<T, D> random_place(uint64_t i) {
  const Random random(5, RandomPurpose::test, D);
  ArenaPlace<T, D> place;
  for (int d = 0; d < D; ++d) {
    place.base[d] = static_cast<int>(random.integer(2 * i, d, block_width));
    place.fx[d] = static_cast<T>(random.uniform(2 * i + 1, d, 0.5, 1.5));
  }
  return place;
}

template <typename T, int D>
Vec<T, D> position_of(const ArenaPlace<T, D>& place) {
  Vec<T, D> x;
  for (int d = 0; d < D; ++d) x[d] = static_cast<T>(place.base[d]) + place.fx[d];
  return x;
}

/// Torque-like products r x q with all axes, as the antisymmetric part of outer(q, r).
template <typename T, int D>
Mat<double, D> moment(const Vec<T, D>& r, const Vec<T, D>& q) {
  const Mat<double, D> m = outer(q.template cast<double>(), r.template cast<double>());
  return m - transpose(m);
}

template <typename T, int D>
void check_conservation() {
  const double tolerance = sizeof(T) == 4 ? 2e-5 : 1e-12;
  Arena<T, D> arena;
  double mass = 0;
  Vec<double, D> momentum = Vec<double, D>::zero();
  Mat<double, D> angular = Mat<double, D>::zero();
  for (uint64_t i = 0; i < 50; ++i) {
    const auto place = random_place<T, D>(i);
    const T m = static_cast<T>(1 + 0.1 * static_cast<double>(i % 7));
    const Mat<T, D> A = random_matrix<T, D>(i, 3);
    const Vec<T, D> q = random_matrix<T, D>(1000 + i, 2) * Vec<T, D>::filled(T(1));
    scatter_particle(arena.node, place, m, q, A);
    mass += m;
    momentum += q.template cast<double>();
    const Mat<double, D> A_64 = A.template cast<double>();
    angular += moment(position_of(place), q) + 0.25 * (A_64 - transpose(A_64));  // second moment dx^2/4, dx = 1
  }
  double grid_mass = 0;
  Vec<double, D> grid_momentum = Vec<double, D>::zero();
  Mat<double, D> grid_angular = Mat<double, D>::zero();
  arena.for_each_node([&](const Vec<int, D>& c, const T* node) {
    Vec<T, D> q, x;
    for (int d = 0; d < D; ++d) {
      q[d] = node[d];
      x[d] = static_cast<T>(c[d]);
    }
    grid_mass += node[3];
    grid_momentum += q.template cast<double>();
    grid_angular += moment(x, q);
  });
  EXPECT_NEAR(grid_mass, mass, tolerance * mass);
  for (int d = 0; d < D; ++d) EXPECT_NEAR(grid_momentum[d], momentum[d], 10 * tolerance);
  EXPECT_LT(largest_entry(grid_angular - angular), 100 * tolerance);
}

TEST(Transfer, ParticleToGridConservesMassAndBothMomenta) {
  check_conservation<float, 2>();
  check_conservation<double, 2>();
  check_conservation<float, 3>();
  check_conservation<double, 3>();
}

template <typename T, int D>
void check_affine_field() {
  const T tolerance = sizeof(T) == 4 ? T(2e-5) : T(1e-13);
  const Mat<T, D> A = random_matrix<T, D>(1, 1);
  const Vec<T, D> b = random_matrix<T, D>(2, 1) * Vec<T, D>::filled(T(1));
  Arena<T, D> arena;
  arena.for_each_node([&](const Vec<int, D>& c, T* node) {
    const Vec<T, D> v = A * c.template cast<T>() + b;
    for (int d = 0; d < D; ++d) node[d] = v[d];
  });
  for (uint64_t i = 0; i < 50; ++i) {
    const auto place = random_place<T, D>(i);
    Vec<T, D> v;
    Mat<T, D> C;
    gather_particle(arena.node, place, T(1), v, C);
    EXPECT_LT(norm(v - (A * position_of(place) + b)), 5 * tolerance);
    EXPECT_LT(largest_entry(C - A), 5 * tolerance);
  }
}

TEST(Transfer, GridToParticleReproducesAffineFields) {
  check_affine_field<float, 2>();
  check_affine_field<double, 2>();
  check_affine_field<float, 3>();
  check_affine_field<double, 3>();
}

/// Particles that carry v = A x + b and C = A give nodes with that velocity, whatever their masses.
template <int D>
void check_affine_round_trip() {
  const Mat<double, D> A = random_matrix<double, D>(3, 1);
  const Vec<double, D> b = random_matrix<double, D>(4, 1) * Vec<double, D>::filled(1.0);
  Arena<double, D> arena;
  for (uint64_t i = 0; i < 200; ++i) {
    const auto place = random_place<double, D>(i);
    const double m = 1 + 0.2 * static_cast<double>(i % 3);
    scatter_particle(arena.node, place, m, m * (A * position_of(place) + b), m * A);
  }
  int nodes = 0;
  arena.for_each_node([&](const Vec<int, D>& c, const double* node) {
    if (node[3] < 1e-6) return;
    ++nodes;
    const Vec<double, D> v = A * c.template cast<double>() + b;
    for (int d = 0; d < D; ++d) EXPECT_NEAR(node[d] / node[3], v[d], 1e-9);
  });
  EXPECT_GE(nodes, D == 2 ? 30 : 150);
}

TEST(Transfer, AnAffineFieldOnParticlesIsThatFieldOnTheGrid) {
  check_affine_round_trip<2>();
  check_affine_round_trip<3>();
}

TEST(Transfer, RoundingAtABlockFaceStaysInsideTheArena) {
  const auto low = arena_place(Vec<float, 3>{8.4999995f, 8.5f, 12.499999f}, Vec3i{2, 2, 2});
  const auto high = arena_place(Vec<float, 3>{12.5f, 12.500001f, 8.5f}, Vec3i{2, 2, 2});
  for (int d = 0; d < 3; ++d) {
    for (const auto& place : {low, high}) {
      EXPECT_GE(place.base[d], 0);
      EXPECT_LT(place.base[d], block_width);
      EXPECT_NEAR(place.fx[d], 1, 0.5001);
    }
  }
}

}  // namespace
}  // namespace graupel::mpm
