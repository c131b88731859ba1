// A scene for a trajectory of another program's data set: what is known of it, and what is chosen for the rest.
#pragma once

#include <string>
#include <vector>

#include "core/scene.h"
#include "io/data_set_format.h"
#include "io/particle_series.h"
#include "io/simulator_metadata.h"

namespace graupel::io {

/// Known: walls (the bounds; periodic where the metadata say so), frame time, the materials' models. Chosen: the
/// metadata's grid_spacing and gravity where it has them; else grid cells of 1/2.24 of the connectivity radius (the
/// ratio of the HGN paper, 0.035 m to 1/64 m), no gravity. Bodies are the bounding boxes of each material's particles
/// in the first frame; there are no obstacles but particles. In two dimensions the plane is z = 0.5 m.
/// `overrides` are "key=value" as for scene files. Types of the series are ours. Throws ConfigError where the scene is
/// not usable.
Scene converted_scene(const SimulatorMetadata& metadata, DataSetFormat format, const ParticleSeries& series,
                      const std::vector<std::string>& overrides);

}  // namespace graupel::io
