// A wide plate with a hole of radius R = 0.2 W, half its width W, in tension: the stress at the hole's edge is 3.14
// times that far from it (Heywood 1952: (2 + (1 - 2R/2W)^3) / (1 - 2R/2W); cb-geo's benchmark gets 3.13).
#include <algorithm>
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double radius = 1, half_width = 5, half_height = 7, rate = 1e-5;  ///< strain rate [1/s]
constexpr double grip = 0.5;                                                ///< height of the gripped ends

Scene plate(double dx) {
  Scene scene = plane_scene(dx, {-half_width - 1, -half_height - 1}, {half_width + 1, half_height + 1});
  scene.materials["plate"] = elastic(1, 0.3, 1);
  scene.transfer.scheme = TransferScheme::pic;
  add_plane_points(scene, "plate",
                   plane_lattice(scene, {-half_width, -half_height}, {half_width, half_height}, 2,
                                 [](const Vec2d& x) { return norm(x) > radius; }),
                   2);
  for (const double sign : {-1.0, 1.0}) {
    const double inner = sign * (half_height - grip), outer = sign * (half_height + grip);
    add_grip(scene, {-half_width - 1, std::min(inner, outer), -1}, {half_width + 1, std::max(inner, outer), 1},
             {0, rate * inner, 0}, Contact::slip);
  }
  return scene;
}

/// Least squares of a + b s + c s^2, evaluated at s = 1, by the normal equations.
double parabola_at_one(const std::vector<double>& s, const std::vector<double>& y) {
  Mat3d A = Mat3d::zero();
  Vec3d b = Vec3d::zero();
  for (std::size_t i = 0; i < s.size(); ++i) {
    const Vec3d row = {1, s[i], s[i] * s[i]};
    A += outer(row, row);
    b += y[i] * row;
  }
  Vec3d c;
  for (int k = 0; k < 3; ++k) {  // Cramer's rule
    Mat3d Ak = A;
    for (int r = 0; r < 3; ++r) Ak(r, k) = b[r];
    c[k] = determinant(Ak) / determinant(A);
  }
  return c[0] + c[1] + c[2];
}

}  // namespace

Outcome hole_in_plate(const RunOptions& options) {
  const double dx = radius / options.pick(4, 8);
  Scene scene = plate(dx);
  set_time(scene, options.pick(80.0, 160.0), 20);  // sound crosses the plate in 12 s
  const auto solver = start(scene, [](const Vec3d& x) { return Vec3d{-0.3 / 0.7 * rate * x[0], rate * x[1], 0}; });
  const Particles first = particles_of(*solver);
  run_frames(*solver, scene, options, [] {});
  const Particles last = particles_of(*solver);
  double far = 0, count = 0;
  for (std::size_t i = 0; i < last.size(); ++i)
    if (std::abs(std::abs(first.position[i][1]) - 5) < 0.5) {
      far += last.stress[i][1];
      count += 1;
    }
  far /= count;
  Curve profile{"measured", {}, {}}, kirsch{"infinite plate (Kirsch 1898)", {}, {}, CurveRole::reference};
  std::vector<double> s, y;
  for (double x = radius + dx / 4; x < 4 * radius; x += dx / 2) {
    double sum = 0, n = 0;
    for (std::size_t i = 0; i < last.size(); ++i)
      if (std::abs(std::abs(first.position[i][0]) - x) < dx / 8 && std::abs(first.position[i][1]) < dx / 2) {
        sum += last.stress[i][1] / far;
        n += 1;
      }
    profile.x.push_back(x / radius);
    profile.y.push_back(sum / n);
    const double ratio = radius * radius / (x * x);
    kirsch.x.push_back(x / radius);
    kirsch.y.push_back(1 + ratio / 2 + 1.5 * ratio * ratio);
    if (x < radius + dx) continue;  // the kernel blurs the edge
    s.push_back(ratio);
    y.push_back(sum / n);
  }
  Outcome outcome;
  outcome.add(relative("stress at the hole over that far away", parabola_at_one(s, y), 3.14, options.pick(0.10, 0.05)));
  outcome.figures.push_back(
      {"Hole in a plate", "distance from the centre [R]", "stress over that far away", {profile, kirsch}});
  return outcome;
}

}  // namespace graupel::validation
