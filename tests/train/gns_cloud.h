// Random scenes of GNS for the tests of training, and a small network's settings.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/random.h"
#include "core/scene/material_config.h"
#include "graph/features/features.h"
#include "tests/train/links.h"
#include "tests/train/tiny_data.h"
#include "train/data/batch.h"

namespace graupel::train {

/// A cloud with random features and targets; the last `obstacles` particles are those of obstacles.
struct Cloud {
  SceneGraph scene;
  std::vector<Vec3f> position;
  std::vector<int32_t> type;
};

inline Cloud random_cloud(const graph::GnsConfig& config, uint64_t seed, int particles, double edge,
                          int obstacles = 0) {
  const Random random(seed, RandomPurpose::test);
  Cloud cloud;
  for (int i = 0; i < particles; ++i) {
    const auto draw = static_cast<uint64_t>(i);
    Vec3f x;
    for (int d = 0; d < 3; ++d) x[d] = static_cast<float>(random.uniform(draw, d, -0.1, edge - 0.1));
    cloud.position.push_back(x);
    cloud.type.push_back(i < particles - obstacles ? 4 + i % 5 : obstacle_particle_type);
    cloud.scene.type_row.push_back(graph::embedding_row(cloud.type.back()));
  }
  const int64_t width = config.input_width() - config.embedding, moving = particles - obstacles;
  for (int64_t i = 0; i < particles * width + config.output_width() * moving; ++i) {
    double a, b;
    random.normal(1000000 + static_cast<uint64_t>(i), 0, a, b);
    (i < particles * width ? cloud.scene.features : cloud.scene.target).push_back(static_cast<float>(a));
  }
  cloud.scene.obstacle_particles = obstacles;
  set_links(cloud.scene, cloud.position, config.radius);
  return cloud;
}

inline TrainConfig tiny_gns_config() {
  TrainConfig config = tiny_config();
  config.architecture = Architecture::gns;
  config.gns.latent = 16;
  config.gns.message_passing = 2;
  config.gns.embedding = 4;
  config.gns.history = 2;
  config.gns.radius = 0.07;
  config.gns.dx = 0.03125;
  config.gns.signed_distance = true;
  return config;
}

}  // namespace graupel::train
