// Laws of the transfer from grid to particles; the other way: tests/mpm/kernels/particle_to_grid_laws.h.
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
