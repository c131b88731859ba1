// Scene and recipe files: JSON with comments, unknown keys refused, errors with file, line, JSON pointer, value, range,
// remedy.
#pragma once

#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace graupel::io {

/// Reads a scene and the geometry it names (paths relative to the scene file). `overrides` are "key.path=value"
/// (values as JSON, bare words as strings), applied before validation. Throws ConfigError (exit 2) for a bad scene and
/// InputError (exit 3) for a missing or damaged geometry file.
Scene read_scene(const std::string& path, const std::vector<std::string>& overrides = {});
/// The same from text; `name` stands for the file in messages, `folder` is where relative paths start.
Scene parse_scene(const std::string& text, const std::string& name, const std::string& folder,
                  const std::vector<std::string>& overrides = {});

/// What is wrong with a scene file: the texts of all errors in its keys; where there are none, those between keys and
/// in its geometry files. Throws ConfigError for text that is no JSON, InputError for a missing file.
std::vector<std::string> scene_mistakes(const std::string& path, const std::vector<std::string>& overrides = {});

/// The scene that the trajectory or data-set file `file` stores. Its geometry has absolute paths; where a file is not
/// there any more, the end of its path is looked for beside `file` and in the folders above it, and its name beside it.
/// Throws InputError for a text that is no scene, and ConfigError for overrides that make it none.
Scene parse_stored_scene(const std::string& text, const std::string& name, const std::string& file,
                         const std::vector<std::string>& overrides = {});

/// The same without geometry: meshes and points are not loaded, and their files need not be there. Throws ConfigError.
Scene parse_scene_keys(const std::string& text, const std::string& name);

/// The text of a stored scene with another number of frames.
std::string with_frames(const std::string& scene_json, int64_t frames);

/// The scene as JSON that parse_scene reads back to the same scene (every field, defaults included).
std::string scene_to_json(const Scene& scene);

/// Every field with its default, as commented JSON (--print-defaults).
std::string scene_defaults();
/// docs/reference/scene_format.md and scenes/schema.json, made from the same declarations.
std::string scene_format_markdown();
std::string scene_schema_json();

}  // namespace graupel::io
