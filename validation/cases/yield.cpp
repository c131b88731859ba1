// Yield of metal and snow in runs of the solver: a bar pulled beyond sigma_Y, with the slope E K / (E + K) of linear
// hardening; a layer sheared beyond sigma_Y / sqrt(3); snow pressed and stretched beyond its elastic range.
#include <algorithm>
#include <cmath>

#include "mpm/materials/material.h"
#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

MaterialConfig metal(double hardening) {
  MaterialConfig m;
  m.model = MaterialModel::metal;
  m.youngs_modulus = 1e6;
  m.poissons_ratio = 0.3;
  m.yield_stress = 2000;
  m.hardening_modulus = hardening;
  m.density = 1000;
  return m;
}

/// The largest stretch (sign 1) or compression (sign -1) along x that leaves F whole, in steps of 1e-5.
double elastic_limit(const mpm::MaterialParameters<double>& m, double sign) {
  for (int i = 1; i < 100000; ++i) {
    const double strain = sign * i * 1e-5;
    Mat3d F = Mat3d::identity();
    double plastic = 1;
    mpm::update_material(m, 1.0, Mat3d::diagonal({strain, 0, 0}), F, plastic);
    if (std::abs(F(0, 0) - (1 + strain)) > 1e-9) return strain - sign * 0.5e-5;
  }
  return 0;
}

/// Stress and strain of the middle of a run beside their law: elastic up to `strength`, then of slope `tangent`.
struct Pull {
  Curve measured{"measured", {}, {}}, theory{"theory", {}, {}, CurveRole::reference};
  double modulus, tangent, strength;

  void add(double strain, double stress) {
    measured.x.push_back(strain);
    measured.y.push_back(stress);
    theory.x.push_back(strain);
    const double yield_strain = strength / modulus;
    theory.y.push_back(strain < yield_strain ? modulus * strain : strength + tangent * (strain - yield_strain));
  }
  /// The straight line of the plastic part, from twice the yield strain on, meets the elastic line at the strength.
  Outcome outcome(const std::string& kind, const std::string& title) const {
    std::vector<double> e, s;
    for (std::size_t i = 0; i < measured.x.size(); ++i)
      if (measured.x[i] > 2 * strength / modulus) {
        e.push_back(measured.x[i]);
        s.push_back(measured.y[i]);
      }
    const Line plastic = fit_line(e, s);
    Outcome result;
    result.add(relative("yield stress in " + kind + " [Pa]", plastic.offset * modulus / (modulus - plastic.slope),
                        strength, 0.01));
    result.add(relative("slope of the hardening in " + kind + " [Pa]", plastic.slope, tangent, 0.03));
    result.figures.push_back({title, "strain", "stress [Pa]", {measured, theory}});
    return result;
  }
};

}  // namespace

Outcome von_mises_bar(const RunOptions& options) {
  const double dx = 1.0 / options.pick(4, 8), hardening = 1e5, half = 2, strain = 0.01;
  const MaterialConfig config = metal(hardening);
  Scene scene = space_scene(dx, {-half - 1, -1, -1}, {half + 1, 1, 1});
  scene.materials["metal"] = config;
  add_points(scene, "metal", space_lattice(scene, {-half, -0.5, -0.5}, {half, 0.5, 0.5}, 2), 2);
  const double duration = 2, rate = strain / duration;  // sound crosses the bar 16 times
  for (const double sign : {-1.0, 1.0}) {               // smooth grips: the ends may shrink
    const double inner = sign * (half - 3 * dx), outer = sign * (half + 3 * dx);
    add_grip(scene, {std::min(inner, outer), -2, -2}, {std::max(inner, outer), 2, 2}, {rate * inner, 0, 0},
             Contact::slip);
  }
  set_time(scene, duration, 50);
  const double nu = config.poissons_ratio;
  const auto solver = start(scene, [&](const Vec3d& x) { return rate * Vec3d{x[0], -nu * x[1], -nu * x[2]}; });
  const Particles first = particles_of(*solver);
  const double E = config.youngs_modulus;
  Pull pull{.modulus = E, .tangent = E * hardening / (E + hardening), .strength = config.yield_stress};
  run_frames(*solver, scene, options, [&] {
    const Particles now = particles_of(*solver);
    std::vector<double> x, u;
    double sum = 0;
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (std::abs(first.position[i][0]) > half / 4) continue;
      x.push_back(first.position[i][0]);
      u.push_back(now.position[i][0] - first.position[i][0]);
      sum += now.stress[i][0];
    }
    pull.add(std::log(1 + fit_line(x, u).slope), sum / static_cast<double>(x.size()));
  });
  return pull.outcome("tension", "Metal bar in tension");
}

Outcome von_mises_shear(const RunOptions& options) {
  const double dx = 1.0 / options.pick(16, 32), strain = 0.02, hardening = 1e5;
  const MaterialConfig config = metal(hardening);
  Scene scene = plane_scene(dx, {0, 0}, {6 * dx, 1 + 4 * dx});
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  scene.domain.faces.y_low = WallConfig{Wall::stick, {}};
  scene.materials["metal"] = config;
  add_plane_points(scene, "metal", plane_lattice(scene, {0, 0}, {6 * dx, 1}, 2), 2);
  const double duration = 2, rate = strain / duration;
  add_grip(scene, {-2, 1 - 3 * dx, -2}, {2, 1 + 2 * dx, 2}, {rate * (1 - 3 * dx), 0, 0}, Contact::stick);
  set_time(scene, duration, 50);
  const auto solver = start(scene, [&](const Vec3d& x) { return Vec3d{rate * x[1], 0, 0}; });
  const Particles first = particles_of(*solver);
  const double shear = config.youngs_modulus / (2 * (1 + config.poissons_ratio)), plastic = hardening / 3;
  Pull pull{.modulus = shear,
            .tangent = shear * plastic / (shear + plastic),
            .strength = config.yield_stress / std::sqrt(3.0)};
  run_frames(*solver, scene, options, [&] {
    const Particles now = particles_of(*solver);
    std::vector<double> y, u;
    double sum = 0;
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (std::abs(first.position[i][1] - 0.5) > 0.25) continue;
      y.push_back(first.position[i][1]);
      u.push_back(std::remainder(now.position[i][0] - first.position[i][0], 6 * dx));
      sum += now.stress[i][3];
    }
    pull.add(fit_line(y, u).slope, sum / static_cast<double>(y.size()));
  });
  return pull.outcome("shear", "Metal in simple shear");
}

Outcome snow_range(const RunOptions&) {
  Outcome outcome;
  const std::pair<const char*, double> presets[] = {{"snow", 7.5e-3}, {"taichi_snow", 4.5e-3}};
  for (const auto& [name, stretch] : presets) {
    const MaterialConfig config = preset(name);
    const auto m = mpm::material_parameters<double>(config);
    const std::string of = std::string(", ") + name;
    outcome.add(absolute("largest elastic stretch" + of, elastic_limit(m, 1), stretch, 1e-5));
    outcome.add(absolute("largest elastic compression" + of, elastic_limit(m, -1), -2.5e-2, 1e-5));
    // Pressed to a plastic volume ratio of 0.9, then by the same small elastic strain as fresh snow.
    double fresh = 1, packed = 0.9;
    Mat3d F = Mat3d::diagonal({0.999, 1, 1}), F_packed = F;
    const double soft = mpm::update_material(m, 1.0, Mat3d::zero(), F, fresh)(0, 0);
    const double hard = mpm::update_material(m, 1.0, Mat3d::zero(), F_packed, packed)(0, 0);
    outcome.add(relative("stiffness at J_p = 0.9 over that at 1" + of, hard / soft, std::exp(1.0), 1e-9));
  }
  return outcome;
}

}  // namespace graupel::validation
