// Laws of the transfers: conservation of mass and momenta for any state, exactness for affine fields.
#include "mpm/physics/transfer.h"

#include <gtest/gtest.h>

#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

template <typename T, int D, Spline S = Spline::quadratic>
struct Arena {
  static constexpr int width = arena_width<S>;
  alignas(64) T node[arena_size<D, S>] = {};

  template <typename Visit>
  void for_each_node(Visit&& visit) {
    Vec<int, D> c = Vec<int, D>::zero();
    for (int i = 0; i < (D == 2 ? width * width : width * width * width); ++i) {
      int rest = i;
      for (int d = D - 1; d >= 0; --d) {
        c[d] = rest % width;
        rest /= width;
      }
      visit(c, node + arena_offset<S>(c));
    }
  }
};

template <typename T, int D, Spline S = Spline::quadratic>
Stencil<T, D> random_place(uint64_t i) {
  const Random random(5, RandomPurpose::test, D);
  Stencil<T, D> place;
  for (int d = 0; d < D; ++d) {
    place.base[d] = static_cast<int>(random.integer(2 * i, d, block_width));
    place.fx[d] = static_cast<T>(random.uniform(2 * i + 1, d, 0, 1) + BSpline<S>::base_shift);
  }
  return place;
}

template <typename T, int D>
Vec<T, D> position_of(const Stencil<T, D>& place) {
  Vec<T, D> x;
  for (int d = 0; d < D; ++d) x[d] = static_cast<T>(place.base[d]) + place.fx[d];
  return x;
}

template <typename Check>
void for_all_forms(const Check& check) {
  check.template operator()<float, 2, Spline::quadratic>();
  check.template operator()<double, 2, Spline::quadratic>();
  check.template operator()<float, 3, Spline::quadratic>();
  check.template operator()<double, 3, Spline::quadratic>();
  check.template operator()<float, 2, Spline::cubic>();
  check.template operator()<double, 2, Spline::cubic>();
  check.template operator()<float, 3, Spline::cubic>();
  check.template operator()<double, 3, Spline::cubic>();
}

/// Torque-like products r x q with all axes, as the antisymmetric part of outer(q, r).
template <typename T, int D>
Mat<double, D> moment(const Vec<T, D>& r, const Vec<T, D>& q) {
  const Mat<double, D> m = outer(q.template cast<double>(), r.template cast<double>());
  return m - transpose(m);
}

template <typename T, int D, Spline S>
void check_conservation() {
  const double tolerance = sizeof(T) == 4 ? 2e-5 : 1e-12;
  Arena<T, D, S> arena;
  double mass = 0;
  Vec<double, D> momentum = Vec<double, D>::zero();
  Mat<double, D> angular = Mat<double, D>::zero();
  for (uint64_t i = 0; i < 50; ++i) {
    const auto place = random_place<T, D, S>(i);
    const T m = static_cast<T>(1 + 0.1 * static_cast<double>(i % 7));
    const Mat<T, D> A = random_matrix<T, D>(i, 3);
    const Vec<T, D> q = random_matrix<T, D>(1000 + i, 2) * Vec<T, D>::filled(T(1));
    scatter_particle<S>(arena.node, place, m, q, A);
    mass += m;
    momentum += q.template cast<double>();
    const Mat<double, D> A_64 = A.template cast<double>();
    angular += moment(position_of(place), q) + (1 / BSpline<S>::inverse_moment) * (A_64 - transpose(A_64));  // dx = 1
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
  for_all_forms([]<typename T, int D, Spline S>() { check_conservation<T, D, S>(); });
}

template <typename T, int D, Spline S>
void check_affine_field() {
  const T tolerance = sizeof(T) == 4 ? T(2e-5) : T(1e-13);
  const Mat<T, D> A = random_matrix<T, D>(1, 1);
  const Vec<T, D> b = random_matrix<T, D>(2, 1) * Vec<T, D>::filled(T(1));
  Arena<T, D, S> arena;
  arena.for_each_node([&](const Vec<int, D>& c, T* node) {
    const Vec<T, D> v = A * c.template cast<T>() + b;
    for (int d = 0; d < D; ++d) node[d] = v[d];
  });
  for (uint64_t i = 0; i < 50; ++i) {
    const auto place = random_place<T, D, S>(i);
    Vec<T, D> v;
    Mat<T, D> C;
    gather_particle<S>(arena.node, place, T(1), v, C);
    EXPECT_LT(norm(v - (A * position_of(place) + b)), 5 * tolerance);
    EXPECT_LT(largest_entry(C - A), 5 * tolerance);
  }
}

TEST(Transfer, GridToParticleReproducesAffineFields) {
  for_all_forms([]<typename T, int D, Spline S>() { check_affine_field<T, D, S>(); });
}

/// Particles that carry v = A x + b and C = A give nodes with that velocity, whatever their masses.
template <int D, Spline S>
void check_affine_round_trip() {
  const Mat<double, D> A = random_matrix<double, D>(3, 1);
  const Vec<double, D> b = random_matrix<double, D>(4, 1) * Vec<double, D>::filled(1.0);
  Arena<double, D, S> arena;
  for (uint64_t i = 0; i < 200; ++i) {
    const auto place = random_place<double, D, S>(i);
    const double m = 1 + 0.2 * static_cast<double>(i % 3);
    scatter_particle<S>(arena.node, place, m, m * (A * position_of(place) + b), m * A);
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
  check_affine_round_trip<2, Spline::quadratic>();
  check_affine_round_trip<2, Spline::cubic>();
  check_affine_round_trip<3, Spline::quadratic>();
  check_affine_round_trip<3, Spline::cubic>();
}

TEST(Transfer, RoundingAtABlockFaceStaysInsideTheArena) {
  const auto low = arena_stencil(Vec<float, 3>{8.4999995f, 8.5f, 12.499999f}, Vec3i{2, 2, 2});
  const auto high = arena_stencil(Vec<float, 3>{12.5f, 12.500001f, 8.5f}, Vec3i{2, 2, 2});
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
