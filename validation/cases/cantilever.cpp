// A cantilever under its own weight: tip deflection rho g A L^4 / (8 E I) = 1.5 rho g L^4 / (E h^2), first frequency
// 0.5596 sqrt(E I / (rho A L^4)). L 10 m, h 2 m, E 100 MPa, 1000 kg/m^3: 0.368 m (slosh's case). Released from the
// straight state it swings about its deflection.
#include <cmath>
#include <numeric>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

Outcome cantilever(const RunOptions& options) {
  constexpr double length = 10, height = 2, modulus = 1e8, density = 1000, gravity = 9.81;
  const double dx = height / options.pick(4, 16);
  Scene scene = plane_scene(dx, {0, -4}, {length + 2, 4});
  scene.gravity = {0, -gravity, 0};
  scene.domain.faces.x_low = WallConfig{Wall::stick, {}};
  scene.materials["beam"] = elastic(modulus, 0, density);
  add_plane_points(scene, "beam", plane_lattice(scene, {0, -height / 2}, {length, height / 2}, 2), 2);
  const double frequency = 0.5596 * std::sqrt(modulus * height * height / 12 / (density * std::pow(length, 4)));
  set_time(scene, 2.3 / frequency, 230);
  const auto solver = start(scene);
  const Particles first = particles_of(*solver);
  std::vector<std::size_t> tip;
  for (std::size_t i = 0; i < first.size(); ++i)
    if (first.position[i][0] > length - dx / 2) tip.push_back(i);
  Curve deflection{"tip", {}, {}};
  run_frames(*solver, scene, options, [&] {
    const Particles now = particles_of(*solver);
    double sum = 0;
    for (const std::size_t i : tip) sum += first.position[i][1] - now.position[i][1];
    deflection.x.push_back(solver->time());
    deflection.y.push_back(sum / static_cast<double>(tip.size()));
  });
  // About its mean over whole periods; the mean depends on the period, which a few rounds settle.
  double period = 1 / frequency, mean = 0;
  for (int round = 0; round < 5; ++round) {
    const auto whole = static_cast<std::ptrdiff_t>(2 * period / scene.frame_time);
    mean = std::accumulate(deflection.y.begin(), deflection.y.begin() + whole, 0.0) / static_cast<double>(whole);
    std::vector<double> about = deflection.y;
    for (double& y : about) y -= mean;
    const std::vector<double> zeros = zero_crossings(deflection.x, about);
    period = zeros[2] - zeros[0];
  }
  const double bent = 1.5 * density * gravity * std::pow(length, 4) / (modulus * height * height);
  Outcome outcome;
  outcome.add(relative("mean deflection of the tip [m], Euler-Bernoulli", mean, bent, 0.10));
  const double sheared = bent * (1 + 0.8 * std::pow(height / length, 2));  // 4 E I / (kappa G A L^2), kappa 5/6, G E/2
  outcome.add(relative("mean deflection of the tip [m], Timoshenko", mean, sheared, options.pick(0.10, 0.05)));
  outcome.add(relative("first frequency [1/s]", 1 / period, frequency, options.pick(0.10, 0.05)));
  Curve theory{"Euler-Bernoulli, first mode", deflection.x, {}, CurveRole::reference};
  for (const double t : theory.x) theory.y.push_back(bent * (1 - std::cos(2 * pi * frequency * t)));
  outcome.figures.push_back({"Cantilever", "time [s]", "deflection of the tip [m]", {deflection, theory}});
  return outcome;
}

}  // namespace graupel::validation
