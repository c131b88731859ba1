// Frames of a trajectory in a file, read when they are asked for, or in memory.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "library/io.h"
#include "library/python/files.h"

namespace graupel::python {

/// Numbers of every frame that a lazy array shows.
enum class Quantity { position, velocity, active, field };

class TrajectoryFrames {
 public:
  virtual ~TrajectoryFrames() = default;
  /// Frames [first, first + count) with position, velocity where it is stored, active, and the `wanted` fields.
  virtual std::vector<std::shared_ptr<const ParticleFrame>> frames(int64_t first, int64_t count,
                                                                   FieldSet wanted) const = 0;
  virtual FieldSet fields() const = 0;
  virtual bool complete() const { return true; }
  virtual std::vector<io::NamedValue> parameters() const { return {}; }
  /// Obstacles and walls whose forces are stored, and these of every frame.
  virtual std::vector<std::string> contact_names() const { return {}; }
  virtual std::vector<std::vector<ContactForce>> contact_forces() const { return {}; }
};

/// A trajectory with its header; copies share the frames.
struct PyTrajectory {
  Trajectory header;  ///< its frames have times alone
  std::shared_ptr<const TrajectoryFrames> frames;
  std::string file;                         ///< "" in memory
  std::optional<std::string> verdict = {};  ///< of reduced models
  std::optional<double> trust_number = {};  ///< of reduced models
  std::vector<NamedFile> inputs = {};       ///< what it was made of

  int64_t size() const { return static_cast<int64_t>(header.frames.size()); }
};

PyTrajectory in_memory(Trajectory trajectory);

}  // namespace graupel::python
