// Frames of particles over time: what the solver and the learned models make, and what the comparison reads.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/math/vec.h"
#include "core/scene/particle_fields.h"

namespace graupel {

/// State of all particles at one time. Particle order is the same in every frame of a trajectory.
struct ParticleFrame {
  double time = 0;              ///< [s]
  std::vector<Vec3f> position;  ///< [m], shape [n, 3]
  std::vector<Vec3f> velocity;  ///< [m/s], shape [n, 3]; empty where it was not stored
  std::vector<uint8_t> active =
      {};                      ///< shape [n]: 0 for particles that are not in the run (yet, any more); empty: all are
  ParticleFields fields = {};  ///< those that were asked for

  bool is_active(std::size_t i) const { return active.empty() || active[i] != 0; }
};

/// Which material of the scene each particle is of, where two materials are of one law; else empty: types tell.
struct ParticleMaterials {
  std::vector<int32_t> index;      ///< [n] into names; -1: none (particles of obstacles)
  std::vector<std::string> names;  ///< keys of the scene's materials

  bool empty() const { return names.empty(); }
  bool operator==(const ParticleMaterials&) const = default;
};

struct Trajectory {
  std::vector<int32_t> particle_type;  ///< [n], ids of core/scene/material_config.h
  std::vector<ParticleFrame> frames;   ///< [T]
  double frame_time = 1.0 / 60;        ///< [s]
  std::string scene_json;              ///< the scene that made it; "" when unknown
  uint64_t seed = 0;
  std::string made_by;             ///< "mpm", or the weights file of a learned model
  int64_t diverged_at_frame = -1;  ///< first frame that is not usable; -1 for none
  ParticleMaterials materials = {};

  std::size_t particle_count() const { return particle_type.size(); }
  std::size_t frame_count() const { return frames.size(); }
};

}  // namespace graupel
