// Exact signed distances of the shapes of core/scene/scene.h, each in the body's own frame.
#pragma once

#include <array>
#include <tuple>

#include "core/scene/scene.h"

namespace graupel::sparsegrid {

/// Axis-aligned box in a body's own frame [m].
struct LocalBox {
  Vec3d low, high;
};

/// Whether the shape is given by a formula (all but mesh, vdb and points).
bool is_analytic(Shape shape);

/// Equal for bodies whose shapes are equal, each in its own frame. Analytic shapes only.
using ShapeKey = std::tuple<Shape, std::array<double, 3>, double, double>;
inline ShapeKey shape_key(const Body& body) {
  return {body.shape, {body.size[0], body.size[1], body.size[2]}, body.radius, body.height};
}

/// Euclidean distance [m] from `local` (the body's own frame) to the surface, negative inside. Analytic shapes only.
double analytic_distance(const Body& body, const Vec3d& local);

/// Smallest box around the shape; analytic shapes but the plane.
LocalBox analytic_bounds(const Body& body);

/// The rectangle of the plane y = 0 of the body's own frame below and above which the domain lies.
LocalBox plane_bounds(const Body& body, const Domain& domain);
/// Of the pose x_world = rotation x_local + position.
LocalBox plane_bounds(const Mat3d& rotation, const Vec3d& position, const Domain& domain);
/// The domain's part below the plane and `margin` [m] around it: its top lies `margin` above the plane.
LocalBox body_below(const Body& plane, const Domain& domain, double margin);

/// Euclidean distance [m] to the box, negative inside.
double box_distance(const LocalBox& box, const Vec3d& x);

}  // namespace graupel::sparsegrid
