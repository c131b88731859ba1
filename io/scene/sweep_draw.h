// The runs of a sweep that are drawn in the box of its parameters' ranges, one dimension a parameter.
#pragma once

#include "core/scene/recipes/sweep_recipe.h"
#include "io/config/config_document.h"

namespace graupel::io {

/// Halton's point `index` (from 1 on) in [0, 1)^n, coordinate `dimension` (from 0 on, at most 7): the radical inverse
/// of the index in the dimension's prime (Halton 1960).
double halton(int64_t index, std::size_t dimension);

/// Fills every list of values and the lists of splits of a recipe with `draw`, and takes out `draw` and the ranges. The
/// runs are, in this order, those for training (the 2^n corners of the box, so that all others lie among them, then
/// Halton's points), for validation and for testing (both uniform in the box, by `draw.seed`). A recipe without `draw`
/// is left as it is. Throws ConfigError for lists beside `draw`, ranges without it, bad ranges, fewer training runs
/// than corners, and more parameters than Halton's points are good for.
void draw_runs(const ConfigDocument& document, SweepRecipe& recipe);

}  // namespace graupel::io
