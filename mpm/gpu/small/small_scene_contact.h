// Contact at the nodes of a small scene, from a table made before the run: which law holds each of them and the normal.
// Equals mpm/physics/node_update.h for obstacles at rest. Gain, with chunks of equal length: one scene of the recipe
// 0.89 -> 0.71 ms a frame (docs/decisions/0007-small-scenes-on-gpus.md).
#pragma once

#include "mpm/gpu/small/small_scene_view.h"
#include "mpm/physics/node_update.h"

namespace graupel::mpm::small {

/// What holds the material at every node of a scene.
struct FindContacts {
  SceneView<float> scene;
  Vec<int, 3> nodes;
  NodeContact* contact;

  GRAUPEL_HD void operator()(int64_t entry) const {
    const auto n = static_cast<int32_t>(entry);
    const Vec<int, 3> at = {n / (nodes[1] * nodes[2]), n / nodes[2] % nodes[1], n % nodes[2]};
    Vec<int, 3> block;
    int inside = 0;
    for (int d = 0; d < 3; ++d) {
      block[d] = at[d] / block_width;
      inside = inside * block_width + at[d] % block_width;
    }
    NodeContact found = {Vec<float, 3>::zero(), 0};
    const int obstacles = scene.obstacle_nodes.obstacles.count;
    const int32_t surface = scene.obstacle_nodes.block_number[scene.grid.directory_index(block)];
    const int64_t value = int64_t(surface) * nodes_per_block<3> + inside;
    if (surface != block_without_surface && scene.obstacle_nodes.law[value] >= 0) {
      found.normal = scene.obstacle_nodes.normal[value];
      const int law = norm2(found.normal) > 0.0f ? scene.obstacle_nodes.law[value] : obstacles + laws_of_walls;
      found.code = law + 1;
    }
    const Vec<float, 3> x = scene.grid.node_position(at);
    for (int d = 0; d < 3; ++d) {
      const int side = wall_side(scene.walls, x, scene.grid.dx, d) - 1;
      if (side < 0) continue;
      if (found.code != 0) {
        found.code |= (side + 1) << (16 + 2 * d);
      } else {
        found.normal = wall_normal<float>(d, side);
        found.code = obstacles + 2 * d + side + 1;
      }
    }
    contact[entry] = found;
  }
};

/// Contact at a node: the obstacle at rest, then the walls, so that these hold (mpm/physics/node_update.h).
GRAUPEL_HD inline Vec<float, 3> apply_contact_at_node(const SmallScene& small, const NodeContact& node,
                                                      Vec<float, 3> v) {
  const auto apply_law = [&](int32_t law, const Vec<float, 3>& normal) {
    v = apply_contact<FastFraction>(small.laws[law].contact, small.laws[law].friction, normal, v);
  };
  apply_law((node.code & 0xffff) - 1, node.normal);
  for (int32_t walls = node.code >> 16, axis = 0; walls != 0; walls >>= 2, ++axis) {
    if ((walls & 3) == 0) continue;
    const int side = walls & 2 ? 1 : 0;
    apply_law(small.first_wall_law + 2 * axis + side, wall_normal<float>(axis, side));
  }
  return v;
}

}  // namespace graupel::mpm::small
