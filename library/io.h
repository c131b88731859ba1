// Scenes, recipes and trajectories in files: the public face of io/. Read a scene with io::read_scene() or
// io::parse_scene(), or fill a Scene in code; read and write HDF5 with io::TrajectoryReader and io::TrajectoryWriter.
#pragma once

#include <string>

#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel {

/// A scene that was made in code as the reader would give it: every value is checked, and the geometry of meshes and
/// points is read; relative paths start at `folder`. Throws ConfigError and InputError as io::parse_scene().
Scene checked_scene(const Scene& scene, const std::string& folder = ".");

}  // namespace graupel
