// The features of one particle, for kernels of any device: rollouts, evaluation and training make them here.
#pragma once

#include "core/math/axis_map.h"
#include "graph/features/contact_features.h"
#include "graph/features/environment_view.h"
#include "graph/features/feature_rules.h"

namespace graupel::graph {

inline constexpr int most_history = 16;
/// Positions of a particle that a network may see.
inline constexpr int most_positions = most_history + 1;

/// Rows of the embedding table of kinematic particles (core/scene/kinematic_particles.h): of obstacles and of the
/// material "stationary".
inline constexpr int32_t obstacle_row = 3, stationary_row = 2;
GRAUPEL_HD inline bool is_kinematic_row(int32_t row) { return row == obstacle_row || row == stationary_row; }

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
