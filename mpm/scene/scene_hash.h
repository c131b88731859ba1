// A number that identifies what a run depends on: everything in the scene but its texts and the count of frames.
#pragma once

#include <cstdint>

#include "core/scene/scene.h"

namespace graupel::mpm {

/// 64-bit FNV-1a over the declared fields, meshes and points of the scene, and the seed.
uint64_t scene_hash(const Scene& scene, uint64_t seed);
/// The same of numbers to 30 bits: the last bits of a drawn scene depend on the compiler and its options.
uint64_t rounded_scene_hash(const Scene& scene, uint64_t seed);

}  // namespace graupel::mpm
