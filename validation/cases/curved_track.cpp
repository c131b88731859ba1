// A block that slides from an incline through an arc of a circle onto level ground without friction: v = sqrt(2 g h), h
// the fall of its centre of mass, about 1 m (matter, AnalyticSlipFree, 1e-3). The track is a mesh.
#include <cmath>

#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

constexpr double gravity = 9.81, slope = pi / 6, arc_radius = 1;
const double arc_begin = -arc_radius * std::sin(slope);  ///< x where the incline becomes the arc

/// Height of the track: the incline, the arc that ends at x = 0, and level ground y = 0.
double height(double x) {
  if (x > 0) return 0;
  if (x > arc_begin) return arc_radius - std::sqrt(arc_radius * arc_radius - x * x);
  return arc_radius * (1 - std::cos(slope)) + (arc_begin - x) * std::tan(slope);
}

/// The ground below the curve as a prism along z.
std::shared_ptr<const TriangleMesh> prism(double from, double to, double floor, double half_depth) {
  TriangleMesh mesh;
  constexpr int pieces = 400;
  for (int i = 0; i <= pieces; ++i) {
    const double x = from + (to - from) * i / pieces;
    for (const double y : {height(x), floor})
      for (const double z : {-half_depth, half_depth}) mesh.vertices.push_back({x, y, z});
  }
  const auto quad = [&](int a, int b, int c, int d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (int i = 0; i < pieces; ++i) {  // vertices of a section: top back, top front, bottom back, bottom front
    const int l = 4 * i, r = l + 4;
    quad(l, l + 1, r + 1, r);
    quad(l + 2, r + 2, r + 3, l + 3);
    quad(l, r, r + 2, l + 2);
    quad(l + 1, l + 3, r + 3, r + 1);
  }
  quad(0, 2, 3, 1);
  const int end = 4 * pieces;
  quad(end, end + 1, end + 3, end + 2);
  return std::make_shared<const TriangleMesh>(mesh);
}

}  // namespace

Outcome curved_track(const RunOptions& options) {
  const double dx = options.pick(0.0125, 0.00625), start_x = -2.1;
  Scene scene = plane_scene(dx, {-3, -0.2}, {2, 2});
  scene.gravity = {0, -gravity, 0};
  Obstacle track;
  track.shape = Shape::mesh;
  track.mesh = prism(-3.5, 2.5, -0.2, 8 * dx);
  track.contact = Contact::separate;
  scene.obstacles.push_back(track);
  scene.obstacle_band = 4 * dx;
  scene.push_out = false;
  scene.materials["block"] = elastic(2e6, 0.2, 1000);
  const Vec2d down = {std::cos(slope), -std::sin(slope)};
  add_plane_points(scene, "block", turned_lattice(scene, {start_x, height(start_x)}, down, {0.1, 0.05}, 2), 2);
  set_time(scene, 1.2, 60);
  const auto solver = start(scene);
  const double potential = solver->diagnostics().potential_energy;
  Curve speed{"measured", {}, {}}, theory{"sqrt(2 g h)", {}, {}, CurveRole::reference};
  run_frames(*solver, scene, options, [&] {
    const mpm::Diagnostics d = solver->diagnostics();
    speed.x.push_back(solver->time());
    speed.y.push_back(norm(d.momentum) / d.mass);
    theory.x.push_back(solver->time());
    theory.y.push_back(std::sqrt(2 * std::max(0.0, potential - d.potential_energy) / d.mass));
  });
  Outcome outcome;
  outcome.add(relative("speed on the level ground [m/s]", speed.y.back(), theory.y.back(), 1e-3));
  outcome.figures.push_back({"Block on a curved track", "time [s]", "speed [m/s]", {speed, theory}});
  return outcome;
}

}  // namespace graupel::validation
