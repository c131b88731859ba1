// What the declarations of core/scene/scene.h cannot say: checks between keys, and the geometry files.
#pragma once

#include "core/scene/scene.h"
#include "io/config/config_document.h"
#include "io/scene/geometry_finder.h"

namespace graupel::io {

/// Throws ConfigError, naming `place`, for a domain with too few or too many cells along an edge.
void check_grid(const ConfigPlace& place, const Domain& domain);

/// Throws ConfigError for a scene whose parts do not fit together.
void check_scene(const ConfigDocument& document, const Scene& scene);

/// Makes the `file` of every body absolute (in `scene` and `document`), where `finder` finds it, and loads meshes and
/// points. Throws InputError for a file that is missing or damaged.
void load_geometry(ConfigDocument& document, const GeometryFinder& finder, Scene& scene);

/// Of a scene in which something was wrong when it was read: the materials and files that its bodies name, which depend
/// on no other key. Puts what is wrong among the document's mistakes.
void check_named(ConfigDocument& document, const GeometryFinder& finder, Scene& scene);

}  // namespace graupel::io
