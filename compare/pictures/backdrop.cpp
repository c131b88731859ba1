#include "compare/pictures/backdrop.h"

#include <cmath>
#include <limits>

#include "core/parallel/parallel_for.h"

namespace graupel::compare {

Vec3d light_direction(const Vec3d& up) {
  const Vec3d front = std::abs(up[2]) > 0.5 ? Vec3d{0, -1, 0} : Vec3d{0, 0, 1};
  return normalized(up + front * 0.45 - cross(up, front) * 0.35);
}

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Part of the ray origin + t direction inside a box; empty when first > last.
struct Interval {
  double first = 0, last = infinity;
};

Interval clip_to_box(const Vec3d& origin, const Vec3d& direction, const Vec3d& low, const Vec3d& high) {
  Interval t;
  for (int d = 0; d < 3; ++d) {
    const double inverse = 1 / (direction[d] == 0 ? 1e-30 : direction[d]);
    double near = (low[d] - origin[d]) * inverse, far = (high[d] - origin[d]) * inverse;
    if (near > far) std::swap(near, far);
    t.first = std::max(t.first, near);
    t.last = std::min(t.last, far);
  }
  return t;
}

/// Distance along a unit direction to the obstacles' surface, or infinity.
double trace(const sparsegrid::ObstacleSet& obstacles, const Vec3d& origin, const Vec3d& direction, Interval t,
             double surface) {
  double at = t.first;
  for (int step = 0; step < 256 && at <= t.last; ++step) {
    const double phi = obstacles.sample(origin + direction * at).phi;
    if (phi < surface) return at;
    at += std::max(0.9 * phi, 0.5 * surface);
  }
  return infinity;
}

/// Checks of a tenth of the box's longest edge, to read distances on the floor.
Vec3f floor_albedo(const Vec3d& point, const Vec3d& low, const Vec3d& high, const Vec3d& up) {
  double longest = 0;
  for (int d = 0; d < 3; ++d) longest = std::max(longest, high[d] - low[d]);
  int parity = 0;
  for (int d = 0; d < 3; ++d)
    if (std::abs(up[d]) < 0.5) parity += static_cast<int>(std::floor((point[d] - low[d]) / (0.1 * longest)));
  return Vec3f::filled(parity & 1 ? 0.38f : 0.43f);
}

class BackdropPainter {
 public:
  BackdropPainter(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, Backdrop& backdrop)
      : scene_(scene), obstacles_(obstacles), b_(backdrop), surface_(0.02 * scene.domain.dx) {}

  void paint_pixel(int64_t i) const {
    const int x = static_cast<int>(i % b_.camera.width), y = static_cast<int>(i / b_.camera.width);
    const Vec3d ray = b_.camera.ray(x + 0.5, y + 0.5);
    const double length = norm(ray);
    const Vec3d direction = ray * (1 / length);
    const double to_floor = floor_distance(direction);
    const double to_obstacle = obstacle_distance(b_.camera.eye, direction);
    const double hit = std::min(to_floor, to_obstacle);
    b_.albedo[i] = {0.20f, 0.215f, 0.24f};
    if (hit == infinity) return;
    const Vec3d point = b_.camera.eye + direction * hit;
    Vec3d normal = b_.up;
    b_.albedo[i] = floor_albedo(point, b_.low, b_.high, b_.up);
    if (to_obstacle < to_floor) {
      normal = obstacles_.sample(point).normal;
      b_.albedo[i] = {0.62f, 0.55f, 0.57f};
    }
    b_.depth[i] = static_cast<float>(hit / length);
    b_.normal[i] = normal.cast<float>();
    const Vec3d light = light_direction(b_.up);
    b_.lit[i] = obstacle_distance(point + normal * (0.5 * scene_.domain.dx), light) == infinity;
  }

 private:
  double floor_distance(const Vec3d& direction) const {
    const double fall = dot(direction, b_.up);
    if (fall >= 0) return infinity;
    const Vec3d base = {b_.up[0] > 0 ? b_.low[0] : b_.high[0], b_.up[1] > 0 ? b_.low[1] : b_.high[1],
                        b_.up[2] > 0 ? b_.low[2] : b_.high[2]};
    const double t = dot(base - b_.camera.eye, b_.up) / fall;
    const Vec3d point = b_.camera.eye + direction * t;
    for (int d = 0; d < 3; ++d)
      if (std::abs(b_.up[d]) < 0.5 && (point[d] < b_.low[d] || point[d] > b_.high[d])) return infinity;
    return t;
  }

  double obstacle_distance(const Vec3d& origin, const Vec3d& direction) const {
    if (obstacles_.count() == 0) return infinity;
    return trace(obstacles_, origin, direction, clip_to_box(origin, direction, b_.low, b_.high), surface_);
  }

  const Scene& scene_;
  const sparsegrid::ObstacleSet& obstacles_;
  Backdrop& b_;
  double surface_;
};

}  // namespace

Backdrop make_backdrop(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, int width, int height) {
  Backdrop backdrop;
  backdrop.up = up_axis(scene);
  backdrop.low = scene.wall_low();
  backdrop.high = scene.wall_high();
  backdrop.camera =
      three_quarter_view(backdrop.low, backdrop.high, backdrop.up, supersampling * width, supersampling * height);
  const std::size_t pixels = static_cast<std::size_t>(backdrop.camera.width) * backdrop.camera.height;
  backdrop.depth.assign(pixels, std::numeric_limits<float>::infinity());
  backdrop.albedo.assign(pixels, Vec3f::zero());
  backdrop.normal.assign(pixels, Vec3f::zero());
  backdrop.lit.assign(pixels, 1);
  const BackdropPainter painter(scene, obstacles, backdrop);
  parallel_for(Device::cpu, static_cast<int64_t>(pixels), [&](int64_t i) { painter.paint_pixel(i); });
  return backdrop;
}

}  // namespace graupel::compare
