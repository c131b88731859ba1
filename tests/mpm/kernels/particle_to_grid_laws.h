// The laws of P2G, for every schedule of it: mass and both momenta are conserved, equal velocities and affine fields
// come out on the nodes, and the sums are those of the equation in mpm/physics/transfer.h, written out in f64.
//
// A schedule has a scalar T, dimensions D, a spline, available(), and sums(view, dt): what the particles of a view
// leave on the nodes.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

#include "mpm/physics/transfer.h"
#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {

/// Momentum [kg m/s] and mass [kg] of every node that has some.
using NodeSums = std::map<std::array<int, 3>, std::array<double, 4>>;

/// 700 particles of two materials in 5 cells along each axis, so that blocks have few and many, by block and cell.
template <typename Schedule>
class TransferState {
 public:
  using T = typename Schedule::T;
  static constexpr int D = Schedule::D;
  static constexpr Spline spline = Schedule::spline;
  static constexpr double dx = 1.0 / 64, dt = 1e-3;

  TransferState() : solver_(scene(), SimulationOptions{}, particles(), sparsegrid::ObstacleSet(scene())) {
    solver_.sort_particles();
  }
  SolverView<T> view() const { return solver_.view(); }
  /// Sets the state of each particle: set(place x, v, C, tau).
  template <typename Set>
  void set(const Set& set) {
    const ParticleView<T> p = view().particles;
    for (int64_t slot = 0; slot < p.count; ++slot) {
      Vec3d v = Vec3d::zero();
      Mat3d C = Mat3d::zero(), tau = Mat3d::zero();
      set(slot, p.position.vec(slot).template cast<double>(), v, C, tau);
      p.velocity.set_vec(slot, v.template cast<T>());
      store_matrix<T, 3>(p.affine_velocity, slot, C.template cast<T>());
      store_symmetric(p.stress, slot, tau.template cast<T>());
    }
  }
  /// Any motion and stress.
  void set_random() {
    set([](int64_t slot, const Vec3d&, Vec3d& v, Mat3d& C, Mat3d& tau) {
      const auto i = static_cast<uint64_t>(4 * slot);
      v = in_space(in_axes<D>(random_matrix<double, 3>(i, 2) * Vec3d{1, 0, 0}));
      C = in_space(in_axes<D>(random_matrix<double, 3>(i + 1, 50)));
      const Mat3d stress = random_matrix<double, 3>(i + 2, 1e4);
      tau = in_space(in_axes<D>(stress + transpose(stress)));
    });
  }

 private:
  static Scene scene() {
    Scene scene;
    scene.domain.size = Vec3d::filled(0.375);
    scene.domain.dx = dx;
    scene.transfer.spline = spline;
    scene.domain.dimensions = D;
    for (const char* name : {"sand", "snow"}) scene.materials[name] = preset(name);
    return scene;
  }
  static SampledParticles particles() {
    const Random random(3, RandomPurpose::test, 1);
    std::vector<std::pair<std::array<int, 6>, Vec3d>> places;
    for (uint64_t i = 0; i < 700; ++i) {
      Vec3f x;  // numbers that both precisions have
      for (int d = 0; d < 3; ++d) x[d] = static_cast<float>((6.4 + random.uniform(i, d, 0, 5)) * dx);
      if (D == 2) x[2] = static_cast<float>(scene().domain.plane());
      std::array<int, 6> order{};
      const Vec<int, D> base = base_node<spline>(in_axes<D>(grid_of<double>(scene().domain).local(x.cast<double>())));
      for (int d = 0; d < D; ++d) {
        order[static_cast<std::size_t>(d)] = base[d] / block_width;
        order[static_cast<std::size_t>(3 + d)] = base[d] % block_width;
      }
      places.emplace_back(order, x.cast<double>());
    }
    std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    SampledParticles s;
    s.material_names = {"sand", "snow"};
    for (const auto& [order, x] : places) {
      const auto i = s.position.size();
      s.position.push_back(x);
      s.velocity.push_back(Vec3d::zero());
      s.spin.push_back(Vec3d::zero());
      s.volume.push_back(dx * dx * dx / 8 * (1 + 0.1 * static_cast<double>(i % 5)));
      s.material.push_back(static_cast<int32_t>(i / 3 % 2));
      s.source.push_back(0);
    }
    return s;
  }

  Solver<T> solver_;
};

/// What view.nodes holds.
template <typename T>
NodeSums node_sums_of(const SolverView<T>& view) {
  NodeSums sums;
  const int nodes = view.dimensions == 2 ? nodes_per_block<2> : nodes_per_block<3>;
  for (int64_t entry = 0; entry < view.blocks.node_count * int64_t(nodes); ++entry) {
    Vec<int, 3> at = view.grid.block_of(view.blocks.node_key[entry / nodes]);
    const int inside = static_cast<int>(entry % nodes);
    const Vec<int, 3> c =
        view.dimensions == 2 ? Vec<int, 3>{inside / block_width, inside % block_width, 0} : node_in_block<3>(inside);
    for (int d = 0; d < 3; ++d) at[d] = d < view.dimensions ? block_width * at[d] + c[d] : 0;
    const T* node = view.nodes + entry * channels;
    if (node[3] != T(0))
      sums[{at[0], at[1], at[2]}] = {double(node[0]), double(node[1]), double(node[2]), double(node[3])};
  }
  return sums;
}

/// p_i = sum_p w_ip (m v + (m C - dt V k / dx^2 tau) (x_i - x_p)), m_i = sum_p w_ip m.
template <typename Schedule>
NodeSums sums_by_the_equation(const TransferState<Schedule>& state) {
  constexpr int D = Schedule::D;
  constexpr Spline S = Schedule::spline;
  const auto view = state.view();
  const auto& p = view.particles;
  NodeSums sums;
  for (int64_t slot = 0; slot < p.count; ++slot) {
    const Vec<double, D> local =
        in_axes<D>((p.position.vec(slot) - view.grid.origin).template cast<double>() * (1 / state.dx));
    const double volume = p.volume.get(slot), mass = view.materials[p.material.get(slot)].density * volume;
    const Mat<double, D> C =
        in_axes<D>(load_matrix<typename Schedule::T, 3>(p.affine_velocity, slot).template cast<double>());
    const Mat<double, D> tau = in_axes<D>(load_symmetric(p.stress, slot).template cast<double>());
    const Mat<double, D> A = mass * C - (state.dt * volume * BSpline<S>::inverse_moment / (state.dx * state.dx)) * tau;
    int nodes = 1;
    for (int d = 0; d < D; ++d) nodes *= stencil_width<S>;
    for (int n = 0; n < nodes; ++n) {
      std::array<int, 3> at{};
      Vec<double, D> r;
      double w = 1;
      for (int d = 0, rest = n; d < D; ++d, rest /= stencil_width<S>) {
        const int node = static_cast<int>(std::floor(local[d] - BSpline<S>::base_shift)) + rest % stencil_width<S>;
        at[static_cast<std::size_t>(d)] = node;
        r[d] = (node - local[d]) * state.dx;
        w *= bspline<S>(node - local[d]);
      }
      const Vec<double, D> q = mass * in_axes<D>(p.velocity.vec(slot).template cast<double>()) + A * r;
      auto& sum = sums[at];
      for (int d = 0; d < D; ++d) sum[static_cast<std::size_t>(d)] += w * q[d];
      sum[3] += w * mass;
    }
  }
  return sums;
}

/// Torque-like products with all axes, as the antisymmetric part of q r^T.
template <int D>
Mat<double, D> moment(const Vec<double, D>& r, const Vec<double, D>& q) {
  const Mat<double, D> m = outer(q, r);
  return m - transpose(m);
}

template <typename Schedule>
class ParticleToGrid : public testing::Test {
 protected:
  static constexpr double tolerance = sizeof(typename Schedule::T) == 4 ? 2e-6 : 1e-13;  ///< of the largest number

  void SetUp() override {
    if (!Schedule::available()) GTEST_SKIP() << "this processor lacks the instruction set";
  }
  NodeSums sums() const { return Schedule::sums(state.view(), static_cast<typename Schedule::T>(state.dt)); }

  TransferState<Schedule> state;
};
TYPED_TEST_SUITE_P(ParticleToGrid);

TYPED_TEST_P(ParticleToGrid, SumsAreThoseOfTheEquation) {
  this->state.set_random();
  NodeSums expected = sums_by_the_equation(this->state), found = this->sums();
  std::array<double, 4> largest{};
  for (const auto& [at, sum] : expected)
    for (std::size_t c = 0; c < 4; ++c) largest[c] = std::max(largest[c], std::abs(sum[c]));
  EXPECT_GT(expected.size(), TypeParam::D == 2 ? 40u : 300u);
  for (const auto& [at, sum] : found) expected[at];
  for (const auto& [at, sum] : expected)
    for (std::size_t c = 0; c < 4; ++c)
      ASSERT_NEAR(found[at][c], sum[c], 3 * this->tolerance * largest[c]) << at[0] << " " << at[1] << " " << at[2];
}

TYPED_TEST_P(ParticleToGrid, MassAndBothMomentaAreConserved) {
  constexpr int D = TypeParam::D;
  this->state.set_random();
  const auto view = this->state.view();
  const auto& p = view.particles;
  double mass = 0, grid_mass = 0, scale = 0;
  Vec<double, D> momentum = Vec<double, D>::zero(), grid_momentum = momentum;
  Mat<double, D> angular = Mat<double, D>::zero(), grid_angular = angular;
  const double dx = this->state.dx;
  for (int64_t slot = 0; slot < p.count; ++slot) {
    const double m = double(view.materials[p.material.get(slot)].density) * double(p.volume.get(slot));
    const Vec<double, D> q = m * in_axes<D>(p.velocity.vec(slot).template cast<double>());
    const Mat<double, D> C =
        in_axes<D>(load_matrix<typename TypeParam::T, 3>(p.affine_velocity, slot).template cast<double>());
    mass += m;
    momentum += q;
    scale += norm(q);
    // APIC's inertia tensor is dx^2 / k; the stress is symmetric and adds nothing.
    angular += moment(in_axes<D>((p.position.vec(slot) - view.grid.origin).template cast<double>()), q) +
               (m * dx * dx / BSpline<TypeParam::spline>::inverse_moment) * (C - transpose(C));
  }
  for (const auto& [at, sum] : this->sums()) {
    Vec<double, D> x, q;
    for (int d = 0; d < D; ++d) {
      x[d] = at[static_cast<std::size_t>(d)] * dx;
      q[d] = sum[static_cast<std::size_t>(d)];
    }
    grid_mass += sum[3];
    grid_momentum += q;
    grid_angular += moment(x, q);
  }
  EXPECT_NEAR(grid_mass, mass, this->tolerance * mass);
  EXPECT_LT(norm(grid_momentum - momentum), this->tolerance * scale);
  EXPECT_LT(largest_entry(grid_angular - angular), this->tolerance * scale * 0.375);
  EXPECT_GT(largest_entry(angular), 1e-3 * scale * 0.375);
}

TYPED_TEST_P(ParticleToGrid, OneVelocityOfAllParticlesIsThatOfEveryNode) {
  const Vec3d u = {1.5, -0.5, TypeParam::D == 2 ? 0 : 0.75};
  this->state.set([&](int64_t, const Vec3d&, Vec3d& v, Mat3d&, Mat3d&) { v = u; });
  int nodes = 0;
  for (const auto& [at, sum] : this->sums()) {
    if (sum[3] < 1e-6) continue;  // a thousandth of a particle
    ++nodes;
    for (int d = 0; d < TypeParam::D; ++d)
      ASSERT_NEAR(sum[static_cast<std::size_t>(d)] / sum[3], u[d], 30 * this->tolerance);
  }
  EXPECT_GT(nodes, TypeParam::D == 2 ? 40 : 250);
}

TYPED_TEST_P(ParticleToGrid, AnAffineFieldOnParticlesIsThatFieldOnTheNodes) {
  constexpr int D = TypeParam::D;
  const Mat3d A = in_space(in_axes<D>(random_matrix<double, 3>(3, 20)));
  const Vec3d b = {0.3, -0.2, D == 2 ? 0 : 0.1}, origin = this->state.view().grid.origin.template cast<double>();
  this->state.set([&](int64_t, const Vec3d& x, Vec3d& v, Mat3d& C, Mat3d&) {
    v = A * (x - origin) + b;
    C = A;
  });
  int nodes = 0;
  for (const auto& [at, sum] : this->sums()) {
    if (sum[3] < 1e-5) continue;
    ++nodes;
    Vec3d x = Vec3d::zero();
    for (int d = 0; d < D; ++d) x[d] = at[static_cast<std::size_t>(d)] * this->state.dx;
    const Vec3d v = A * x + b;
    for (int d = 0; d < D; ++d) ASSERT_NEAR(sum[static_cast<std::size_t>(d)] / sum[3], v[d], 100 * this->tolerance);
  }
  EXPECT_GT(nodes, D == 2 ? 40 : 250);
}

REGISTER_TYPED_TEST_SUITE_P(ParticleToGrid, SumsAreThoseOfTheEquation, MassAndBothMomentaAreConserved,
                            OneVelocityOfAllParticlesIsThatOfEveryNode, AnAffineFieldOnParticlesIsThatFieldOnTheNodes);

}  // namespace graupel::mpm
