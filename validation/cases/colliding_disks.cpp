// Two elastic disks that collide (Sulsky, Chen and Schreyer 1994; karamelo, two-disks): E 1000 Pa, nu 0.3, 1000 kg/m^3,
// radius 0.2 m, centres (0.2, 0.2) and (0.8, 0.8) m, velocities +-(0.1, 0.1) m/s, dx 0.05 m. Surfaces meet at
// (0.6 sqrt(2) - 0.4) / (0.2 sqrt(2)) = 1.586 s; the grid lets them feel each other about dx / (relative speed) before.
#include <algorithm>
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

Scene disks(double dx) {
  Scene scene = plane_scene(dx, {-0.2, -0.2}, {1.2, 1.2});
  scene.materials["rubber"] = elastic(1000, 0.3, 1000);
  for (const double sign : {1.0, -1.0}) {
    const Vec2d centre = Vec2d::filled(0.5 - 0.3 * sign);
    const auto inside = [&](const Vec2d& x) { return norm(x - centre) <= 0.2; };
    Source& disk = add_plane_points(
        scene, "rubber", plane_lattice(scene, centre - Vec2d::filled(0.2), centre + Vec2d::filled(0.2), 4, inside), 4);
    disk.velocity = {0.1 * sign, 0.1 * sign, 0};
  }
  set_time(scene, 3.5, 350);
  return scene;
}

}  // namespace

Outcome colliding_disks(const RunOptions& options) {
  const double dx = options.pick(0.05, 0.0125);
  const Scene scene = disks(dx);
  const auto solver = start(scene);
  const double speed = 0.2 * std::sqrt(2.0), touch = (0.6 * std::sqrt(2.0) - 0.4) / speed;
  Curve kinetic{"kinetic", {}, {}}, elastic_energy{"elastic", {}, {}}, total{"total", {}, {}};
  double momentum = 0, first_contact = 0, start_energy = 0, gain = 0;
  run_frames(*solver, scene, options, [&] {
    const mpm::Diagnostics d = solver->diagnostics();
    const double k = d.kinetic_energy / plane_depth, e = d.elastic_energy / plane_depth;
    if (start_energy == 0) start_energy = k;
    if (first_contact == 0 && k < 0.99 * start_energy) first_contact = solver->time();
    momentum = std::max(momentum, norm(d.momentum) / (d.mass * 0.1));
    gain = std::max(gain, (k + e) / start_energy - 1);
    for (Curve* curve : {&kinetic, &elastic_energy, &total}) curve->x.push_back(solver->time());
    kinetic.y.push_back(k);
    elastic_energy.y.push_back(e);
    total.y.push_back(k + e);
  });
  Outcome outcome;
  outcome.add(relative("kinetic energy at the start [J/m]", kinetic.y.front(), 0.8 * pi, 0.01));
  outcome.add(absolute("time of contact (1 % of the energy) [s]", first_contact, touch - dx / speed, dx / speed));
  outcome.add(absolute("largest momentum over m 0.1 m/s", momentum, 0, 1e-12));
  outcome.add(at_most("largest gain of energy, relative", gain, 1e-3));
  outcome.add(relative("energy at the end [J/m]", total.y.back(), total.y.front(), options.pick(0.35, 0.08)));
  outcome.add(
      at_least("coefficient of restitution", std::sqrt(kinetic.y.back() / kinetic.y.front()), options.pick(0.8, 0.93)));
  outcome.figures.push_back({"Colliding disks", "time [s]", "energy [J/m]", {kinetic, elastic_energy, total}});
  return outcome;
}

}  // namespace graupel::validation
