// Links between the particles of a scene, as the samples of training have them.
#pragma once

#include <vector>

#include "graph/topology/gns_graph.h"
#include "sparsegrid/radius_graph.h"
#include "train/data/batch.h"

namespace graupel::train {

inline void set_links(SceneGraph& scene, const std::vector<Vec3f>& position, double radius) {
  scene.links = sparsegrid::build_radius_graph(position, radius, sparsegrid::SelfEdges::with);
  scene.edge_features.clear();
  for (int32_t r = 0; r < scene.links.points(); ++r)
    for (int32_t e = scene.links.begin[static_cast<std::size_t>(r)];
         e < scene.links.begin[static_cast<std::size_t>(r) + 1]; ++e)
      for (const float feature :
           graph::edge_features(position[static_cast<std::size_t>(scene.links.sender[static_cast<std::size_t>(e)])],
                                position[static_cast<std::size_t>(r)], radius))
        scene.edge_features.push_back(feature);
}

}  // namespace graupel::train
