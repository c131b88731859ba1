// Which material each particle of a stored trajectory is of: files tell its law, and where a scene has two materials of
// one law also the material, but for those of earlier versions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "core/scene/trajectory.h"

namespace graupel::mpm {

/// Indices into scene.materials in map order [n], -1 for particles of obstacles, those that emitters send out included.
/// They are those that the trajectory keeps; else, where the scene has one material of each law, particles' types tell;
/// else the scene is sampled again with the trajectory's seed, which must give the particles of its first frame `start`
/// [n]. Throws InputError naming `where` for particles that are not the scene's.
std::vector<int32_t> particle_materials(const Scene& scene, const Trajectory& header, const std::vector<Vec3f>& start,
                                        const std::string& where);
/// The same, for a network that sees the materials' constants. Throws InputError also for data of other programs, whose
/// scene tells none: then all of a material's are the defaults of its model.
std::vector<int32_t> network_materials(const Scene& scene, const Trajectory& header, const std::vector<Vec3f>& start,
                                       const std::string& where);

/// What a trajectory keeps of the materials of a scene's sampled particles.
ParticleMaterials kept_materials(const Scene& scene, uint64_t seed);

}  // namespace graupel::mpm
