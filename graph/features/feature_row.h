// The features of one particle, for kernels of any device: rollouts, evaluation and training make them here.
#pragma once

#include "core/math/axis_map.h"
#include "core/scene/motion.h"
#include "graph/config/feature_config.h"
#include "graph/features/material_constants.h"
#include "sparsegrid/cell_normals.h"
#include "sparsegrid/obstacle.h"

namespace graupel::graph {

inline constexpr int most_history = 16;
/// Positions of a particle that a network may see.
inline constexpr int most_positions = most_history + 1;

/// Rows of the embedding table of kinematic particles (core/scene/kinematic_particles.h): of obstacles and of the
/// material "stationary".
inline constexpr int32_t obstacle_row = 3, stationary_row = 2;
GRAUPEL_HD inline bool is_kinematic_row(int32_t row) { return row == obstacle_row || row == stationary_row; }

/// What a FeatureConfig and a Normalization say about features.
struct FeatureRules {
  FeatureRules() = default;
  FeatureRules(const FeatureConfig& config, const Normalization& statistics)
      : history(static_cast<int>(config.history)),
        width(static_cast<int>(config.input_width() - config.embedding)),
        cell_normal(config.cell_normal),
        signed_distance(config.signed_distance),
        material_constants(config.material_constants),
        contact(config.contact),
        plane(config.in_plane()),
        wall_clamp(config.wall_clamp),
        distance_clamp(config.distance_clamp),
        normalization(statistics) {}

  int history = 0;  ///< velocities
  int width = 0;    ///< numbers a particle
  bool cell_normal = false, signed_distance = false;
  bool material_constants = false, contact = false;
  bool plane = false;                         ///< two dimensions
  double wall_clamp = 1, distance_clamp = 1;  ///< [m]
  Normalization normalization;
};

/// What a surface does to material that touches it.
struct SurfaceContact {
  Contact kind = Contact::separate;
  float friction = 0;  ///< Coulomb coefficient; 0 of those that stick
};

/// Environment in the memory of one device (graph/features/features.h, Environment::view).
struct EnvironmentView {
  sparsegrid::ObstacleSetView obstacles;
  sparsegrid::CellNormalsView normals;
  Vec3d wall_low, wall_high;  ///< [m]; far away along z in the plane, which has no walls there
  bool plane = false;         ///< two dimensions: normals have no part along z
  Vec3d hold_low, hold_high;  ///< [m] where walls hold the material; far away at open and periodic walls
  SurfaceContact wall[6];     ///< lower x y z, upper x y z
  const MaterialConstants* materials = nullptr;
  const RigidMap* carried_from = nullptr;  ///< [obstacles] where each was a frame before; null: all rest
};

/// The acceleration [m/frame^2] that three numbers of a network's output stand for; none out of the plane.
GRAUPEL_HD inline Vec3f real_acceleration(const Normalization& statistics, bool plane, const float* output) {
  Vec3f acceleration;
  for (int d = 0; d < 3; ++d)
    acceleration[d] = output[d] * statistics.acceleration_std[d] + statistics.acceleration_mean[d];
  if (plane) acceleration[2] = 0;
  return acceleration;
}

namespace feature_row {

/// Distance clamped to +-limit, divided by it.
GRAUPEL_HD inline float clamped(double distance, double limit) {
  return static_cast<float>((distance < -limit ? -limit : distance > limit ? limit : distance) / limit);
}

GRAUPEL_HD inline void put(const Vec3f& v, float* row) {
  for (int d = 0; d < 3; ++d) row[d] = v[d];
}

/// The part of a normal within the plane, as a unit vector; zero stays.
GRAUPEL_HD inline Vec3f normal_in(const EnvironmentView& environment, Vec3f normal) {
  if (!environment.plane) return normal;
  normal[2] = 0;
  const float length = norm(normal);
  return length > 0 ? normal * (1 / length) : normal;
}

}  // namespace feature_row

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

/// A row is made in parts, which need not wait for each other; the last ones of networks that have them alone.
enum class FeaturePart : int { motion, cell_normal, signed_distance, material_constants, contact };
GRAUPEL_HD inline int feature_parts_of_row(const FeatureRules& rules) {
  return rules.contact ? 5 : rules.material_constants ? 4 : 3;
}

/// Writes one part of a row, at its place in it; see write_feature_row.
GRAUPEL_HD inline void write_feature_part(FeaturePart part, const FeatureRules& rules,
                                          const EnvironmentView& environment, const AxisMap& symmetry, int32_t material,
                                          const Vec3f* position, float* row) {
  using namespace feature_row;
  const Vec3d x = position[rules.history].cast<double>();
  float* const normal = row + 3 * rules.history;
  float* const walls = normal + (rules.cell_normal ? 3 : 0);
  float* const distance = walls + 6;
  float* const constants = distance + (rules.signed_distance ? 4 : 0);
  float* const contact = constants + (rules.material_constants ? material_constant_count : 0);
  if (part == FeaturePart::material_constants) {
    if (!rules.material_constants) return;
    const bool is_known = material != no_material;
    for (int k = 0; k < material_constant_count; ++k)
      constants[k] = is_known ? environment.materials[material].feature[k] : 0;
    return;
  }
  if (part == FeaturePart::contact) {
    if (rules.contact) write_contact(rules, environment, symmetry, x, contact);
    return;
  }
  if (part == FeaturePart::cell_normal) {
    if (rules.cell_normal) put(symmetry.apply(normal_in(environment, environment.normals.at(x))), normal);
    return;
  }
  if (part == FeaturePart::signed_distance) {
    if (!rules.signed_distance) return;
    int nearest = -1;
    const sparsegrid::SignedDistance<double> obstacle = signed_distance(environment.obstacles, x, nearest);
    *distance = clamped(obstacle.phi, rules.distance_clamp);
    put(symmetry.apply(normal_in(environment, obstacle.normal.cast<float>())), distance + 1);
    return;
  }
  for (int newer = rules.history; newer > 0; --newer) {
    const Vec3f velocity = symmetry.apply(position[newer] - position[newer - 1]);
    for (int d = 0; d < 3; ++d)
      *row++ = (velocity[d] - rules.normalization.velocity_mean[d]) / rules.normalization.velocity_std[d];
  }
  for (int face = 0; face < 6; ++face) {
    const int axis = symmetry.axis[face % 3];
    const bool lower = (face < 3) == (symmetry.sign[face % 3] > 0);  // a reflection exchanges the two faces
    walls[face] =
        clamped(lower ? x[axis] - environment.wall_low[axis] : environment.wall_high[axis] - x[axis], rules.wall_clamp);
  }
}

/// Writes rules.width features of a particle, in the order of particle_features(), as those of the scene turned by
/// `symmetry`. `material` is an index into environment.materials, or no_material. `position` [m] holds
/// rules.history + 1 frames, newest last, unturned.
GRAUPEL_HD inline void write_feature_row(const FeatureRules& rules, const EnvironmentView& environment,
                                         const AxisMap& symmetry, int32_t material, const Vec3f* position, float* row) {
  for (int part = 0; part < feature_parts_of_row(rules); ++part)
    write_feature_part(static_cast<FeaturePart>(part), rules, environment, symmetry, material, position, row);
}

}  // namespace graupel::graph
