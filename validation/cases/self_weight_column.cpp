// A column under its own weight, sigma_yy = -rho g (H - y), settled by rho g H^2 / (2 M) at its top (cb-geo's
// benchmark: H 0.1 m, 1800 kg/m^3, g 9.81 m/s^2, 1765.8 Pa at the base; its own code is 4.8, 2.3 and 1.1 % off at
// dx 0.01, 0.005 and 0.0025 m). Damped by pic transfers, compared at every particle.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double height = 0.1, density = 1800, gravity = 9.81, modulus = 1e6;

struct Settled {
  Curve stress;        ///< -sigma_yy [Pa] over the height [m]
  double mean_error;   ///< root mean square over the particles above the first cell, of rho g H
  double floor_error;  ///< largest in the first cell, of rho g H
  double base_error;   ///< at the lowest particles, of their own reference
  double settlement;   ///< of the top particles [m]
};

Settled settle(double dx, const RunOptions& options) {
  Scene scene = plane_scene(dx, {0, 0}, {dx, height + 4 * dx});
  scene.gravity = {0, -gravity, 0};
  scene.transfer.scheme = TransferScheme::pic;
  scene.materials["soil"] = elastic(modulus, 0, density);
  add_plane_points(scene, "soil", plane_lattice(scene, {0, 0}, {dx, height}, 2), 2);
  const double period = 4 * height / std::sqrt(modulus / density);
  // pic diffuses velocity by dx^2 / (4 dt): the vibration falls by e in about H / (2.5 dx) periods.
  set_time(scene, period * 4 * height / dx, 20);
  const auto solver = start(scene);
  const Particles first = particles_of(*solver);
  run_frames(*solver, scene, options, [] {});
  const Particles last = particles_of(*solver);
  Settled result{{fmt::format("dx {:g} m", dx), {}, {}}, 0, 0, 0, 0};
  double top = 0, above = 0;
  for (std::size_t i = 0; i < last.size(); ++i) {
    const double y = first.position[i][1], expected = density * gravity * (height - y);
    const double stress = -last.stress[i][1] / determinant(last.deformation_gradient[i]);
    const double error = (stress - expected) / (density * gravity * height);
    if (y > dx) {
      result.mean_error += error * error;
      above += 1;
    } else {
      result.floor_error = std::max(result.floor_error, std::abs(error));
    }
    if (y < dx / 2) result.base_error = stress / expected - 1;
    if (y > height - dx / 2) {
      result.settlement += y - last.position[i][1];
      top += 1;
    }
    if (first.position[i][0] < dx / 2) {
      result.stress.x.push_back(y);
      result.stress.y.push_back(stress);
    }
  }
  result.mean_error = std::sqrt(result.mean_error / above);
  result.settlement /= top;
  return result;
}

}  // namespace

Outcome self_weight_column(const RunOptions& options) {
  const std::vector<std::pair<double, double>> cases = options.pick<std::vector<std::pair<double, double>>>(
      {{0.01, 0.048}, {0.005, 0.023}}, {{0.01, 0.048}, {0.005, 0.023}, {0.0025, 0.011}});
  Outcome outcome;
  Figure figure{"Column under its own weight", "height [m]", "-stress [Pa]", {}};
  const double sunk = density * gravity * height * height / (2 * modulus);
  for (const auto& [dx, tolerance] : cases) {
    const Settled settled = settle(dx, options);
    const std::string name = fmt::format(", dx {:g} m", dx);
    outcome.add(
        at_most("rms error of the stress above the first cell, of rho g H" + name, settled.mean_error, tolerance));
    outcome.add(at_most("largest error in the first cell, of rho g H" + name, settled.floor_error, 0.2));
    outcome.add(absolute("relative error at the lowest particle" + name, settled.base_error, 0, 0.048));
    outcome.add(relative("settlement of the top [m]" + name, settled.settlement, sunk, tolerance));
    figure.curves.push_back(settled.stress);
  }
  figure.curves.push_back({"rho g (H - y)", {0, height}, {density * gravity * height, 0}, CurveRole::reference});
  outcome.figures.push_back(figure);
  return outcome;
}

}  // namespace graupel::validation
