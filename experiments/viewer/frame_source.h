// What the viewer shows on one side: a stored run or one that is being computed, with what stays the same in it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "experiments/viewer/frame_record.h"

namespace graupel::experiments {

struct RunFacts {
  std::string name;                    ///< of the file
  std::string made_by;                 ///< "mpm", a weights file, "" where unknown
  std::vector<int32_t> particle_type;  ///< [particles]
  ParticleMaterials materials;         ///< where two materials are of one law
  std::vector<double> times;           ///< [frames], of a run that goes on those to come too [s]
  std::optional<Scene> scene;          ///< where it is known
  int dimensions = 3;
  Box box;             ///< the scene's walls, or what the particles take [m]
  double spacing = 0;  ///< of particles at the start [m]
  std::string note;    ///< what the user should know of the file; "" for nothing
  bool live = false;   ///< is computed while it is shown
  uint32_t run = 0;    ///< number of the run: a live one that is begun anew has the next

  std::size_t moving_obstacles() const;
  std::size_t record_bytes() const { return frame_record_bytes(particle_type.size(), moving_obstacles()); }
  /// Where particles are shown: `box` and as much again around it.
  Box limits() const;
  /// Of obstacles that move, at a time.
  std::vector<RigidMap> obstacle_poses(double time) const;
};

/// The facts that follow from a scene: box, spacing, dimensions.
void set_scene(RunFacts& facts, const Scene& scene);

struct RunStatus {
  int64_t frames = 0;          ///< that can be read now: the first ones
  std::string state = "done";  ///< of a live run also running, paused, failed
  std::string message;         ///< why it failed
  double frame_seconds = 0;    ///< that a frame of a live run took lately
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual const RunFacts& facts() const = 0;
  virtual RunStatus status() const = 0;
  /// A part of the record of a frame below status().frames. May wait; throws InputError, IoError and, after stop(),
  /// Error(interrupted).
  virtual void read(int64_t frame, std::size_t offset, std::span<std::byte> out) = 0;
  /// Ends the work and releases those that wait. Called before the destructor.
  virtual void stop() = 0;

  virtual void pause(bool) {}  ///< of a live run
};

}  // namespace graupel::experiments
