// A cube of one material that falls and comes to rest on the floor: dx = 1/256 m, 8 particles a cell, steps of 1e-4 s.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace graupel::bench {

constexpr int64_t steps_per_frame = 50;

/// "all", "tait_water", and the words of the constitutive models that move.
std::vector<std::string> material_words();
MaterialConfig cube_material(const std::string& name);
/// A cube of `cells` cells a side with 8 jittered particles a cell, 6 cells above the floor.
Scene cube_scene(const std::string& material, int64_t cells);
/// Cells a side whose particles come closest to `particles`.
int64_t cube_side(int64_t particles);

}  // namespace graupel::bench
