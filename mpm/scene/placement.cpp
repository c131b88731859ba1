#include "mpm/scene/placement.h"

#include "sparsegrid/analytic_shape.h"

namespace graupel::mpm {

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr int intervals = 12;  ///< of the lattice of points along each edge of a bounding box

/// found(x) of a lattice of points in the body's bounding box, faces included, until one is true [own frame].
template <typename Found>
bool any_lattice_point(const sparsegrid::LocalBox& box, Found&& found) {
  constexpr int n = intervals;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      for (int k = 0; k <= n; ++k) {
        const Vec3d t = {i / double(n), j / double(n), k / double(n)};
        Vec3d local;
        for (int d = 0; d < 3; ++d) local[d] = box.low[d] + t[d] * (box.high[d] - box.low[d]);
        if (found(local)) return true;
      }
  return false;
}

}  // namespace

Vec3d Draws::point(const Vec3d& low, const Vec3d& high) {
  Vec3d x;
  for (int d = 0; d < 3; ++d) x[d] = uniform(low[d], high[d]);
  return x;
}

Vec3d Draws::direction() {
  const double z = uniform(-1, 1), phase = uniform(0, 2 * pi), r = std::sqrt(std::max(0.0, 1 - z * z));
  return {r * std::cos(phase), r * std::sin(phase), z};
}

void Draws::rotation(Vec3d& axis, double& angle) {
  const double u = uniform(0, 1), a = uniform(0, 2 * pi), b = uniform(0, 2 * pi);
  const Vec3d imaginary = {std::sqrt(1 - u) * std::sin(a), std::sqrt(1 - u) * std::cos(a), std::sqrt(u) * std::sin(b)};
  const double real = std::sqrt(u) * std::cos(b);
  const double length = norm(imaginary);
  axis = length > 1e-12 ? imaginary * (1 / length) : Vec3d{0, 1, 0};
  angle = 2 * std::atan2(length, real) * 180 / pi;
}

void set_size(Body& body, double size) {
  body.size = Vec3d::filled(size);
  body.radius = size / 2;
  body.height = size;
}

double reach(const Body& body) {
  const sparsegrid::LocalBox box = sparsegrid::analytic_bounds(body);
  Vec3d farthest;
  for (int d = 0; d < 3; ++d) farthest[d] = std::max(std::abs(box.low[d]), std::abs(box.high[d]));
  return norm(farthest);
}

bool overlap(const Body& a, const Body& b) {
  if (norm(a.position - b.position) > reach(a) + reach(b)) return false;
  for (const auto& [body, other] : {std::pair(&a, &b), std::pair(&b, &a)})
    if (any_lattice_point(sparsegrid::analytic_bounds(*body), [&, body = body, other = other](const Vec3d& local) {
          return sparsegrid::analytic_distance(*body, local) <= 0 &&
                 sparsegrid::analytic_distance(*other, other->to_local(body->to_world(local))) < 0;
        }))
      return true;
  return false;
}

bool may_touch(const Body& a, const Body& b, double gap) {
  const double reach_a = reach(a), reach_b = reach(b);
  if (norm(a.position - b.position) > reach_a + reach_b + gap) return false;
  const Body& small = reach_a < reach_b ? a : b;
  const Body& large = reach_a < reach_b ? b : a;
  const sparsegrid::LocalBox box = sparsegrid::analytic_bounds(small);
  const double decides = norm(box.high - box.low) / intervals / 2;
  const Mat3d relative_rotation = transpose(large.rotation()) * small.rotation();
  const Vec3d shift = large.to_local(small.position);
  return any_lattice_point(box, [&](const Vec3d& local) {
    return sparsegrid::analytic_distance(small, local) <= decides &&
           sparsegrid::analytic_distance(large, relative_rotation * local + shift) <= gap + decides;
  });
}

}  // namespace graupel::mpm
