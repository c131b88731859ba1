#include "compare/pictures/camera.h"

#include <algorithm>
#include <cmath>

#include "compare/metrics/particle_run.h"

namespace graupel::compare {

Camera::Pixel Camera::project(const Vec3d& point) const {
  const Vec3d d = point - eye;
  const double depth = dot(d, forward);
  const double scale = focal / std::max(depth, 1e-9);
  return {0.5 * width + scale * dot(d, right), 0.5 * height - scale * dot(d, up), depth};
}

Vec3d Camera::ray(double x, double y) const {
  return forward + right * ((x - 0.5 * width) / focal) + up * ((0.5 * height - y) / focal);
}

Camera three_quarter_view(const Vec3d& low, const Vec3d& high, const Vec3d& up, int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  // Two horizontal axes; for y up these are z (towards the viewer) and x.
  const Vec3d front = std::abs(up[2]) > 0.5 ? Vec3d{0, -1, 0} : Vec3d{0, 0, 1};
  const Vec3d side = cross(up, front);
  const Vec3d to_eye = normalized(front + side * 0.5 + up * 0.55);
  camera.forward = -to_eye;
  camera.right = normalized(cross(camera.forward, up));
  camera.up = cross(camera.right, camera.forward);
  const Vec3d center = 0.5 * (low + high);
  camera.eye = center + to_eye * (2.2 * norm(high - low));
  // Zoom until the corners fill the picture, then centre them.
  camera.focal = 1;
  double x0 = 1e30, x1 = -1e30, y0 = 1e30, y1 = -1e30;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d p;
    for (int d = 0; d < 3; ++d) p[d] = (corner >> d) & 1 ? high[d] : low[d];
    const auto pixel = camera.project(p);
    x0 = std::min(x0, pixel.x - 0.5 * width);
    x1 = std::max(x1, pixel.x - 0.5 * width);
    y0 = std::min(y0, pixel.y - 0.5 * height);
    y1 = std::max(y1, pixel.y - 0.5 * height);
  }
  const double depth = dot(center - camera.eye, camera.forward);
  camera.eye += camera.right * (0.5 * (x0 + x1) * depth) - camera.up * (0.5 * (y0 + y1) * depth);
  camera.focal = 0.94 * std::min(width / (x1 - x0), height / (y1 - y0));
  return camera;
}

Vec3d up_axis(const Scene& scene) {
  const int axis = vertical_axis(scene.gravity);
  Vec3d up = {0, 0, 0};
  up[axis] = scene.gravity[axis] > 0 ? -1 : 1;
  return up;
}

}  // namespace graupel::compare
