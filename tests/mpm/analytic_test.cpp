// Runs with a known answer: columns at rest, a block on an inclined plane.
#include <gtest/gtest.h>

#include "mpm/solver.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

constexpr double pi = 3.14159265358979323846;

/// A column of 4 x 16 x 4 cells that fills a box of slip walls.
Scene column(const std::string& material) {
  Scene scene;
  scene.domain.dx = 0.02;
  scene.domain.size = {0.2, 0.6, 0.2};
  scene.domain.walls = Contact::slip;
  scene.materials[material] = preset(material);
  Source source = box_source(material, {0.1, 0.22, 0.1}, {0.08, 0.32, 0.08});
  source.sampling = Sampling::jittered_lattice;
  scene.sources.push_back(source);
  return scene;
}

struct ColumnAverage {
  double pressure_slope;  ///< -d sigma_yy / d y [Pa/m]
  double settlement;      ///< of the centre of mass [m]
};

/// Mean over whole periods T = 4 H / c of the column's free vibration, which surrounds the state at rest.
ColumnAverage average_column(const std::string& material, double modulus) {
  Scene scene = column(material);
  const double H = 0.32, rho = scene.materials[material].density;
  constexpr int frames = 96, periods = 4;
  scene.frame_time = periods * 4 * H / std::sqrt(modulus / rho) / frames;
  Solver<double> solver(scene, {}, sample_sources(scene, 1), sparsegrid::ObstacleSet(scene));
  const double start = solver.diagnostics().potential_energy;
  double fall = 0, n = 0, sum_y = 0, sum_p = 0, sum_yy = 0, sum_yp = 0;
  for (int f = 0; f < frames; ++f) {
    solver.advance_frame();
    const Diagnostics d = solver.diagnostics();
    fall += (start - d.potential_energy) / (d.mass * 9.8) / frames;
    const HostParticles<double> p = solver.particles();
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double y = p.position[i][1], pressure = -p.stress[i][1];
      if (y < 0.06 + 0.25 * H || y > 0.06 + 0.75 * H) continue;  // the kernel blurs floor and surface
      n += 1;
      sum_y += y;
      sum_p += pressure;
      sum_yy += y * y;
      sum_yp += y * pressure;
    }
  }
  return {-(sum_yp - sum_y * sum_p / n) / (sum_yy - sum_y * sum_y / n), fall};
}

/// Weight is balanced by -d sigma / d y = rho g; the centre of mass sinks by rho g H^2 / (3 M). The modulus is exact,
/// the height only to about half a cell at either end, hence 10 % at H = 16 dx.
void check_column(const std::string& material, double modulus) {
  const double rho = preset(material).density, H = 0.32;
  const ColumnAverage a = average_column(material, modulus);
  EXPECT_NEAR(a.pressure_slope, rho * 9.8, 0.05 * rho * 9.8) << material;
  EXPECT_NEAR(a.settlement, rho * 9.8 * H * H / (3 * modulus), 0.1 * rho * 9.8 * H * H / (3 * modulus)) << material;
}

TEST(Analytic, RestingWaterColumnHasHydrostaticPressure) { check_column("water", preset("water").bulk_modulus); }

TEST(Analytic, RestingJellyColumnSettlesByItsConfinedModulus) {
  const auto m = material_parameters<double>(preset("jelly"));
  check_column("jelly", m.lambda + 2 * m.mu);
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
