// What the matter does to the obstacles and walls of a scene in a frame: impulse, mean force and torque.
#pragma once

#include <string>
#include <vector>

#include "core/math/vec.h"

namespace graupel {

struct Scene;

/// On one obstacle or wall, over a frame or what is done of it. In the plane those of 1 m of depth, the torque along z.
struct ContactForce {
  Vec3d impulse = {0, 0, 0};    ///< [N s]
  Vec3d force = {0, 0, 0};      ///< its mean over the time [N]
  Vec3d torque = {0, 0, 0};     ///< mean, about the reference point where it is in each substep [N m]
  Vec3d reference = {0, 0, 0};  ///< where that point is at the end [m]
  bool operator==(const ContactForce&) const = default;
};

/// Names of all that forces act on, in their order: obstacle_0, obstacle_1, ... as in the scene, then wall_x_low,
/// wall_x_high, ... of the domain's axes.
std::vector<std::string> contact_names(const Scene& scene);
/// The points that torques are about at a time [s], in the same order [m]: of an obstacle the centre of its motion,
/// which its script carries along, or its position; of a wall the middle of its face.
std::vector<Vec3d> contact_references(const Scene& scene, double time);

}  // namespace graupel
