// What rollouts do on the CPU to the frames that a network predicts: free flight, push-out, density (docs/reference/
// method.md). The density is held after the last frame of a bundle.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "graph/corrections/density_projection.h"
#include "graph/corrections/free_flight.h"
#include "graph/features/features.h"

namespace graupel::graph {

struct CorrectionOptions {
  bool project = true;       ///< out of obstacles, into the walls
  double density_limit = 1;  ///< of that at rest; 0: none
  bool free_flight = true;
  int64_t bundle = 1;  ///< frames
  double spacing = 0;  ///< of the network [m]
};

class FrameCorrections {
 public:
  /// `matter` are the positions at the start of what is not kinematic, for the density at rest. `scene` must live as
  /// long as this.
  FrameCorrections(const Scene& scene, const Environment& environment, const std::vector<Vec3f>& matter,
                   const CorrectionOptions& options);

  /// The step to a frame, of the n particles that take part in it.
  struct Step {
    int64_t frame;                              ///< 1 for the first after the start
    double from;                                ///< time of `current` [s]
    const Environment& environment;             ///< of the frame to come
    const std::vector<int32_t>& particle_type;  ///< [n]
    bool other_particles;                       ///< than in the step before
    const std::vector<uint8_t>& kinematic;      ///< [n] 1 for kinematic particles, or empty
    const std::vector<Vec3f>&before, &current;  ///< [n]
  };
  /// Corrects `next` [n].
  void apply(const Step& step, std::vector<Vec3f>& next);

 private:
  void hold_momentum(const Step& step, std::vector<Vec3f>& next);
  void hold_density(const Step& step, std::vector<Vec3f>& next);

  const Scene& scene_;
  CorrectionOptions options_;
  std::optional<DensityProjection> density_;
  std::optional<FreeFlight> flight_;
  bool flight_is_stale_ = false;  ///< its particles are others
  std::vector<Vec3f> free_;       ///< out of obstacles
};

}  // namespace graupel::graph
