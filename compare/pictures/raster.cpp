#include "compare/pictures/raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel/parallel_for.h"

namespace graupel::compare {

Color color_of_type(int32_t type) {
  switch (type) {
    case 5:
      return {56, 132, 224};
    case 6:
      return {218, 168, 84};
    case 8:
      return {240, 244, 250};
    case 4:
      return {92, 190, 104};
    case 7:
      return {236, 130, 150};
    case 9:
      return {60, 160, 150};
    case 10:
      return {150, 156, 168};
    case 11:
      return {140, 92, 60};
    case 12:
      return {236, 214, 120};
    case 13:
      return {110, 104, 100};
    default:
      return {190, 120, 200};
  }
}

double sphere_radius(double volume) { return 0.6 * std::cbrt(volume); }

namespace {

/// Heights along the light over a grid of rays parallel to it.
class ShadowMap {
 public:
  ShadowMap(const Backdrop& backdrop, const std::vector<Vec3f>& position, double radius)
      : light_(light_direction(backdrop.up)), radius_(radius) {
    u_ = normalized(cross(light_, std::abs(light_[0]) < 0.7 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
    v_ = cross(light_, u_);
    center_ = 0.5 * (backdrop.low + backdrop.high);
    scale_ = size / (1.2 * norm(backdrop.high - backdrop.low));
    height_.assign(static_cast<std::size_t>(size) * size, -std::numeric_limits<float>::infinity());
    for (const Vec3f& p : position) cast(p.cast<double>());
  }

  /// Share of light that reaches a point, from 3 x 3 rays around it.
  float light_at(const Vec3d& point) const {
    const Vec3d d = point - center_;
    const int x = pixel(dot(d, u_)), y = pixel(dot(d, v_));
    const float own = static_cast<float>(dot(d, light_) + 1.5 * radius_);
    int free = 0;
    for (int j = y - 1; j <= y + 1; ++j)
      for (int i = x - 1; i <= x + 1; ++i)
        free += i < 0 || j < 0 || i >= size || j >= size || height_[static_cast<std::size_t>(j) * size + i] <= own;
    return static_cast<float>(free) / 9;
  }

 private:
  static constexpr int size = 512;
  int pixel(double along) const { return static_cast<int>(std::lround(along * scale_ + 0.5 * size)); }

  void cast(const Vec3d& p) {
    const Vec3d d = p - center_;
    const float height = static_cast<float>(dot(d, light_));
    const int reach = std::max(1, static_cast<int>(radius_ * scale_));
    const int x = pixel(dot(d, u_)), y = pixel(dot(d, v_));
    for (int j = std::max(0, y - reach); j <= std::min(size - 1, y + reach); ++j)
      for (int i = std::max(0, x - reach); i <= std::min(size - 1, x + reach); ++i) {
        float& h = height_[static_cast<std::size_t>(j) * size + i];
        h = std::max(h, height);
      }
  }

  Vec3d light_, u_, v_, center_;
  double radius_, scale_;
  std::vector<float> height_;
};

Vec3f to_unit(Color color) { return Vec3f{float(color[0]), float(color[1]), float(color[2])} * (1 / 255.0f); }

/// Surfaces seen by each pixel of the supersampled picture.
struct Surfaces {
  std::vector<float> depth;
  std::vector<Vec3f> albedo, normal;
};

void draw_sphere(const Camera& camera, const Vec3d& center, const Vec3f& albedo, double radius, Surfaces& s) {
  const auto pixel = camera.project(center);
  if (pixel.depth <= radius) return;
  const double reach = std::max(0.75, radius * camera.focal / pixel.depth);
  const int x0 = std::max(0, static_cast<int>(std::floor(pixel.x - reach)));
  const int x1 = std::min(camera.width - 1, static_cast<int>(std::ceil(pixel.x + reach)));
  const int y0 = std::max(0, static_cast<int>(std::floor(pixel.y - reach)));
  const int y1 = std::min(camera.height - 1, static_cast<int>(std::ceil(pixel.y + reach)));
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const double u = (x + 0.5 - pixel.x) / reach, v = (pixel.y - y - 0.5) / reach;
      const double r2 = u * u + v * v;
      if (r2 > 1) continue;
      const double w = std::sqrt(1 - r2);
      const float depth = static_cast<float>(pixel.depth - radius * w);
      const std::size_t i = static_cast<std::size_t>(y) * camera.width + x;
      if (depth >= s.depth[i]) continue;
      s.depth[i] = depth;
      s.albedo[i] = albedo;
      s.normal[i] = (camera.right * u + camera.up * v - camera.forward * w).cast<float>();
    }
}

/// Factor that darkens a pixel by how much nearer its neighbours are.
float eye_dome(const Camera& camera, const std::vector<float>& depth, int x, int y) {
  static constexpr int step[8][2] = {{2, 0}, {-2, 0}, {0, 2}, {0, -2}, {4, 4}, {-4, 4}, {4, -4}, {-4, -4}};
  const float own = depth[static_cast<std::size_t>(y) * camera.width + x];
  float sum = 0;
  for (const auto& s : step) {
    const int i = std::clamp(x + s[0], 0, camera.width - 1), j = std::clamp(y + s[1], 0, camera.height - 1);
    const float near = depth[static_cast<std::size_t>(j) * camera.width + i];
    sum += std::min(0.02f, std::max(0.0f, (own - near) / own));
  }
  return std::exp(-4.5f * sum);
}

void draw_line(const Camera& camera, Vec3d a, Vec3d b, const std::vector<float>& depth, std::vector<Vec3f>& color) {
  const int steps = 4 * std::max(camera.width, camera.height);
  std::size_t last = std::numeric_limits<std::size_t>::max();
  for (int k = 0; k <= steps; ++k) {
    const auto p = camera.project(a + (b - a) * (static_cast<double>(k) / steps));
    const int x = static_cast<int>(p.x), y = static_cast<int>(p.y);
    if (p.depth <= 0 || x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
    const std::size_t i = static_cast<std::size_t>(y) * camera.width + x;
    if (i == last || p.depth > depth[i] * 1.001) continue;
    color[i] = color[i] * 0.55f + Vec3f::filled(0.62f) * 0.45f;
    last = i;
  }
}

void draw_box(const Backdrop& b, const std::vector<float>& depth, std::vector<Vec3f>& color) {
  for (int axis = 0; axis < 3; ++axis)
    for (int corner = 0; corner < 4; ++corner) {
      Vec3d start = b.low;
      const int first = (axis + 1) % 3, second = (axis + 2) % 3;
      if (corner & 1) start[first] = b.high[first];
      if (corner & 2) start[second] = b.high[second];
      Vec3d end = start;
      end[axis] = b.high[axis];
      draw_line(b.camera, start, end, depth, color);
    }
}

Image shrink(const Camera& camera, const std::vector<Vec3f>& color) {
  Image image(camera.width / supersampling, camera.height / supersampling);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      Vec3f sum = Vec3f::zero();
      for (int j = 0; j < supersampling; ++j)
        for (int i = 0; i < supersampling; ++i)
          sum += color[static_cast<std::size_t>(y * supersampling + j) * camera.width + x * supersampling + i];
      sum *= 1.0f / (supersampling * supersampling);
      Color c;
      // Six bits a channel: no visible loss, and the PNG takes half the space.
      for (int d = 0; d < 3; ++d)
        c[d] = static_cast<uint8_t>(std::lround(63 * std::clamp(sum[d], 0.0f, 1.0f)) * 255 / 63);
      image.set(x, y, c);
    }
  return image;
}

Vec3f shade(const Vec3f& albedo, const Vec3f& normal, const Vec3f& light, const Vec3f& to_eye, float lit) {
  if (norm2(normal) == 0) return albedo;
  const float facing = std::max(0.0f, dot(normal, light));
  const float gleam = std::pow(std::max(0.0f, dot(normal, normalized(light + to_eye))), 30.0f);
  return albedo * (0.47f + 0.62f * facing * lit) + Vec3f::filled(0.10f * gleam * lit);
}

}  // namespace

Image draw_particles(const Backdrop& backdrop, const std::vector<Vec3f>& position, const std::vector<int32_t>& type,
                     double radius) {
  const Camera& camera = backdrop.camera;
  Surfaces s{backdrop.depth, backdrop.albedo, backdrop.normal};
  for (std::size_t i = 0; i < position.size(); ++i)
    draw_sphere(camera, position[i].cast<double>(), to_unit(color_of_type(type[i])), radius, s);
  const ShadowMap shadows(backdrop, position, radius);
  const Vec3f light = light_direction(backdrop.up).cast<float>();
  std::vector<Vec3f> color(s.depth.size());
  parallel_for(Device::cpu, static_cast<int64_t>(color.size()), [&](int64_t i) {
    color[i] = s.albedo[i];
    if (!std::isfinite(s.depth[i])) return;
    const int x = static_cast<int>(i % camera.width), y = static_cast<int>(i / camera.width);
    const Vec3d point = camera.eye + camera.ray(x + 0.5, y + 0.5) * static_cast<double>(s.depth[i]);
    const bool still = s.depth[i] == backdrop.depth[i];
    const float lit = shadows.light_at(point) * (still ? backdrop.lit[i] : 1.0f);
    color[i] =
        shade(s.albedo[i], s.normal[i], light, (-camera.forward).cast<float>(), lit) * eye_dome(camera, s.depth, x, y);
  });
  draw_box(backdrop, s.depth, color);
  return shrink(camera, color);
}

}  // namespace graupel::compare
