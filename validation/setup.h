// What the cases share: scenes in the plane, runs in f64 that start from any velocity field, and their particles in the
// order of the sources.
//
// A plane case is a scene with two dimensions at z = 0.
#pragma once

#include <functional>
#include <memory>

#include "mpm/solver/solver.h"
#include "validation/case.h"

namespace graupel::validation {

using Vec2d = Vec<double, 2>;
using Solver = mpm::Solver<double>;
using Particles = mpm::HostParticles<double>;

inline constexpr double pi = 3.14159265358979323846;
inline double radians(double degrees) { return degrees * pi / 180; }

/// An empty plane scene whose walls hold the material in [low, high], whole cells apart, without gravity. Walls slip.
Scene plane_scene(double dx, const Vec2d& low, const Vec2d& high);
/// The same in space.
Scene space_scene(double dx, const Vec3d& low, const Vec3d& high);
/// Depth of a plane scene [m].
inline constexpr double plane_depth = 1;

/// Centres of `per_axis` sub-cells along each axis of the grid's cells, inside the box and where `inside` holds.
std::vector<Vec2d> plane_lattice(const Scene& scene, const Vec2d& low, const Vec2d& high, int per_axis,
                                 const std::function<bool(const Vec2d&)>& inside = {});
std::vector<Vec3d> space_lattice(const Scene& scene, const Vec3d& low, const Vec3d& high, int per_axis,
                                 const std::function<bool(const Vec3d&)>& inside = {});

/// The same in a box with edges `size` along `along` and the direction to its left, from its corner.
std::vector<Vec2d> turned_lattice(const Scene& scene, const Vec2d& corner, const Vec2d& along, const Vec2d& size,
                                  int per_axis);

/// Adds a body of `material` at given points of a lattice with `per_axis` points along a cell's edge.
Source& add_plane_points(Scene& scene, const std::string& material, const std::vector<Vec2d>& points, int per_axis);
Source& add_points(Scene& scene, const std::string& material, const std::vector<Vec3d>& points, int per_axis);

/// A moving box that holds the nodes inside it, and so the material there, which it may overlap: push_out is off.
void add_grip(Scene& scene, const Vec3d& low, const Vec3d& high, const Vec3d& velocity, Contact contact);

/// Fixed corotated solid of these constants.
MaterialConfig elastic(double youngs_modulus, double poissons_ratio, double density);
/// A preset, or ConfigError.
MaterialConfig preset(const std::string& name);

/// Frames of `duration / frames` with steps of `courant` (adaptive).
void set_time(Scene& scene, double duration, int64_t frames, double courant = 0.5);

/// A run at its start; `velocity` replaces that of the sources, at the particles' positions.
std::unique_ptr<Solver> start(const Scene& scene, const std::function<Vec3d(const Vec3d&)>& velocity = {});
/// Particles in the order of the sources.
Particles particles_of(const Solver& solver);

/// Advances to the scene's last frame; `watch` is called before the first frame and after every one.
void run_frames(Solver& solver, const Scene& scene, const RunOptions& options, const std::function<void()>& watch);

/// Times at which y(x) crosses zero, by straight lines between the samples.
std::vector<double> zero_crossings(const std::vector<double>& x, const std::vector<double>& y);
/// Slope and value at zero of the straight line through the points (least squares).
struct Line {
  double slope, offset;
};
Line fit_line(const std::vector<double>& x, const std::vector<double>& y);
/// y at x, by straight lines between the points of a rising table.
double interpolated(const std::vector<double>& xs, const std::vector<double>& ys, double x);

}  // namespace graupel::validation
