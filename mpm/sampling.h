// Places particles in the sources of a scene.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/math/mat.h"
#include "core/math/random.h"
#include "core/scene/scene.h"

namespace graupel::mpm {

/// A motion that some particles follow.
struct Script {
  Motion motion;
  Vec3d body_center;  ///< stands in for a centre that the motion does not give [m]
  double release_time = std::numeric_limits<double>::infinity();  ///< [s]
  std::string name;                                               ///< for messages
};

/// What a particle that was given one by one starts with, beside its position and velocity.
struct GivenState {
  Mat3d deformation_gradient = Mat3d::identity();
  Mat3d affine_velocity = Mat3d::zero();  ///< [1/s]
  std::optional<double> internal = {};    ///< else of the undeformed state; of fluids det F
};

/// Particles at the start, source by source, and those that emitters will send out, emitter by emitter. Depends on
/// (seed, source index, particle index) alone. With two dimensions all lie in the plane: bodies are cut by it, points
/// are moved into it.
struct SampledParticles {
  std::vector<Vec3d> position;     ///< [m]
  std::vector<Vec3d> velocity;     ///< [m/s]
  std::vector<double> volume;      ///< reference volume: that of a cell / particles_per_cell [m^3]
  std::vector<int32_t> material;   ///< index into material_names
  std::vector<int32_t> source;     ///< index into scene.sources; behind them, of scene.emitters
  std::vector<Vec3d> spin;         ///< initial rotation, the antisymmetric part of C [rad/s]
  std::vector<double> birth_time;  ///< [s]; empty without emitters
  std::vector<GivenState> given;   ///< empty where no source has a state of its own
  std::vector<int32_t> script;     ///< index into scripts or -1; empty without scripts
  std::vector<Script> scripts;
  std::vector<std::string> material_names;  ///< keys of scene.materials, in map order
};

/// All particles of a scene. Throws ConfigError for sources and emitters that cannot be filled.
SampledParticles sample_sources(const Scene& scene, uint64_t seed);

/// Particles of one body in its own frame, by its rule. Throws ConfigError for a body that does not reach the plane of
/// a run with two dimensions.
std::vector<Vec3d> sample_body(const Source& source, std::size_t index, const Domain& domain, const Random& random);

}  // namespace graupel::mpm
