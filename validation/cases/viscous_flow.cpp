// Viscous flows with known profiles: the decay of a shear wave, exp(-nu k^2 t); a Newtonian film on an incline,
// u = (rho g_x / mu)(H y - y^2 / 2); and a Bingham film, whose upper part of thickness tau_0 / (rho g_x) moves as a
// plug at rho g_x (H - h_plug)^2 / (2 mu_B).
#include <algorithm>
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double thick = 0.1, pull = 1, press = 2;  ///< film [m], gravity along and across it [m/s^2]

/// A film on a floor that sticks, endless along x.
Scene film(const MaterialConfig& material, double dx) {
  Scene scene = plane_scene(dx, {0, 0}, {6 * dx, thick + 4 * dx});
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  scene.domain.faces.y_low = WallConfig{Wall::stick, {}};
  scene.gravity = {pull, -press, 0};
  scene.materials["film"] = material;
  add_plane_points(scene, "film", plane_lattice(scene, {0, 0}, {6 * dx, thick}, 2), 2);
  return scene;
}

/// Velocity along the film over the height, one point a layer of particles.
Curve profile_of(const Particles& first, const Particles& last) {
  Curve profile{"measured", {}, {}};
  std::vector<std::pair<double, double>> layers;
  for (std::size_t i = 0; i < last.size(); ++i)
    if (first.position[i][0] < 2 * (first.position[0][0]))
      layers.emplace_back(last.position[i][1], last.velocity[i][0]);
  std::sort(layers.begin(), layers.end());
  for (const auto& [y, u] : layers) {
    profile.x.push_back(y);
    profile.y.push_back(u);
  }
  return profile;
}

/// Runs the film to its steady flow and compares the profile with `theory`.
Outcome check_film(const Scene& scene, const std::function<double(double)>& theory, double tolerance,
                   const std::string& title, const RunOptions& options) {
  const auto solver = start(scene);
  const Particles first = particles_of(*solver);
  run_frames(*solver, scene, options, [] {});
  const Curve measured = profile_of(first, particles_of(*solver));
  Curve reference{"theory", {}, {}, CurveRole::reference};
  const double surface = theory(thick);
  double error = 0;
  for (std::size_t i = 0; i < measured.x.size(); ++i) {
    reference.x.push_back(measured.x[i]);
    reference.y.push_back(theory(measured.x[i]));
    error += std::pow((measured.y[i] - reference.y[i]) / surface, 2);
  }
  Outcome outcome;
  outcome.add(relative("speed of the surface [m/s]", measured.y.back(), surface, tolerance));
  outcome.add(at_most("rms error of the profile, of the surface's speed",
                      std::sqrt(error / static_cast<double>(measured.x.size())), tolerance));
  outcome.figures.push_back({title, "height [m]", "speed [m/s]", {measured, reference}});
  return outcome;
}

}  // namespace

Outcome shear_wave(const RunOptions& options) {
  constexpr double length = 1, viscosity = 20, density = 1000, speed = 0.1;
  const double dx = length / options.pick(16, 32), k = 2 * pi / length, rate = viscosity / density * k * k;
  Scene scene = plane_scene(dx, {0, 0}, {6 * dx, length});
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  scene.domain.faces.y_low = scene.domain.faces.y_high = WallConfig{Wall::periodic, {}};
  MaterialConfig water = preset("water");
  water.viscosity = viscosity;
  water.bulk_modulus = 100 * density * speed * speed;
  scene.materials["water"] = water;
  add_plane_points(scene, "water", plane_lattice(scene, {0, 0}, {6 * dx, length}, 2), 2);
  set_time(scene, 2 / rate, 40);
  const auto solver = start(scene, [&](const Vec3d& x) { return Vec3d{speed * std::sin(k * x[1]), 0, 0}; });
  Curve amplitude{"measured", {}, {}}, theory{"exp(-nu k^2 t)", {}, {}, CurveRole::reference};
  std::vector<double> logarithm;
  run_frames(*solver, scene, options, [&] {
    const Particles now = particles_of(*solver);
    double sum = 0;
    for (std::size_t i = 0; i < now.size(); ++i) sum += now.velocity[i][0] * std::sin(k * now.position[i][1]);
    amplitude.x.push_back(solver->time());
    amplitude.y.push_back(2 * sum / static_cast<double>(now.size()) / speed);
    logarithm.push_back(std::log(amplitude.y.back()));
    theory.x.push_back(solver->time());
    theory.y.push_back(std::exp(-rate * solver->time()));
  });
  Outcome outcome;
  outcome.add(relative("rate of decay [1/s]", -fit_line(amplitude.x, logarithm).slope, rate, options.pick(0.05, 0.02)));
  outcome.figures.push_back({"Shear wave", "time [s]", "amplitude", {amplitude, theory}});
  return outcome;
}

Outcome poiseuille_film(const RunOptions& options) {
  MaterialConfig honey = preset("water");
  honey.density = 1000;
  honey.viscosity = 10;
  honey.bulk_modulus = 1e5;
  Scene scene = film(honey, thick / options.pick(16, 32));
  const double diffusivity = honey.viscosity / honey.density;
  set_time(scene, 2 * thick * thick / diffusivity, 20);
  const double factor = honey.density * pull / honey.viscosity;
  return check_film(
      scene, [=](double y) { return factor * (thick * y - y * y / 2); }, options.pick(0.05, 0.03), "Newtonian film",
      options);
}

Outcome bingham_film(const RunOptions& options) {
  MaterialConfig paste = preset("toothpaste");
  paste.density = 1000;
  paste.youngs_modulus = 5e4;
  paste.poissons_ratio = 0.4;
  paste.consistency = 5;
  paste.flow_index = 1;
  const double shear_strength = 0.4 * paste.density * pull * thick;
  paste.yield_stress = std::sqrt(3.0) * shear_strength;
  Scene scene = film(paste, thick / options.pick(16, 32));
  const double sheared = thick - shear_strength / (paste.density * pull);
  set_time(scene, 5 * sheared * sheared * paste.density / paste.consistency, 20);
  const double factor = paste.density * pull / paste.consistency;
  return check_film(
      scene,
      [=](double y) {
        const double within = std::min(y, sheared);
        return factor * (sheared * within - within * within / 2);
      },
      options.pick(0.05, 0.03), "Bingham film", options);
}

}  // namespace graupel::validation
