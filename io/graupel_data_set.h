// Splits of our own data sets as series of positions, and the way back.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/particle_series.h"
#include "io/simulator_metadata.h"
#include "io/trajectory_file.h"

namespace graupel::io {

/// Particle types are ours. Runs in the plane have two dimensions; frames from a divergence on are left out.
class GraupelSplit : public SeriesReader {
 public:
  /// `common` is what the scenes of a data set have in common: filled by the first trajectory (but for the radius and
  /// the motion), compared with all others. Throws InputError for trajectories without scene, with particles that come
  /// or go, or with other walls or frame times than those before.
  GraupelSplit(const std::string& file, std::optional<SimulatorMetadata>& common);
  int64_t count() const override { return reader_.count(); }
  ParticleSeries read(int64_t i) const override;
  int64_t with_obstacles() const { return with_obstacles_; }

 private:
  std::vector<float> material_property(int64_t i, int64_t particles) const;

  std::string file_;
  TrajectoryReader reader_;
  int64_t with_obstacles_ = 0;
  int dimensions_ = 3;
};

/// How a trajectory of ours is made of a series.
struct OwnTrajectory {
  Scene scene;
  std::string made_by;
};
/// Writes a split; types are ours. Velocities at the start are the difference of the first two frames. `describe` gives
/// what goes with a series. Throws IoError; what is at `file` then is of no use.
void write_graupel_split(const std::string& file, int64_t count, const SeriesSource& source,
                         const std::function<OwnTrajectory(const ParticleSeries&)>& describe);

}  // namespace graupel::io
