// The grid step of a reduced model against a step of the full model.
#include "rom/solver/particle_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "io/scene/scene_reader.h"
#include "tests/rom/deformation_model.h"

namespace graupel::rom {
namespace {

Scene column(const std::string& more = "") {
  return io::parse_scene(R"({
    "domain": { "size": [0.5, 0.5, 0.5], "dx": 0.02, "walls": "stick" },
    "gravity": [0, -4, 0],
    "materials": { "sand": { "preset": "nsf_sand", "friction_angle": 30 } },
    "sources": [ { "shape": "box", "size": [0.1, 0.18, 0.1], "position": [0.25, 0.152, 0.25], "material": "sand" } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 1 },
    "frame_time": 0.004, "seed": 3)" +
                             more + "}",
                         "scene", "");
}

/// Every particle as a point of its own, the first `samples` of them (all: -1) as samples.
GridParticles all_particles(const mpm::PreparedScene& prepared, int64_t samples = -1) {
  GridParticles all;
  all.particles.resize(prepared.particles.position.size());
  std::iota(all.particles.begin(), all.particles.end(), 0);
  all.weight.assign(all.particles.size(), 1);
  all.samples = samples < 0 ? static_cast<int64_t>(all.particles.size()) : samples;
  return all;
}

/// Position, velocity, stress and affine velocity of a frame into the slots.
template <typename T>
void write_state(const ParticleFrame& frame, const std::vector<int32_t>& particles, const mpm::ParticleView<T>& view) {
  for (std::size_t slot = 0; slot < particles.size(); ++slot) {
    const auto p = static_cast<std::size_t>(particles[slot]);
    const auto s = static_cast<int64_t>(slot);
    view.position.set_vec(s, frame.position[p].cast<T>());
    view.velocity.set_vec(s, frame.velocity[p].cast<T>());
    const float* tau = frame.fields[ParticleField::stress].data() + 6 * p;  // xx, xy, xz, yy, yz, zz
    view.stress.set_vec(s, Vec<float, 6>{tau[0], tau[3], tau[5], tau[1], tau[2], tau[4]}.cast<T>());
    Mat<T, 3> C;
    for (int i = 0; i < 9; ++i)
      C.a[i / 3][i % 3] = static_cast<T>(frame.fields[ParticleField::affine][9 * p + static_cast<std::size_t>(i)]);
    mpm::store_matrix<T, 3>(view.affine_velocity, s, C);
  }
}

/// A block that a box pushes from its left; the box goes away at `time` 0.1.
TEST(ParticleGrid, SamplesThatAnObstaclePushesWeighMore) {
  const Scene scene = io::parse_scene(R"({
    "domain": { "size": [1, 1, 1], "dx": 0.04, "walls": "stick" }, "gravity": [0, 0, 0],
    "materials": { "jelly": { "preset": "jelly" } },
    "sources": [ { "shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.5, 0.5, 0.5], "material": "jelly" } ],
    "obstacles": [ { "shape": "box", "size": [0.1, 0.4, 0.4], "position": [0.34, 0.5, 0.5], "contact": "separate",
      "motion": { "kind": "keyframes", "keyframes": [ { "time": 0.1, "translation": [0.05, 0, 0] },
                                                      { "time": 0.2, "translation": [0, 0, 0] } ] } } ],
    "transfer": { "scheme": "pic" }, "time_step": { "policy": "fixed", "substeps_per_frame": 1 }, "frame_time": 0.001,
    "frames": 1, "seed": 3 })",
                                      "scene", "");
  const mpm::PreparedScene prepared(scene, {.seed = scene.seed});
  const GridParticles all = all_particles(prepared);
  for (const double time : {0.09, 0.11}) {
    ParticleGrid<double> grid(prepared);
    grid.choose(all);
    const mpm::ParticleView<double> p = grid.particles();
    for (int64_t i = 0; i < p.count; ++i) {
      p.position.set_vec(i, prepared.particles.position[static_cast<std::size_t>(i)] + Vec3d{0.02, 0, 0});
      p.velocity.set_vec(i, Vec3d::zero());
    }
    std::vector<double> weight;
    grid.step(time, 0.001, GradientKind::map, 11, weight);
    double heaviest = 1;
    for (int64_t i = 0; i < p.count; ++i) {
      const double w = weight[static_cast<std::size_t>(i)];
      heaviest = std::max(heaviest, w);
      if (p.position.vec(i)[0] > 0.56) {
        EXPECT_EQ(w, 1) << "far from the box";
      }
    }
    EXPECT_LE(heaviest, 11);
    EXPECT_EQ(heaviest > 4, time < 0.1) << "heavy while the box comes, not when it goes";
  }
}

class ParticleGridTest : public testing::TestWithParam<const char*> {};

TEST_P(ParticleGridTest, WithAllParticlesAStepIsThatOfTheFullModel) {
  const Scene scene = column(GetParam());
  const mpm::PreparedScene prepared(scene, {.seed = scene.seed});
  const auto full = mpm::Simulation::create(prepared);
  for (int i = 0; i < 60; ++i) full->advance_frame();
  const GridParticles all = all_particles(prepared);
  ParticleGrid<float> grid(prepared);
  grid.choose(all);
  const FieldSet fields = {ParticleField::stress, ParticleField::affine};
  for (int i = 0; i < 5; ++i) {
    const ParticleFrame before = mpm::frame_with_fields(*full, fields);
    write_state(before, all.particles, grid.particles());
    std::vector<double> weight;
    grid.step(full->time(), scene.frame_time, GradientKind::map, 1, weight);
    full->advance_frame();
    const ParticleFrame after = full->frame();
    double worst = 0, way = 0;
    for (std::size_t p = 0; p < all.particles.size(); ++p) {
      ASSERT_EQ(weight[p], 1);
      const Vec3f x = grid.particles().position.vec(static_cast<int64_t>(p));
      worst = std::max(worst, static_cast<double>(norm(x - after.position[p])));
      way = std::max(way, static_cast<double>(norm(after.position[p] - before.position[p])));
    }
    EXPECT_GT(way, 1e-4);
    EXPECT_LT(worst, 2e-6 * way / 1e-3 + 1e-7) << "frame " << i << ", largest way " << way;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, ParticleGridTest,
    testing::Values("", R"(, "obstacles": [ { "shape": "sphere", "radius": 0.025, "position": [0.335, 0.08, 0.25] } ])",
                    R"(, "obstacles": [ { "shape": "box", "size": [0.05, 0.1, 0.3], "position": [0.35, 0.12, 0.25],
                       "motion": { "velocity": [-0.4, 0, 0] } } ])",
                    R"(, "kinematic_regions": [ { "shape": "box", "size": [0.2, 0.05, 0.2],
                       "position": [0.25, 0.24, 0.25], "motion": { "velocity": [0.1, 0, 0], "end_time": 1 } } ])"));

/// A block of jelly that an obstacle pushes.
TEST(IntegratedGradients, AreThoseOfTheFullModel) {
  Scene scene = test::jelly_block("[0, 0, 0]", R"(, "obstacles": [ { "shape": "box", "size": [0.3, 0.1, 0.3],
    "position": [0.5, 0.34, 0.5], "motion": { "velocity": [0, 1, 0] } } ])");
  scene.time_step.substeps_per_frame = 1;
  scene.frame_time = 0.0025;
  const mpm::PreparedScene prepared(scene, {.seed = scene.seed});
  const auto full = mpm::Simulation::create(prepared);
  ParticleGrid<float> grid(prepared);
  grid.choose(all_particles(prepared, 7));
  const mpm::ParticleView<float> view = grid.particles();
  double worst = 0, largest = 0;
  for (int i = 0; i < 15; ++i) {
    const ParticleFrame before = full->frame();
    for (int64_t p = 0; p < view.count; ++p) {
      view.position.set_vec(p, before.position[static_cast<std::size_t>(p)]);
      view.velocity.set_vec(p, before.velocity[static_cast<std::size_t>(p)]);
      mpm::store_matrix<float, 3>(view.affine_velocity, p, Mat<float, 3>{});
    }
    grid.take_stress_of_deformation();
    std::vector<double> weight;
    grid.step(full->time(), scene.frame_time, GradientKind::integrated, 1, weight);
    full->advance_frame();
    const ParticleFrame after = mpm::frame_with_fields(*full, {ParticleField::deformation_gradient});
    const std::vector<float>& wanted = after.fields[ParticleField::deformation_gradient];
    for (int64_t p = 0; p < view.count; ++p) {
      const Mat<float, 3> F = mpm::load_matrix<float, 3>(view.deformation_gradient, p);
      for (int k = 0; k < 9; ++k) {
        const float value = wanted[static_cast<std::size_t>(9 * p + k)];
        worst = std::max(worst, static_cast<double>(std::abs(F.a[k / 3][k % 3] - value)));
        largest = std::max(largest, static_cast<double>(std::abs(value - (k % 4 == 0 ? 1.0f : 0.0f))));
      }
    }
  }
  EXPECT_GT(largest, 0.02);
  EXPECT_LT(worst, 1e-4 * largest);
}

/// Points with positions and velocities of the full model's particles, whose law is a plastic one: their stress and
/// affine velocity follow, also where transfers keep the rotation alone.
TEST(IntegratedGradients, GiveStressAndAffineVelocityOfAPlasticLaw) {
  for (const char* transfer : {"", R"(, "transfer": { "scheme": "rpic" })"}) {
    const Scene scene = column(transfer);
    const mpm::PreparedScene prepared(scene, {.seed = scene.seed});
    const auto full = mpm::Simulation::create(prepared);
    ParticleGrid<float> grid(prepared);
    grid.choose(all_particles(prepared, 7));
    const mpm::ParticleView<float> view = grid.particles();
    constexpr int frames = 60;
    std::vector<double> weight;
    for (int i = 0; i < frames; ++i) {
      const ParticleFrame before = full->frame();
      for (int64_t p = 0; p < view.count; ++p) {
        view.position.set_vec(p, before.position[static_cast<std::size_t>(p)]);
        view.velocity.set_vec(p, before.velocity[static_cast<std::size_t>(p)]);
      }
      grid.step(full->time(), scene.frame_time, GradientKind::integrated, 1, weight);
      full->advance_frame();
    }
    const ParticleFrame after = mpm::frame_with_fields(*full, {ParticleField::stress, ParticleField::affine});
    const std::vector<float>&tau = after.fields[ParticleField::stress], &C = after.fields[ParticleField::affine];
    double stress_error = 0, stress = 0, affine_error = 0, affine = 0;
    for (int64_t p = 0; p < view.count; ++p) {
      const Vec<float, 6> own = view.stress.vec(p);
      constexpr int order[] = {0, 3, 4, 1, 5, 2};  // of xx, xy, xz, yy, yz, zz
      for (int k = 0; k < 6; ++k) {
        const float wanted = tau[static_cast<std::size_t>(6 * p + k)];
        stress_error += std::pow(static_cast<double>(own[order[k]] - wanted), 2);
        stress += std::pow(static_cast<double>(wanted), 2);
      }
      const Mat<float, 3> own_affine = mpm::load_matrix<float, 3>(view.affine_velocity, p);
      for (int k = 0; k < 9; ++k) {
        const float wanted = C[static_cast<std::size_t>(9 * p + k)];
        affine_error += std::pow(static_cast<double>(own_affine(k / 3, k % 3) - wanted), 2);
        affine += std::pow(static_cast<double>(wanted), 2);
      }
    }
    EXPECT_GT(stress, 0);
    EXPECT_GT(affine, 0);
    EXPECT_LT(stress_error, 1e-4 * stress) << transfer;
    EXPECT_LT(affine_error, 1e-4 * affine) << transfer;
  }
}

}  // namespace
}  // namespace graupel::rom
