// Runs with a known answer: columns at rest, a block on an inclined plane.
#include <gtest/gtest.h>

#include "mpm/solver/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

constexpr double pi = 3.14159265358979323846;

constexpr double column_height = 0.32, column_floor = 0.06;

/// A column of 4 x 16 x 4 cells that fills a box of slip walls.
Scene column(const MaterialConfig& material) {
  Scene scene;
  scene.domain.dx = 0.02;
  scene.domain.size = {0.2, 0.6, 0.2};
  scene.domain.walls = Contact::slip;
  scene.materials[material.name] = material;
  Source source = box_source(material.name, {0.1, column_floor + column_height / 2, 0.1}, {0.08, column_height, 0.08});
  source.sampling = Sampling::jittered_lattice;
  scene.sources.push_back(source);
  return scene;
}

struct ColumnAverage {
  double pressure_slope;   ///< d sigma_yy / d y [Pa/m]
  double middle_pressure;  ///< -sigma_yy at half the height [Pa]
  double settlement;       ///< of the centre of mass [m]
};

/// Mean over whole periods T = 4 H / c of the column's free vibration, which surrounds the state at rest.
ColumnAverage average_column(const MaterialConfig& material, double modulus) {
  Scene scene = column(material);
  constexpr int frames = 96, periods = 4;
  scene.frame_time = periods * 4 * column_height / std::sqrt(modulus / material.density) / frames;
  Solver<double> solver(scene, {}, sample_sources(scene, 1), sparsegrid::ObstacleSet(scene));
  const double start = solver.diagnostics().potential_energy, middle = column_floor + column_height / 2;
  double fall = 0, n = 0, sum_y = 0, sum_p = 0, sum_yy = 0, sum_yp = 0;
  for (int f = 0; f < frames; ++f) {
    solver.advance_frame();
    const Diagnostics d = solver.diagnostics();
    fall += (start - d.potential_energy) / (d.mass * 9.8) / frames;
    const HostParticles<double> p = solver.particles();
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double y = p.position[i][1] - middle, pressure = -p.stress[i][1];
      if (std::abs(y) > column_height / 4) continue;  // the kernel blurs floor and surface
      n += 1;
      sum_y += y;
      sum_p += pressure;
      sum_yy += y * y;
      sum_yp += y * pressure;
    }
  }
  const double slope = (sum_yp - sum_y * sum_p / n) / (sum_yy - sum_y * sum_y / n);
  return {-slope, sum_p / n - slope * sum_y / n, fall};
}

/// The weight above is carried: -sigma_yy = rho g (H - y). What is left of the vibration and the sampling's noise: 5 %.
void check_pressure(const ColumnAverage& a, double rho) {
  EXPECT_NEAR(a.pressure_slope, rho * 9.8, 0.05 * rho * 9.8);
  EXPECT_NEAR(a.middle_pressure, rho * 9.8 * column_height / 2, 0.05 * rho * 9.8 * column_height / 2);
}

TEST(Analytic, RestingWaterColumnHasHydrostaticPressure) {
  const MaterialConfig water = preset("water");
  check_pressure(average_column(water, water.bulk_modulus), water.density);
}

/// nu = 0: the walls do not matter and the modulus is E; the centre of mass sinks by rho g H^2 / (3 E). The kernel lets
/// the floor yield like 0.4 dx more of material under the full weight: 3 * 0.4 dx / H = 7.5 % at H = 16 dx.
TEST(Analytic, RestingJellyColumnSettlesByItsModulus) {
  MaterialConfig jelly = preset("jelly");
  jelly.poissons_ratio = 0;
  const double E = jelly.youngs_modulus, rho = jelly.density;
  const ColumnAverage a = average_column(jelly, E);
  check_pressure(a, rho);
  const double settlement = rho * 9.8 * column_height * column_height / (3 * E);
  EXPECT_NEAR(a.settlement, settlement, 0.1 * settlement);
}

/// Way of a jelly block down a plane inclined by `degrees`, between t = 0.1 s and t = 0.4 s, as an acceleration.
double sliding_acceleration(double degrees, double friction, Contact contact) {
  Scene scene;
  scene.domain.dx = 1.0 / 40;
  const double angle = degrees * pi / 180;
  Obstacle plane;
  plane.shape = Shape::plane;
  plane.position = {0.5, 0.4, 0.5};
  plane.rotation_axis = {0, 0, 1};
  plane.rotation_angle = degrees;
  plane.contact = contact;
  plane.friction = friction;
  scene.obstacles.push_back(plane);
  scene.materials["jelly"] = preset("jelly");
  scene.materials["jelly"].youngs_modulus = 3e5;
  const Vec3d normal = {-std::sin(angle), std::cos(angle), 0}, down = {-std::cos(angle), -std::sin(angle), 0};
  Source block = box_source("jelly", plane.position - 0.2 * down + 0.055 * normal, {0.25, 0.1, 0.15});
  block.rotation_axis = {0, 0, 1};
  block.rotation_angle = degrees;
  scene.sources.push_back(block);
  const auto sim = Simulation::create(scene, {});
  const auto speed = [&] {
    const Diagnostics d = sim->diagnostics();
    return dot(d.momentum, down) / d.mass;
  };
  for (int f = 0; f < 6; ++f) sim->advance_frame();
  const double early = speed();
  for (int f = 0; f < 18; ++f) sim->advance_frame();
  return (speed() - early) / 0.3;
}

/// a = g (sin - mu cos). The normal impulse still swings with the block's vibration: 4 % of g.
TEST(Analytic, ABlockSlidesDownAnInclinedPlaneByCoulombsLaw) {
  const double angle = 24 * pi / 180;
  for (const double mu : {0.0, 0.2})
    EXPECT_NEAR(sliding_acceleration(24, mu, Contact::slip), 9.8 * (std::sin(angle) - mu * std::cos(angle)), 0.4)
        << "mu " << mu;
  EXPECT_NEAR(sliding_acceleration(24, 0.2, Contact::separate), 9.8 * (std::sin(angle) - 0.2 * std::cos(angle)), 0.4);
}

TEST(Analytic, ABlockStaysWhereFrictionHoldsIt) {
  EXPECT_NEAR(sliding_acceleration(24, 0.6, Contact::slip), 0, 0.1);
  EXPECT_NEAR(sliding_acceleration(24, 0.0, Contact::stick), 0, 0.1);
}

}  // namespace
}  // namespace graupel::mpm
