// A rotating and flying elastic square (matter's EnergyTest): side 1 m, omega 1/s, v_cm (0.5, 0.5) m/s, E 1 MPa,
// nu 0.3, 1550 kg/m^3, 20 s. The motion is rigid: transfers that lose energy or angular momentum show here.
#include <algorithm>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

Outcome rotating_square(const RunOptions& options) {
  const double duration = options.pick(5.0, 20.0), dx = options.pick(0.125, 0.0625);
  Scene scene = plane_scene(dx, {-1, -1}, {12, 12});
  scene.materials["rubber"] = elastic(1e6, 0.3, 1550);
  add_plane_points(scene, "rubber", plane_lattice(scene, {0, 0}, {1, 1}, 2), 2);
  Source& square = scene.sources[0];
  square.velocity = {0.5, 0.5, 0};
  square.angular_velocity = {0, 0, 1};
  square.spin_center = Vec3d{0.5, 0.5, 0};
  set_time(scene, duration, 100);
  const auto solver = start(scene);
  const mpm::Diagnostics first = solver->diagnostics();
  Curve loss{"relative loss of kinetic energy", {}, {}};
  double largest = 0, smallest = 0;
  run_frames(*solver, scene, options, [&] {
    loss.x.push_back(solver->time());
    loss.y.push_back(1 - solver->diagnostics().kinetic_energy / first.kinetic_energy);
    largest = std::max(largest, loss.y.back());
    smallest = std::min(smallest, loss.y.back());
  });
  const mpm::Diagnostics last = solver->diagnostics();
  Outcome outcome;
  outcome.add(at_most("largest relative loss of kinetic energy", largest, 1e-3));
  outcome.add(at_least("smallest relative loss (a gain is negative)", smallest, -1e-12));
  outcome.add(relative("angular momentum [kg m^2/s]", last.angular_momentum[2], first.angular_momentum[2], 1e-10));
  outcome.figures.push_back({"Rotating square", "time [s]", "relative loss of kinetic energy", {loss}});
  return outcome;
}

}  // namespace graupel::validation
