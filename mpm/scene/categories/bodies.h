// Volumes, boxes and sizes of the bodies that categories draw.
#pragma once

#include "core/scene/recipes/category_recipe.h"
#include "mpm/scene/placement.h"
#include "sparsegrid/analytic_shape.h"

namespace graupel::mpm {

/// Box around the geometry of a file at scale 1 [m]. Throws InputError for an unusable .vdb file.
sparsegrid::LocalBox bounds_of(const RecipeGeometry& geometry);

/// Makes the body the file's geometry, scaled to this largest extent [m].
void use_geometry(Body& body, Shape shape, const RecipeGeometry& geometry, double size);

/// A body with a formula that encloses the body: itself, or the box around a mesh or level set. `file_box` is that of
/// the file's geometry at the body's scale; unused for a body with a formula.
Body envelope(const Body& body, const sparsegrid::LocalBox& file_box);

/// Axis-aligned box in the world around an envelope, from its position [m].
sparsegrid::LocalBox world_extent(const Body& envelope);

/// Of a box, sphere, cylinder or mesh [m^3].
double volume(const Body& body);

/// Shrinks a box, sphere or cylinder to at most this volume [m^3]: the two smaller extents of a box and the radius of a
/// cylinder first, so that large bodies become slender; none below `least` [m]. False where that is not enough.
bool shrink(Body& body, double most, double least);

}  // namespace graupel::mpm
