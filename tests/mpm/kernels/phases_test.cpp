// The tuned CPU phases against their portable twins, on a state in motion.
#include "mpm/phases/phases.h"

#include <gtest/gtest.h>

#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

/// The forms that transfers come in.
struct TransferCase {
  int dimensions;
  Spline spline;
};
constexpr TransferCase transfer_cases[] = {
    {3, Spline::quadratic}, {3, Spline::cubic}, {2, Spline::quadratic}, {2, Spline::cubic}};

/// Four materials that have just met the floor and each other.
template <typename T>
std::unique_ptr<Solver<T>> state_in_motion(const TransferCase& form = transfer_cases[0]) {
  Scene scene = scene_with("taichi_water", {0.4, 0.1, 0.4});
  add_box(scene, "taichi_sand", {0.45, 0.19, 0.42});
  add_box(scene, "taichi_snow", {0.52, 0.11, 0.43});
  add_box(scene, "taichi_jelly", {0.44, 0.12, 0.5});
  for (Source& source : scene.sources) source.velocity = {0.3, -2, 0.1};
  scene.transfer.spline = form.spline;
  if (form.dimensions == 2) scene = in_the_plane(scene);
  auto solver =
      std::make_unique<Solver<T>>(scene, SimulationOptions{}, sample_sources(scene, 1), sparsegrid::ObstacleSet(scene));
  for (int i = 0; i < 2; ++i) solver->advance_frame();
  solver->sort_particles();
  return solver;
}

template <typename T>
T largest_difference(const HostParticles<T>& a, const HostParticles<T>& b) {
  T worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    worst = std::max(worst, norm(a.velocity[i] - b.velocity[i]));
    worst = std::max(worst, largest_entry(a.affine_velocity[i] - b.affine_velocity[i]) / 1000);
  }
  return worst;
}

template <typename T>
void check_grid_to_particle(const TransferCase& form) {
  const auto solver = state_in_motion<T>(form);
  const SolverView<T> view = solver->view();
  particle_to_grid(view, T(3e-4));
  update_grid(view, T(3e-4));
  grid_to_particle(view);
  const HostParticles<T> by_blocks = solver->particles();
  grid_to_particle_by_particles(view);
  EXPECT_LT(largest_difference(by_blocks, solver->particles()), sizeof(T) == 4 ? T(2e-5) : T(1e-13));
}

TEST(Phases, BothFormsOfGridToParticleAgree) {
  for (const TransferCase& form : transfer_cases) {
    check_grid_to_particle<float>(form);
    check_grid_to_particle<double>(form);
  }
}

template <typename T>
void check_deformation() {
  const auto solver = state_in_motion<T>(), twin = state_in_motion<T>();
  const T dt = T(3e-4), tolerance = sizeof(T) == 4 ? T(2e-5) : T(1e-11);
  update_deformation_tiles(solver->view(), dt);
  update_deformation_portable(twin->view(), dt);
  const HostParticles<T> a = solver->particles(), b = twin->particles();
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_LT(largest_entry(a.deformation_gradient[i] - b.deformation_gradient[i]), tolerance);
    ASSERT_NEAR(a.internal[i], b.internal[i], tolerance);
    ASSERT_LT(norm(a.stress[i] - b.stress[i]), tolerance * (T(1e6) + norm(b.stress[i])));
  }
}

TEST(Phases, TilesOfSixteenEqualOneParticleAtATime) {
  check_deformation<float>();
  check_deformation<double>();
}

TEST(Phases, EveryParticleIsInItsHomeBlockAndEveryBlockIsLinked) {
  const auto solver = state_in_motion<float>();
  const SolverView<float> view = solver->view();
  std::vector<int> seen(static_cast<std::size_t>(view.particles.count), 0);
  for (int32_t h = 0; h < view.blocks.owner_count; ++h) {
    ASSERT_LT(view.blocks.start[h], view.blocks.start[h + 1]);
    for (int32_t i = view.blocks.start[h]; i < view.blocks.start[h + 1]; ++i) {
      const int32_t slot = view.blocks.order[i];
      ++seen[slot];
      ASSERT_EQ(view.keys[slot], view.blocks.owner_key[h]);
      if (i > view.blocks.start[h]) {
        ASSERT_LT(view.blocks.order[i - 1], slot);
      }
    }
    const Vec3i block = view.grid.block_of(view.blocks.owner_key[h]);
    for (int c = 0; c < 8; ++c) {
      const int32_t node = view.blocks.owner_to_node[8 * h + c];
      ASSERT_EQ(view.blocks.node_key[node], view.grid.directory_index(block + corner_bits<3>(c)));
      ASSERT_EQ(view.blocks.node_to_owner[8 * node + c], h);
    }
  }
  for (const int s : seen) ASSERT_EQ(s, 1);
}

}  // namespace
}  // namespace graupel::mpm
