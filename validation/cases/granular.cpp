// Dry sand against the angle of the Drucker-Prager cone in simple shear, tan = 2 sqrt(3) sin(phi) / (3 - sin(phi))
// (24.0, 34.7, 39.3, 43.4 degrees for phi = 20, 30, 35, 40): an endless layer on an incline rests below and flows above
// it; a poured heap has about that slope. Columns of aspect ratio a = H_0 / L_0 collapse to a runout (L - L_0) / L_0
// of 1.2 a where they are low and 1.9 a^(2/3) where they are tall (Lube et al. 2005), in wide channels like a^(0.9 +-
// 0.1) (Balmforth and Kerswell 2005).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double gravity = 9.81;

MaterialConfig sand(double friction_angle, double youngs_modulus) {
  MaterialConfig m = preset("dry_sand");
  m.friction_angle = friction_angle;
  m.youngs_modulus = youngs_modulus;
  m.poissons_ratio = 0.3;
  m.density = 1500;
  m.cohesion = 0;
  return m;
}

/// Friction angle of the cone in simple shear [degrees].
double shear_angle(double friction_angle) {
  const double sine = std::sin(radians(friction_angle));
  return std::atan(2 * std::sqrt(3.0) * sine / (3 - sine)) * 180 / pi;
}

struct Layer {
  Curve speed;      ///< mean [m/s] over time [s]
  double friction;  ///< shear stress over pressure at the end
};

/// An endless layer on a rough incline.
Layer slide_down(double friction_angle, double degrees, TransferScheme transfer, int cells, const RunOptions& options) {
  constexpr double thick = 0.1;
  const double dx = thick / cells;
  Scene scene = plane_scene(dx, {0, 0}, {6 * dx, thick + 4 * dx});
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{Wall::periodic, {}};
  scene.domain.faces.y_low = WallConfig{Wall::stick, {}};
  scene.gravity = {gravity * std::sin(radians(degrees)), -gravity * std::cos(radians(degrees)), 0};
  scene.materials["sand"] = sand(friction_angle, 1e6);
  add_plane_points(scene, "sand", plane_lattice(scene, {0, 0}, {6 * dx, thick}, 2), 2);
  scene.transfer.scheme = transfer;
  set_time(scene, 1, 40);
  const auto solver = start(scene);
  Layer layer{{fmt::format("{:.1f} degrees", degrees), {}, {}}, 0};
  run_frames(*solver, scene, options, [&] {
    const mpm::Diagnostics d = solver->diagnostics();
    layer.speed.x.push_back(solver->time());
    layer.speed.y.push_back(d.momentum[0] / d.mass);
  });
  double shear = 0, pressure = 0;
  for (const Vec<double, 6>& tau : solver->particles().stress) {
    shear += tau[3];
    pressure -= tau[1];
  }
  layer.friction = shear / pressure;
  return layer;
}

/// Mean acceleration between two times.
double acceleration(const Curve& speed, double from, double to) {
  return (interpolated(speed.x, speed.y, to) - interpolated(speed.x, speed.y, from)) / (to - from);
}

struct Heap {
  double slope;   ///< [degrees]
  Curve profile;  ///< height over the distance from the axis [m]
};

/// Height of the surface in rings of width dx around the axis, a mean over eight sectors, and the slope of its flank,
/// outside the spout's reach and above a fifth of the height.
Heap measure_heap(const Solver& solver, double dx, double reach) {
  constexpr std::size_t sectors = 8;
  std::vector<double> top;
  for (const Vec3d& x : solver.particles().position) {
    const auto ring = static_cast<std::size_t>(std::hypot(x[0], x[2]) / dx);
    const auto sector = static_cast<std::size_t>((std::atan2(x[2], x[0]) / (2 * pi) + 0.5) * sectors) % sectors;
    top.resize(std::max(top.size(), (ring + 1) * sectors), 0);
    top[ring * sectors + sector] = std::max(top[ring * sectors + sector], x[1]);
  }
  Heap heap{0, {"measured", {}, {}}};
  std::vector<double> r, y;
  for (std::size_t ring = 0; ring < top.size() / sectors; ++ring) {
    double mean = 0;
    for (std::size_t s = 0; s < sectors; ++s) mean += top[ring * sectors + s] / sectors;
    heap.profile.x.push_back((static_cast<double>(ring) + 0.5) * dx);
    heap.profile.y.push_back(mean);
    if (heap.profile.x.back() < reach || mean < 0.2 * heap.profile.y[0]) continue;
    r.push_back(heap.profile.x.back());
    y.push_back(mean);
  }
  heap.slope = -std::atan(fit_line(r, y).slope) * 180 / pi;
  return heap;
}

struct Collapse {
  double runout;  ///< (L - L_0) / L_0
  Curve front;    ///< over t / sqrt(H_0 / g)
};

Collapse collapse(double aspect, int cells, const RunOptions& options) {
  constexpr double width = 0.1, friction_angle = 26.3;  // 31 degrees in simple shear, as the sand of the experiments
  const double dx = width / cells, height = aspect * width, unit = std::sqrt(height / gravity);
  const double reach = width * (1.5 + 2.5 * std::max(1.0, std::min(aspect, std::pow(aspect, 0.8))));
  Scene scene = plane_scene(dx, {0, 0}, {std::ceil(reach / dx) * dx, std::ceil(height / dx + 4) * dx});
  scene.domain.faces.y_low = WallConfig{Wall::stick, {}};
  scene.gravity = {0, -gravity, 0};
  scene.materials["sand"] = sand(friction_angle, 3e5 * std::max(1.0, aspect));
  add_plane_points(scene, "sand", plane_lattice(scene, {0, 0}, {width, height}, 2), 2);
  set_time(scene, 5 * unit, 50);
  const auto solver = start(scene);
  Collapse result{0, {fmt::format("a = {:g}", aspect), {}, {}}};
  run_frames(*solver, scene, options, [&] {
    std::vector<double> x;
    for (const Vec3d& position : solver->particles().position) x.push_back(position[0]);
    const auto rank = static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(x.size()));
    std::nth_element(x.begin(), x.begin() + rank, x.end());
    result.front.x.push_back(solver->time() / unit);
    result.front.y.push_back(x[static_cast<std::size_t>(rank)] / width - 1);
  });
  result.runout = result.front.y.back();
  return result;
}

}  // namespace

Outcome infinite_slope(const RunOptions& options) {
  const std::vector<double> angles = options.pick<std::vector<double>>({30}, {20, 30, 40});
  const int cells = options.pick(8, 16);
  Outcome outcome;
  for (const double angle : angles) {
    const double limit = shear_angle(angle);
    const std::string name = fmt::format(", phi = {:g} degrees", angle);
    const Layer below = slide_down(angle, limit - 1, TransferScheme::pic, cells, options),
                above = slide_down(angle, limit + 1, TransferScheme::pic, cells, options),
                steep = slide_down(angle, limit + 5, TransferScheme::apic, cells, options);
    outcome.add(at_most("speed after 1 s, 1 degree below, pic [m/s]" + name, std::abs(below.speed.y.back()), 1e-4));
    outcome.add(at_least("speed after 1 s, 1 degree above, pic [m/s]" + name, above.speed.y.back(), 1e-3));
    outcome.add(
        absolute("angle of the stress in flow, apic [degrees]" + name, std::atan(steep.friction) * 180 / pi, limit, 1));
    const double coulomb =
        gravity * (std::sin(radians(limit + 5)) - std::cos(radians(limit + 5)) * std::tan(radians(limit)));
    outcome.add(relative("acceleration 5 degrees above, 0.2 s to 0.4 s, apic [m/s^2]" + name,
                         acceleration(steep.speed, 0.2, 0.4), coulomb, options.pick(0.4, 0.25)));
    if (angle == 30)
      outcome.figures.push_back({"Layer of sand on an incline, phi = 30",
                                 "time [s]",
                                 "speed [m/s]",
                                 {below.speed, above.speed, steep.speed}});
  }
  return outcome;
}

Outcome angle_of_repose(const RunOptions& options) {
  constexpr double angle = 30, radius = 0.3;  ///< of the heap, about [m]
  const double dx = radius / options.pick(8, 16), tangent = std::tan(radians(shear_angle(angle)));
  const double top = radius * tangent, spout = radius / 4, speed = 0.4, drop = radius / 5;
  const double duration = pi / 3 * radius * radius * top / (pi * spout * spout * speed);
  const double side = std::ceil(2 * radius / dx) * dx, ceiling = std::ceil((top + drop) / dx + 6) * dx;
  Scene scene = space_scene(dx, {-side, 0, -side}, {side, ceiling, side});
  scene.domain.faces.y_low = WallConfig{Wall::stick, {}};
  scene.gravity = {0, -gravity, 0};
  scene.materials["sand"] = sand(angle, 1e6);
  Emitter emitter;
  emitter.shape = Shape::cylinder;
  emitter.radius = spout;
  emitter.height = dx;
  emitter.position = {0, top + drop + dx, 0};
  emitter.velocity = {0, -speed, 0};
  emitter.end_time = duration;
  emitter.material = "sand";
  scene.emitters.push_back(emitter);
  set_time(scene, duration + 0.5, 20);
  const auto solver = start(scene);
  run_frames(*solver, scene, options, [] {});
  const double reach = spout + 2 * dx;
  const Heap heap = measure_heap(*solver, dx, reach);
  Outcome outcome;
  outcome.add(absolute("slope of the heap [degrees]", heap.slope, shear_angle(angle), options.pick(6.0, 3.0)));
  const double high = interpolated(heap.profile.x, heap.profile.y, reach);
  Curve cone{"angle in simple shear", {reach, reach + high / tangent}, {high, 0}, CurveRole::reference};
  outcome.figures.push_back({"Poured heap", "distance from the axis [m]", "height [m]", {heap.profile, cone}});
  return outcome;
}

Outcome column_collapse(const RunOptions& options) {
  Curve measured{"measured", {}, {}}, low{"1.2 a (Lube et al. 2005)", {}, {}, CurveRole::reference},
      tall{"1.9 a^(2/3)", {}, {}, CurveRole::reference};
  Figure fronts{"Collapsing columns of sand", "t / sqrt(H0/g)", "(L - L0) / L0", {}};
  for (const double aspect : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    const Collapse c = collapse(aspect, options.pick(8, 16), options);
    fronts.curves.push_back(c.front);
    measured.x.push_back(aspect);
    measured.y.push_back(c.runout);
    (aspect < 2.5 ? low : tall).x.push_back(aspect);
    (aspect < 2.5 ? low : tall).y.push_back(aspect < 2.5 ? 1.2 * aspect : 1.9 * std::pow(aspect, 2.0 / 3));
  }
  const std::vector<double>& r = measured.y;
  Outcome outcome;
  outcome.add(absolute("exponent, a 2 to 8", std::log2(r[4] / r[2]) / 2, 0.9, 0.1));
  outcome.add(absolute("exponent, a 0.5 to 2", std::log2(r[2] / r[0]) / 2, 1, 0.5));
  outcome.add(relative("runout at a = 1", r[1], 1.2, options.pick(0.4, 0.2)));
  outcome.add(relative("runout at a = 4", r[3], 1.9 * std::pow(4, 2.0 / 3), 0.2));
  outcome.add(relative("runout at a = 8", r[4], 1.9 * std::pow(8, 2.0 / 3), 0.2));
  outcome.figures.push_back(
      {"Runout of columns of sand", "a = H0 / L0", "(L - L0) / L0", {measured, low, tall}, Scale::logarithmic});
  outcome.figures.push_back(fronts);
  return outcome;
}

}  // namespace graupel::validation
