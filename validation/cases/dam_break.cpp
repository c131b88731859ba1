// The collapse of a column of water of width a = 0.05715 m and height 2a (Martin and Moyce 1952): front Z = x/a over
// T = t sqrt(2 g / a), height H at the wall over t sqrt(g / a). Water without viscosity runs 5-15 % ahead of the
// experiment, whose gate and floor delay it; its front cannot be faster than dZ/dT = 2 (Ritter 1892).
#include <algorithm>
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double width = 0.05715, gravity = 9.81;

/// Martin and Moyce 1952, tables 2 and 6, n^2 = 2, a = 2.25 in.
const Curve front_data = {"Martin and Moyce",
                          {.41, .84, 1.19, 1.43, 1.63, 1.83, 1.98, 2.20, 2.32, 2.51, 2.65, 2.83, 2.98, 3.11, 3.33},
                          {1.11, 1.22, 1.44, 1.67, 1.89, 2.11, 2.33, 2.56, 2.78, 3.00, 3.22, 3.44, 3.67, 3.89, 4.11},
                          CurveRole::reference};
/// The same, their figure 3, digitised (pysph, db_exp_data.py).
const Curve figure_data = {"Martin and Moyce, figure 3",
                           {.832, 1.219, 1.997, 2.547, 3.345, 4.034},
                           {1.217, 1.474, 2.292, 2.995, 4.134, 4.944},
                           CurveRole::reference};
const Curve height_data = {"Martin and Moyce",
                           {.56, .77, .93, 1.08, 1.28, 1.46, 1.66, 1.84, 2.00, 2.21, 2.45, 2.70, 3.06, 3.44},
                           {.94, .89, .83, .78, .72, .67, .61, .56, .50, .44, .39, .33, .28, .22},
                           CurveRole::reference};

/// The x that only `fraction` of the particles have passed.
double front_of(const Particles& particles, double fraction) {
  std::vector<double> x;
  for (const Vec3d& position : particles.position) x.push_back(position[0]);
  const auto rank = static_cast<std::ptrdiff_t>((1 - fraction) * static_cast<double>(x.size()));
  std::nth_element(x.begin(), x.begin() + rank, x.end());
  return x[static_cast<std::size_t>(rank)];
}

double height_at_wall(const Particles& particles, double dx) {
  double highest = 0;
  for (const Vec3d& x : particles.position)
    if (x[0] < 2 * dx) highest = std::max(highest, x[1] + dx / 4);
  return highest;
}

double volume_ratio(const Particles& particles) {
  double now = 0, rest = 0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    now += particles.internal[i] * particles.volume[i];
    rest += particles.volume[i];
  }
  return now / rest;
}

Line slope_between(const Curve& curve, double from, double to) {
  std::vector<double> x, y;
  for (double t = from; t <= to; t += 0.05) {
    x.push_back(t);
    y.push_back(interpolated(curve.x, curve.y, t));
  }
  return fit_line(x, y);
}

}  // namespace

Outcome dam_break(const RunOptions& options) {
  const double dx = width / options.pick(16, 64);
  Scene scene = plane_scene(dx, {0, 0}, {8 * width, 3 * width});
  scene.domain.walls = Contact::separate;
  scene.gravity = {0, -gravity, 0};
  MaterialConfig water = preset("water");
  water.viscosity = 0;
  water.bulk_modulus = water.density * 100 * gravity * 2 * width;  // c = 10 sqrt(g 2a)
  scene.materials["water"] = water;
  add_plane_points(scene, "water", plane_lattice(scene, {0, 0}, {width, 2 * width}, 2), 2);
  const double unit = std::sqrt(width / gravity);
  set_time(scene, 3.44 * unit, 172);
  const auto solver = start(scene);
  Curve front{"measured", {}, {}}, height{"measured", {}, {}};
  double loss = 0, fastest = 0;
  run_frames(*solver, scene, options, [&] {
    const Particles now = particles_of(*solver);
    const double t = solver->time() / unit;
    front.x.push_back(t * std::sqrt(2.0));
    front.y.push_back((front_of(now, 0.002) + dx / 4) / width);
    height.x.push_back(t);
    height.y.push_back(height_at_wall(now, dx) / (2 * width));
    loss = std::max(loss, std::abs(volume_ratio(now) - 1));
    if (front.x.back() > 0.5 && front.x.back() < 3.5) {
      const std::size_t n = front.x.size();
      fastest = std::max(fastest, (front.y[n - 1] - front.y[n - 11]) / (front.x[n - 1] - front.x[n - 11]));
    }
  });
  double worst_height = 0, ahead = 0;
  for (std::size_t i = 0; i < height_data.x.size(); ++i)
    worst_height =
        std::max(worst_height, std::abs(interpolated(height.x, height.y, height_data.x[i]) - height_data.y[i]));
  for (std::size_t i = 0; i < front_data.x.size(); ++i)
    ahead = std::max(ahead, interpolated(front.x, front.y, front_data.x[i]) / front_data.y[i] - 1);
  Outcome outcome;
  outcome.add(relative("speed of the front dZ/dT, T 1.5 to 3.3", slope_between(front, 1.5, 3.3).slope,
                       slope_between(front_data, 1.5, 3.3).slope, 0.15));
  outcome.add(at_most("front ahead of the experiment, largest share", ahead, 0.15));
  outcome.add(at_most("fastest dZ/dT (Ritter)", fastest, 2));
  outcome.add(at_most("height at the wall, largest error [2a]", worst_height, 0.06));
  outcome.add(at_most("change of volume, largest share", loss, 0.02));
  outcome.figures.push_back({"Dam break: front", "T = t sqrt(2g/a)", "Z = x/a", {front, front_data, figure_data}});
  outcome.figures.push_back({"Dam break: height", "t sqrt(g/a)", "H = height/2a", {height, height_data}});
  return outcome;
}

}  // namespace graupel::validation
