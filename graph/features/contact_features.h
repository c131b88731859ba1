// Features of the nearest surface, for kernels of any device: what a wall or an obstacle would do to the particle.
#pragma once

#include "core/math/axis_map.h"
#include "graph/features/environment_view.h"
#include "graph/features/feature_rules.h"

namespace graupel::graph {

/// The surface that a particle is nearest to.
struct NearestSurface {
  bool is_found = false;
  SurfaceContact contact;
  Vec3f velocity = Vec3f::zero();  ///< [m/frame] of its point nearest to the particle
};

/// Walls within the wall clamp of where they hold the material, obstacles within the distance clamp.
GRAUPEL_HD inline NearestSurface nearest_surface(const FeatureRules& rules, const EnvironmentView& environment,
                                                 const Vec3d& x) {
  NearestSurface found;
  double nearest = rules.wall_clamp;
  for (int face = 0; face < 6; ++face) {
    const int axis = face % 3;
    const double distance = face < 3 ? x[axis] - environment.hold_low[axis] : environment.hold_high[axis] - x[axis];
    if (!(distance < nearest)) continue;
    nearest = distance;
    found.is_found = true;
    found.contact = environment.wall[face];
  }
  int obstacle = -1;
  const sparsegrid::SignedDistance<double> at = signed_distance(environment.obstacles, x, obstacle);
  if (obstacle < 0 || !(at.phi < rules.distance_clamp) || !(at.phi < nearest)) return found;
  const sparsegrid::ObstacleView& own = environment.obstacles.obstacles[obstacle];
  found.is_found = true;
  found.contact = {own.contact, own.contact == Contact::stick ? 0.0f : static_cast<float>(own.friction)};
  if (environment.carried_from == nullptr) return found;
  const Vec3d point = x - at.phi * at.normal;
  const RigidMap& back = environment.carried_from[obstacle];
  found.velocity = (point - (back.rotation * point + back.translation)).cast<float>();
  if (environment.plane) found.velocity[2] = 0;
  return found;
}

/// Friction; 1 for the kind among slip, separate, stick; velocity of the surface's point over the standard deviation of
/// velocities (3), so that it is 0 at rest. All 0 without a surface.
GRAUPEL_HD inline void write_contact(const FeatureRules& rules, const EnvironmentView& environment,
                                     const AxisMap& symmetry, const Vec3d& x, float* row) {
  const NearestSurface surface = nearest_surface(rules, environment, x);
  const Vec3f velocity = symmetry.apply(surface.velocity);
  const auto is = [&](Contact kind) { return surface.is_found && surface.contact.kind == kind ? 1.0f : 0.0f; };
  row[0] = surface.is_found ? surface.contact.friction : 0;
  row[1] = is(Contact::slip);
  row[2] = is(Contact::separate);
  row[3] = is(Contact::stick);
  for (int d = 0; d < 3; ++d) row[4 + d] = velocity[d] / rules.normalization.velocity_std[d];
}

}  // namespace graupel::graph
