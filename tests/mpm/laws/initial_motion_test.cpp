// Initial spin of sources, and what each transfer scheme keeps of it.
#include <gtest/gtest.h>

#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

const Vec3d spin = {2, -5, 3}, drift = {0.4, 0.2, -0.3};

Scene spinning() {
  Scene scene = scene_with("jelly");
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = drift;
  scene.sources[0].angular_velocity = spin;
  return scene;
}

Solver<double> solver_of(const Scene& scene) {
  return Solver<double>(scene, {}, sample_sources(scene, 1), sparsegrid::ObstacleSet(scene));
}

/// Largest difference of the particles' velocities from drift + spin x (x - center).
double difference_from_rigid(const HostParticles<double>& at, const HostParticles<double>& moving,
                             const Vec3d& center) {
  double worst = 0;
  for (std::size_t i = 0; i < at.size(); ++i)
    worst = std::max(worst, norm(moving.velocity[i] - drift - cross(spin, at.position[i] - center)));
  return worst;
}

TEST(InitialMotion, ASpinningSourceMovesAsARigidBodyAndTheGridKeepsThat) {
  Scene scene = spinning();
  scene.sources[0].spin_center = Vec3d{0.45, 0.5, 0.52};
  Solver<double> solver = solver_of(scene);
  const HostParticles<double> start = solver.particles();
  EXPECT_LT(difference_from_rigid(start, start, *scene.sources[0].spin_center), 1e-14);
  solver.substep(1e-5);
  EXPECT_LT(difference_from_rigid(start, solver.particles(), *scene.sources[0].spin_center), 1e-12);
}

TEST(InitialMotion, TheCentreOfTheSpinIsThatOfTheSourceUnlessGiven) {
  const Scene scene = spinning();
  const HostParticles<double> start = solver_of(scene).particles();
  EXPECT_LT(difference_from_rigid(start, start, scene.sources[0].position), 1e-14);
}

struct Change {
  double momentum, angular_momentum, kinetic_energy;  ///< relative
};

Change after_steps(TransferScheme scheme, double damping = 0) {
  Scene scene = spinning();
  scene.transfer = {scheme, damping};
  Solver<double> solver = solver_of(scene);
  const Diagnostics start = solver.diagnostics();
  for (int i = 0; i < 40; ++i) solver.substep(1e-4);
  const Diagnostics end = solver.diagnostics();
  const Vec3d c = {0.5, 0.5, 0.5};  // the orbital part of the drift is left out
  const auto about = [&](const Diagnostics& d) { return d.angular_momentum - cross(c, d.momentum); };
  return {norm(end.momentum - start.momentum) / norm(start.momentum),
          norm(about(end) - about(start)) / norm(about(start)), end.kinetic_energy / start.kinetic_energy - 1};
}

TEST(TransferSchemes, ApicAndRpicKeepAngularMomentumAndAllKeepMomentum) {
  for (const TransferScheme scheme : {TransferScheme::apic, TransferScheme::rpic}) {
    const Change change = after_steps(scheme);
    EXPECT_LT(change.momentum, 1e-12);
    EXPECT_LT(change.angular_momentum, 1e-3) << word_of(scheme);  // the drift of the centre over the 4 ms
  }
  const Change pic = after_steps(TransferScheme::pic);
  EXPECT_LT(pic.momentum, 1e-12);
  EXPECT_GT(pic.angular_momentum, 0.05);
}

TEST(TransferSchemes, DampingLiesBetweenTheSchemeAndPic) {
  const double apic = after_steps(TransferScheme::apic).angular_momentum,
               damped = after_steps(TransferScheme::apic, 2000).angular_momentum,
               pic = after_steps(TransferScheme::pic).angular_momentum;
  EXPECT_GT(damped, 10 * apic);
  EXPECT_LT(damped, 0.9 * pic);
}

/// What is left of a stretching velocity field after one transfer back and forth.
double stretch_left(TransferScheme scheme) {
  Scene scene = spinning();
  scene.transfer.scheme = scheme;
  scene.sources[0].velocity = scene.sources[0].angular_velocity = {0, 0, 0};
  SampledParticles sampled = sample_sources(scene, 1);
  const Vec3d c = {0.5, 0.5, 0.5};
  for (std::size_t i = 0; i < sampled.position.size(); ++i) {
    const Vec3d r = sampled.position[i] - c;
    sampled.velocity[i] = {r[0], -r[1], 0};
  }
  Solver<double> solver(scene, {}, sampled, sparsegrid::ObstacleSet(scene));
  for (int i = 0; i < 3; ++i) solver.substep(1e-6);  // the first one finds the affine part
  const HostParticles<double> p = solver.particles();
  double sum = 0, full = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Vec3d r = p.position[i] - c;
    sum += dot(p.velocity[i], Vec3d{r[0], -r[1], 0});
    full += r[0] * r[0] + r[1] * r[1];
  }
  return sum / full;
}

TEST(TransferSchemes, OnlyApicKeepsStretching) {
  const double apic = stretch_left(TransferScheme::apic), rpic = stretch_left(TransferScheme::rpic),
               pic = stretch_left(TransferScheme::pic);
  EXPECT_GT(apic, 0.9);
  EXPECT_LT(rpic, apic - 0.02);
  EXPECT_LT(pic, apic - 0.02);
}

}  // namespace
}  // namespace graupel::mpm
