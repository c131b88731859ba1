// Uniaxial compression of a cube between a smooth floor and a smooth plate (cb-geo's benchmark: E 1000 Pa, nu 0.2,
// sigma = E u / l = -1 Pa after a strain of 0.001, lateral strain -nu times the axial one), and compression in a rigid
// box, -p / ln J = K (matter, 3 %). Damped by pic transfers.
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

/// A smooth plate whose lower face is the plane y = `height` at the start, sinking at `speed`.
void add_plate(Scene& scene, double height, double speed) {
  const Vec3d low = scene.domain.origin, high = low + scene.domain.size;
  add_grip(scene, {low[0] - 1, height, low[2] - 1}, {high[0] + 1, height + 6 * scene.domain.dx, high[2] + 1},
           {0, -speed, 0}, Contact::slip);
}

}  // namespace

Outcome uniaxial_compression(const RunOptions& options) {
  constexpr double modulus = 1000, nu = 0.2, density = 1, strain = 1e-3;
  const double dx = 1.0 / options.pick(8, 16), margin = 3 * dx;
  Scene scene = space_scene(dx, {-margin, 0, -margin}, {1 + margin, 1 + 8 * dx, 1 + margin});
  scene.materials["block"] = elastic(modulus, nu, density);
  scene.transfer.scheme = TransferScheme::pic;
  add_points(scene, "block", space_lattice(scene, {0, 0, 0}, {1, 1, 1}, 2), 2);
  const double duration = 2;  // the sound crosses the cube 60 times
  add_plate(scene, 1, strain / duration);
  set_time(scene, duration, 20);
  const auto solver = start(scene, [&](const Vec3d& x) { return Vec3d{0, -strain / duration * x[1], 0}; });
  const Particles first = particles_of(*solver);
  run_frames(*solver, scene, options, [] {});
  const Particles last = particles_of(*solver);
  std::vector<double> y, u_y, x, u_x;
  double stress = 0;
  for (std::size_t i = 0; i < last.size(); ++i) {
    const Vec3d at = first.position[i], u = last.position[i] - at;
    if (std::abs(at[1] - 0.5) > 0.25) continue;
    y.push_back(at[1]);
    u_y.push_back(u[1]);
    x.push_back(at[0]);
    u_x.push_back(u[0]);
    stress += last.stress[i][1];
  }
  stress /= static_cast<double>(y.size());
  const double axial = fit_line(y, u_y).slope, lateral = fit_line(x, u_x).slope;
  Outcome outcome;
  outcome.add(relative("stress over strain in the middle half [Pa]", stress / axial, modulus, 0.01));
  outcome.add(relative("lateral over axial strain in the middle half", -lateral / axial, nu, 0.02));
  outcome.add(relative("stress in the middle half [Pa]", stress, -modulus * strain, options.pick(0.10, 0.05)));
  return outcome;
}

Outcome bulk_compression(const RunOptions& options) {
  constexpr double squeeze = 0.1;
  const double dx = 1.0 / options.pick(32, 64);
  MaterialConfig soil;  // StVK-Hencky, in which the law is exact, far below its yield
  soil.model = MaterialModel::metal;
  soil.youngs_modulus = 1e5;
  soil.poissons_ratio = 0.3;
  soil.yield_stress = 1e5;
  const double bulk = soil.youngs_modulus / (3 * (1 - 2 * soil.poissons_ratio));
  const double speed = std::sqrt(1.35 * soil.youngs_modulus / soil.density), duration = 40 / speed;
  Scene scene = plane_scene(dx, {0, 0}, {0.25, 1 + 8 * dx});
  scene.materials["soil"] = soil;
  scene.transfer.scheme = TransferScheme::pic;
  add_plane_points(scene, "soil", plane_lattice(scene, {0, 0}, {0.25, 1}, 2), 2);
  add_plate(scene, 1, squeeze / duration);
  set_time(scene, duration, 20);
  const auto solver = start(scene, [&](const Vec3d& x) { return Vec3d{0, -squeeze / duration * x[1], 0}; });
  const Particles first = particles_of(*solver);
  Curve pressure{"measured", {}, {}}, law{"-K ln J", {}, {}, CurveRole::reference};
  run_frames(*solver, scene, options, [&] {
    const Particles now = particles_of(*solver);
    std::vector<double> from, to;
    double sum = 0;
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (std::abs(first.position[i][1] - 0.5) > 0.25) continue;
      from.push_back(first.position[i][1]);
      to.push_back(now.position[i][1]);
      sum -= (now.stress[i][0] + now.stress[i][1] + now.stress[i][2]) / 3;
    }
    const double log_volume = std::log(fit_line(from, to).slope);
    pressure.x.push_back(-log_volume);
    pressure.y.push_back(sum / static_cast<double>(from.size()));
    law.x.push_back(-log_volume);
    law.y.push_back(-bulk * log_volume);
  });
  Outcome outcome;
  outcome.add(
      relative("pressure over -ln J in the middle half [Pa]", pressure.y.back() / pressure.x.back(), bulk, 0.03));
  outcome.add(relative("the same by the plate's way [Pa]", -pressure.y.back() / std::log(1 - squeeze), bulk,
                       options.pick(0.15, 0.08)));
  outcome.figures.push_back({"Compression in a box", "-ln J", "Kirchhoff pressure [Pa]", {pressure, law}});
  return outcome;
}

}  // namespace graupel::validation
