// Thinned, quantised copies of runs and obstacles for the report's 3-D player.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "compare/metrics/particle_run.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::compare {

/// Positions of some particles in some frames, as 16-bit shares of the domain's edges.
struct PlayerTrack {
  std::string label;
  std::size_t particles = 0, all_particles = 0;  ///< kept, and of the run
  std::vector<int64_t> frames;                   ///< frame numbers kept, ascending, from 0
  std::vector<uint16_t> position;                ///< [frames, particles, 3]
  std::vector<uint8_t> type;                     ///< [particles]
  double radius = 0;                             ///< of the drawn spheres [m], larger where particles were left out

  std::size_t bytes() const { return position.size() * 2 + type.size(); }
};

/// Points on the obstacles' surfaces with normals.
struct PlayerObstacles {
  std::vector<uint16_t> position;  ///< [n, 3] shares of the domain's edges
  std::vector<int8_t> normal;      ///< [n, 3] times 127
  double radius = 0;               ///< [m]
};

/// How a run is thinned: at most `particles` of them, every `frame_stride`-th frame.
struct Thinning {
  std::size_t particles = 1;
  std::size_t frame_stride = 1;
};
/// Keeps all that fits into `budget` bytes; beyond it frames go first, down to 30, then particles and frames alike.
Thinning choose_thinning(std::size_t particles, std::size_t frames, std::size_t budget);

PlayerTrack make_track(const Scene& scene, const ParticleRun& run, const std::string& label, const Thinning& thinning);
/// Leaves out every second frame; false when only two are left.
bool halve_frames(PlayerTrack& track);

PlayerObstacles make_player_obstacles(const Scene& scene, const sparsegrid::ObstacleSet& obstacles,
                                      std::size_t most_points);

}  // namespace graupel::compare
