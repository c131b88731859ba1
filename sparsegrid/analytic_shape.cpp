// Exact signed distances: solids of revolution are measured in the half plane (r, y), boxes and the pyramid in the
// octant or quarter that their symmetry leaves. Nearest points follow Ericson, Real-Time Collision Detection, ch. 5.
#include "sparsegrid/analytic_shape.h"

#include <algorithm>
#include <cmath>

#include "core/system/error.h"

namespace graupel::sparsegrid {

namespace {

using Vec2d = Vec<double, 2>;

double box_distance(const Vec3d& x, const Vec3d& half) {
  Vec3d outside;
  double deepest = -1e300;
  for (int d = 0; d < 3; ++d) {
    const double q = std::abs(x[d]) - half[d];
    outside[d] = std::max(q, 0.0);
    deepest = std::max(deepest, q);
  }
  return deepest > 0 ? norm(outside) : deepest;
}

double segment_distance(const Vec2d& x, const Vec2d& a, const Vec2d& b) {
  const Vec2d edge = b - a;
  const double t = std::clamp(dot(x - a, edge) / norm2(edge), 0.0, 1.0);
  return norm(x - a - t * edge);
}

double half_sphere_distance(const Vec2d& ry, double radius) {
  const double r = ry[0], y = ry[1], length = norm(ry);
  if (y < 0) return r <= radius ? -y : std::hypot(r - radius, y);
  return length > radius ? length - radius : -std::min(radius - length, y);
}

double cone_distance(const Vec2d& ry, double radius, double height) {
  const Vec2d rim = {radius, -height / 2}, tip = {0, height / 2}, foot = {0, -height / 2};
  const double distance = std::min(segment_distance(ry, foot, rim), segment_distance(ry, rim, tip));
  const bool inside = ry[1] > -height / 2 && ry[0] * height < radius * (height / 2 - ry[1]);
  return inside ? -distance : distance;
}

double cylinder_distance(const Vec2d& ry, double radius, double height) {
  const double q = ry[0] - radius, h = std::abs(ry[1]) - height / 2;
  if (q <= 0 && h <= 0) return std::max(q, h);
  return std::hypot(std::max(q, 0.0), std::max(h, 0.0));
}

/// Distance to the triangle (a, b, c).
double triangle_distance(const Vec3d& x, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d normal = cross(b - a, c - a);
  const auto outside_of = [&](const Vec3d& p, const Vec3d& q) { return dot(cross(q - p, normal), x - p) > 0; };
  const auto to_edge = [&](const Vec3d& p, const Vec3d& q) {
    const Vec3d edge = q - p;
    return norm(x - p - edge * std::clamp(dot(x - p, edge) / norm2(edge), 0.0, 1.0));
  };
  if (outside_of(a, b) || outside_of(b, c) || outside_of(c, a))
    return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
  return std::abs(dot(x - a, normal)) / norm(normal);
}

double pyramid_distance(const Vec3d& x, const Vec3d& size, double height) {
  const Vec3d p = {std::abs(x[0]), x[1], std::abs(x[2])};
  const double hx = size[0] / 2, hz = size[2] / 2, bottom = -height / 2;
  const Vec3d tip = {0, height / 2, 0}, near = {hx, bottom, hz};
  const double to_x_face = triangle_distance(p, {hx, bottom, -hz}, tip, near);
  const double to_z_face = triangle_distance(p, {-hx, bottom, hz}, near, tip);
  const double to_base = norm(Vec3d{std::max(p[0] - hx, 0.0), p[1] - bottom, std::max(p[2] - hz, 0.0)});
  const double distance = std::min({to_x_face, to_z_face, to_base});
  const double below_tip = (height / 2 - p[1]) / height;
  const bool inside = p[1] > bottom && p[0] < hx * below_tip && p[2] < hz * below_tip;
  return inside ? -distance : distance;
}

}  // namespace

bool is_analytic(Shape shape) { return shape != Shape::mesh && shape != Shape::vdb && shape != Shape::points; }

double analytic_distance(const Body& body, const Vec3d& local) {
  const Vec2d ry = {std::hypot(local[0], local[2]), local[1]};
  switch (body.shape) {
    case Shape::box:
      return box_distance(local, body.size * 0.5);
    case Shape::half_box:
      return box_distance(local + Vec3d{0, body.size[1] / 4, 0},
                          {body.size[0] / 2, body.size[1] / 4, body.size[2] / 2});
    case Shape::sphere:
      return norm(local) - body.radius;
    case Shape::half_sphere:
      return half_sphere_distance(ry, body.radius);
    case Shape::cone:
      return cone_distance(ry, body.radius, body.height);
    case Shape::pyramid:
      return pyramid_distance(local, body.size, body.height);
    case Shape::cylinder:
      return cylinder_distance(ry, body.radius, body.height);
    case Shape::plane:
      return local[1];
    case Shape::mesh:
    case Shape::vdb:
    case Shape::points:
      break;
  }
  throw std::logic_error("analytic_distance: the shape has no formula");
}

LocalBox analytic_bounds(const Body& body) {
  const double r = body.radius, h = body.height / 2;
  switch (body.shape) {
    case Shape::box:
      return {body.size * -0.5, body.size * 0.5};
    case Shape::half_box:
      return {body.size * -0.5, {body.size[0] / 2, 0, body.size[2] / 2}};
    case Shape::sphere:
      return {{-r, -r, -r}, {r, r, r}};
    case Shape::half_sphere:
      return {{-r, 0, -r}, {r, r, r}};
    case Shape::cone:
    case Shape::cylinder:
      return {{-r, -h, -r}, {r, h, r}};
    case Shape::pyramid:
      return {{-body.size[0] / 2, -h, -body.size[2] / 2}, {body.size[0] / 2, h, body.size[2] / 2}};
    default:
      throw std::logic_error("analytic_bounds: the shape has no bounds");
  }
}

LocalBox plane_bounds(const Body& body, const Domain& domain) {
  return plane_bounds(body.rotation(), body.position, domain);
}

namespace {

LocalBox domain_bounds(const Mat3d& rotation, const Vec3d& position, const Domain& domain) {
  LocalBox box = {Vec3d::filled(1e300), Vec3d::filled(-1e300)};
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d x = domain.origin;
    for (int d = 0; d < 3; ++d) x[d] += (corner >> d & 1) * domain.size[d];
    const Vec3d local = transpose(rotation) * (x - position);
    for (int d = 0; d < 3; ++d) {
      box.low[d] = std::min(box.low[d], local[d]);
      box.high[d] = std::max(box.high[d], local[d]);
    }
  }
  return box;
}

}  // namespace

LocalBox plane_bounds(const Mat3d& rotation, const Vec3d& position, const Domain& domain) {
  LocalBox box = domain_bounds(rotation, position, domain);
  box.low[1] = box.high[1] = 0;
  return box;
}

LocalBox body_below(const Body& plane, const Domain& domain, double margin) {
  LocalBox box = domain_bounds(plane.rotation(), plane.position, domain);
  box.low[1] = std::min(box.low[1], 0.0);
  box.high[1] = 0;
  box.low -= Vec3d::filled(margin);
  box.high += Vec3d::filled(margin);
  return box;
}

double box_distance(const LocalBox& box, const Vec3d& x) {
  return box_distance(x - (box.low + box.high) * 0.5, (box.high - box.low) * 0.5);
}

}  // namespace graupel::sparsegrid
