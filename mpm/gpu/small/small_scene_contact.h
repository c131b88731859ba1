// Contact at the nodes of a small scene, from tables: for obstacles at rest and walls made before the run, for moving
// obstacles in the substep before. They tell which law holds a node and the normal. Equals mpm/physics/node_update.h.
// Gain, with chunks of equal length: one scene of the recipe
// 0.89 -> 0.71 ms a frame (docs/decisions/0007-small-scenes-on-gpus.md).
#pragma once

#include "mpm/gpu/small/small_scene_view.h"
#include "mpm/physics/node_update.h"

namespace graupel::mpm::small {

/// Entry n of an array over a box of nodes, the last axis fastest.
GRAUPEL_HD inline Vec<int, 3> node_of_entry(int32_t n, const Vec<int, 3>& size) {
  return {n / (size[1] * size[2]), n / size[2] % size[1], n % size[2]};
}

/// Number of a node in its block, and the block's directory index.
GRAUPEL_HD inline int number_in_block(const GridGeometry<float, 3>& grid, const Vec<int, 3>& node, int32_t& key) {
  Vec<int, 3> block;
  int inside = 0;
  for (int d = 0; d < 3; ++d) {
    block[d] = node[d] / block_width;
    inside = inside * block_width + node[d] % block_width;
  }
  key = grid.directory_index(block);
  return inside;
}

/// What holds the material at every node of a scene, moving obstacles apart.
struct FindContacts {
  SceneView<float> scene;
  Vec<int, 3> nodes;
  int32_t obstacles;  ///< of the scene
  NodeContact* contact;

  GRAUPEL_HD void operator()(int64_t entry) const {
    const Vec<int, 3> at = node_of_entry(static_cast<int32_t>(entry), nodes);
    int32_t key;
    const int inside = number_in_block(scene.grid, at, key);
    NodeContact found = {Vec<float, 3>::zero(), 0};
    const int32_t surface = scene.obstacle_nodes.block_number[key];
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

GRAUPEL_HD inline Vec<float, 3> apply_law(const SmallScene& small, int32_t law, const Vec<float, 3>& normal,
                                          const Vec<float, 3>& v) {
  return apply_contact<FastFraction>(small.laws[law].contact, small.laws[law].friction, normal, v);
}

/// The walls that hold a node beside the first law.
GRAUPEL_HD inline Vec<float, 3> apply_further_walls(const SmallScene& small, const NodeContact& node, Vec<float, 3> v) {
  for (int32_t walls = node.code >> 16, axis = 0; walls != 0; walls >>= 2, ++axis) {
    if ((walls & 3) == 0) continue;
    const int side = walls & 2 ? 1 : 0;
    v = apply_law(small, small.first_wall_law + 2 * axis + side, wall_normal<float>(axis, side), v);
  }
  return v;
}

/// Contact at a node with a code: the obstacle at rest, then the walls, so that these hold.
GRAUPEL_HD inline Vec<float, 3> apply_contact_at_node(const SmallScene& small, const NodeContact& node,
                                                      const Vec<float, 3>& v) {
  return apply_further_walls(small, node, apply_law(small, (node.code & 0xffff) - 1, node.normal, v));
}

/// The contact of a node that a moving obstacle holds instead of one at rest.
GRAUPEL_HD inline NodeContact held_by(const SmallScene& small, const NodeContact& node, int32_t obstacle,
                                      const Vec<float, 3>& normal) {
  const int32_t wall = (node.code & 0xffff) - 1 - small.first_wall_law;
  const bool is_wall = wall >= 0 && wall < laws_of_walls;
  const int32_t walls = (node.code & ~0xffff) | (is_wall ? 1 << (16 + wall) : 0);
  return {normal, walls | held_by_moving | (obstacle + 1)};
}

}  // namespace graupel::mpm::small
