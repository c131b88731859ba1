// Free vibration of an elastic bar in its first mode: v = v_0 sin(pi x / 2 L), omega = (pi / 2 L) sqrt(E / rho) for
// nu = 0, E 100 Pa, 1 kg/m^3, L 25 m, v_0 0.1 m/s. Once fixed at a wall, and once free at both ends with twice the
// length, whose middle rests by symmetry: the method's own order of convergence, without that of the wall.
#include <fmt/format.h>

#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double length = 25, speed = 0.1, modulus = 100, density = 1;

enum class Support { wall, symmetry };

struct Bar {
  Support support;
  Spline spline;
  double order;  ///< of convergence, at least

  std::string name() const {
    return std::string(support == Support::wall ? "at a wall" : "free") + (spline == Spline::cubic ? ", cubic" : "");
  }
};

struct Vibration {
  double period;       ///< [s]
  Curve displacement;  ///< of the centre of mass of x > 0 [m]
};

/// Mean displacement of the particles that start at x > 0.
double displacement_of(const Particles& now, const Particles& first) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < now.size(); ++i)
    if (first.position[i][0] > 0) {
      sum += now.position[i][0] - first.position[i][0];
      count += 1;
    }
  return sum / count;
}

Vibration vibrate(int cells, const Bar& bar, const RunOptions& options) {
  const Support support = bar.support;
  const double dx = length / cells, low = support == Support::wall ? 0 : -length - 4 * dx;
  Scene scene = plane_scene(dx, {low, 0}, {length + 4 * dx, dx});
  scene.transfer.spline = bar.spline;
  scene.materials["bar"] = elastic(modulus, 0, density);
  const double begin = support == Support::wall ? 0 : -length;
  add_plane_points(scene, "bar", plane_lattice(scene, {begin, 0}, {length, dx}, 2), 2);
  const double period = 4 * length / std::sqrt(modulus / density);
  set_time(scene, 4.5 * period, 450, 0.1);
  const auto solver = start(scene, [](const Vec3d& x) {
    return Vec3d{speed * std::sin(pi * x[0] / (2 * length)), 0, 0};
  });
  const Particles first = particles_of(*solver);
  Vibration result{0, {fmt::format("{} cells", cells), {}, {}}};
  run_frames(*solver, scene, options, [&] {
    result.displacement.x.push_back(solver->time());
    result.displacement.y.push_back(displacement_of(particles_of(*solver), first));
  });
  const std::vector<double> zeros = zero_crossings(result.displacement.x, result.displacement.y);
  result.period = 2 * (zeros.back() - zeros.front()) / static_cast<double>(zeros.size() - 1);
  return result;
}

/// Order of convergence from the errors at doubled numbers of cells.
double order_of(const std::vector<double>& errors) {
  std::vector<double> x, y;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    x.push_back(-static_cast<double>(i));
    y.push_back(std::log2(std::abs(errors[i])));
  }
  return fit_line(x, y).slope;
}

}  // namespace

Outcome elastic_bar(const RunOptions& options) {
  const double period = 4 * length / std::sqrt(modulus / density);
  const std::vector<int> cells = options.pick<std::vector<int>>({8, 16, 32}, {8, 16, 32, 64});
  Outcome outcome;
  Figure order{"Error of the period", "cells along the bar", "relative error", {}, Scale::logarithmic};
  for (const Bar& bar : {Bar{Support::symmetry, Spline::quadratic, 1.8}, Bar{Support::wall, Spline::quadratic, 0.9},
                         Bar{Support::symmetry, Spline::cubic, 1.8}}) {
    const std::string name = ", " + bar.name();
    std::vector<double> errors;
    Curve curve{bar.name(), {}, {}};
    for (const int n : cells) {
      const Vibration vibration = vibrate(n, bar, options);
      errors.push_back(vibration.period / period - 1);
      curve.x.push_back(n);
      curve.y.push_back(std::abs(errors.back()));
      if (n != 32) continue;
      outcome.add(relative("period [s], 32 cells" + name, vibration.period, period,
                           bar.support == Support::wall ? 0.02 : 0.01));
      Curve theory{"theory", vibration.displacement.x, {}, CurveRole::reference};
      const double omega = 2 * pi / period;
      for (const double t : theory.x) theory.y.push_back(speed / (pi / 2 * omega) * std::sin(omega * t));
      if (bar.support == Support::wall)
        outcome.figures.push_back(
            {"Elastic bar at a wall", "time [s]", "mean displacement [m]", {vibration.displacement, theory}});
    }
    outcome.add(at_least("order of convergence" + name, order_of(errors), bar.order));
    order.curves.push_back(curve);
  }
  Curve second{"second order", {}, {}, CurveRole::reference};
  for (const int n : cells) {
    second.x.push_back(n);
    second.y.push_back(order.curves[0].y.front() * std::pow(static_cast<double>(cells.front()) / n, 2));
  }
  order.curves.push_back(second);
  outcome.figures.push_back(order);
  return outcome;
}

}  // namespace graupel::validation
