// Reads scenes, and writes them and their format.
#include "io/scene/scene_reader.h"

#include <filesystem>
#include <iomanip>
#include <sstream>

#include "core/scene/recipes/category_recipe.h"
#include "core/scene/recipes/sweep_recipe.h"
#include "core/system/atomic_file.h"
#include "io/config/config_description.h"
#include "io/scene/geometry_finder.h"
#include "io/scene/material_start.h"
#include "io/scene/scene_checks.h"

namespace graupel::io {

namespace {

/// A small scene that shows every kind of entry, for the defaults file.
Scene example_scene() {
  Scene scene;
  scene.name = "example";
  MaterialConfig& water = scene.materials["water"];
  water.name = "water";
  water.preset = "water";
  Source source;
  source.material = "water";
  source.size = {0.2, 0.2, 0.2};
  source.position = {0.5, 0.6, 0.5};
  scene.sources.push_back(source);
  Obstacle obstacle;
  obstacle.shape = Shape::sphere;
  obstacle.radius = 0.1;
  obstacle.position = {0.5, 0.2, 0.5};
  scene.obstacles.push_back(obstacle);
  return scene;
}

/// Six digits are more than any of these constants is known to.
std::string preset_value(const JsonNode& value) {
  if (value.kind != JsonNode::Kind::real)
    return value.text.empty() ? write_json(value, JsonLayout::compact) : value.text;
  std::ostringstream text;
  text << std::setprecision(6) << value.real;
  return text.str();
}

/// Table of the material presets.
std::string preset_markdown() {
  std::string text =
      "\n## Material presets\n\n`taichi_*` are the constants of Taichi Elements, `nsf_*`, `crom_*` and `licrom_*` "
      "those "
      "of the papers on reduced\nmodels, `claymore_*` those of the cubes by which claymore is measured.\n"
      "docs/reference/method.md says what those papers leave open.\n\n| Preset | Model | Constants |\n|---|---|---|\n";
  for (const std::string& name : material_preset_names()) {
    const MaterialConfig preset = *material_preset(name);
    std::string constants;
    for (const auto& member : json_of(preset).members)
      if (member.key != "preset" && member.key != "model") {
        constants += constants.empty() ? "" : ", ";
        constants += "`" + member.key + "` " + preset_value(member.value);
      }
    text += "| `" + name + "` | " + word_of(preset.model) + " | " + constants + " |\n";
  }
  return text;
}

/// Recipes that name a scene.
std::string sweep_markdown() {
  return "\n# Sweeps\n\n"
         "A recipe with the key `scene` is a sweep: `graupel generate` runs that scene once for each value of its "
         "parameters\nand stores the values with the trajectories (docs/reference/file_formats.md).\n"
         "Run i, from 0 on, takes item i of every list.\n\n"
         "    {\n"
         "      \"scene\": \"../heap.json\",\n"
         "      \"set\": { \"domain.dx\": 0.02, \"frames\": 60 },\n"
         "      \"parameters\": [\n"
         "        { \"name\": \"friction_angle\", \"unit\": \"degrees\", \"key\": "
         "\"materials.sand.friction_angle\", \"values\": [20, 25, 30],\n"
         "          \"also\": [ { \"key\": \"sources.0.velocity\", \"values\": [[0, 0, 0], [1, 0, 0], [2, 0, 0]] } "
         "] }\n"
         "      ],\n"
         "      \"test\": [1], \"fields\": \"stress,affine\"\n"
         "    }\n\n"
         "All runs start with the same particles, which are a reduced model's reference points: a parameter that moves "
         "them at\nthe start is an error, as is one of `frames`, `frame_time` or `seed`. The seed is the scene's, or "
         "`--seed`. The scene's\nkeys change in the order: scene file, `set`, parameters. For one data set "
         "`--set deflate=4` changes a key of the recipe\nand `--set scene.domain.dx=0.03` one of its scene. To store a "
         "frame every k substeps, give the scene\n`\"time_step\": { \"policy\": \"fixed\", "
         "\"substeps_per_frame\": k }` and a `frame_time` of k steps.\n\n"
         "With `draw` the runs are drawn in the box of the parameters' ranges: for training its 2^n corners and points "
         "of Halton's\nsequence, so that every other run lies among them; for validation and testing at random, by "
         "`draw.seed`. Keys that\nfollow a parameter are linear in it.\n\n"
         "    \"draw\": { \"train\": 32, \"valid\": 4, \"test\": 8, \"seed\": 1 },\n"
         "    \"parameters\": [\n"
         "      { \"name\": \"place\", \"unit\": \"m\", \"key\": \"obstacles.0.position.0\", \"range\": [0.3, 0.7] },\n"
         "      { \"name\": \"depth\", \"unit\": \"m\", \"key\": "
         "\"obstacles.0.motion.keyframes.0.translation.1\", \"range\": [-0.05, -0.02],\n"
         "        \"also\": [ { \"key\": \"obstacles.0.motion.keyframes.1.translation.1\", \"range\": [-0.05, -0.02] } "
         "] }\n"
         "    ]\n\n"
         "These tables are made from `core/scene/recipes/sweep_recipe.h`.\n" +
         description_markdown(describe<SweepRecipe>(), "Top level of a sweep");
}

/// Recipes of random scenes.
std::string random_markdown() {
  return "\n# Random scenes\n\n"
         "A recipe without the keys `scene` and `categories` draws scenes of one kind: groups of particles that fall "
         "among\nobstacles. These tables are made from `core/scene/recipes/scene_recipe.h`.\n" +
         description_markdown(describe<SceneRecipe>(), "Top level of random scenes");
}

std::string category_markdown() {
  return "\n# Categories of random scenes\n\n"
         "A recipe with the key `categories` draws scenes of several kinds (`scenes/recipes/general.json`). Scene i of "
         "a split\nhas category i mod n, and its name says so: `general-test-00003-thrown_bodies`. It depends on the "
         "recipe, the seed, the\nsplit and i alone. A scene states its constants: materials are written with the "
         "numbers that were drawn.\n\n"
         "| Category | What it draws |\n|---|---|\n"
         "| `dam_break` | A block of water at a wall, on the floor; 0 to 2 obstacles and 0 to 2 other bodies |\n"
         "| `column_collapse` | 1 to 3 columns on the floor, the first of sand or snow; 0 to 2 obstacles |\n"
         "| `fall_on_obstacles` | Bodies at rest above `obstacles.count` obstacles |\n"
         "| `thrown_bodies` | Bodies with velocity and spin; 0 to 2 obstacles |\n"
         "| `snow_impact` | 1 to 3 bodies of snow, thrown at an obstacle or a wall in the upper half of "
         "`bodies.speed`; 0 to 2 other bodies, 1 to 3 obstacles |\n"
         "| `stream` | `streams.count` emitters above obstacles; 0 to 2 bodies on the floor |\n"
         "| `moving_obstacle` | A paddle that turns, a box that slides or a tray that tilts; bodies at rest |\n"
         "| `filling_container` | A container under a stream or under falling bodies |\n\n"
         "An interval is written [low, high]. It is drawn from uniformly, or uniformly in its logarithm where high/low "
         "is "
         "10 or\nmore. Bodies share `max_particles`: one that would have more is made slender, then small, and left "
         "out "
         "below\n`bodies.size`. Bounding boxes stand for meshes and level sets where places are looked for. All scenes "
         "have the same\n`time_step`. Equal substeps that are too long for the stiffest constants are an error, and "
         "`fixed` ones also where\nthey are too long for the fastest motion.\n\n"
         "These tables are made from `core/scene/recipes/category_recipe.h` and "
         "`core/scene/recipes/category_parts.h`.\n" +
         description_markdown(describe<CategoryRecipe>(), "Top level of categories");
}

/// Self-contained text: overrides applied, absolute paths, no link to an editor's schema.
std::string source_text(const ConfigDocument& document) {
  JsonNode copy = JsonNode::object();
  for (const auto& member : document.root.members)
    if (member.key != "$schema") copy.set(member.key, member.value);
  return write_json(copy, JsonLayout::compact);
}

Scene parse(const std::string& text, const std::string& name, const GeometryFinder& finder,
            const std::vector<std::string>& overrides) {
  ConfigDocument document = parse_document<Scene>(text, name, overrides);
  Scene scene = read_config<Scene>(document);
  check_scene(document, scene);
  load_geometry(document, finder, scene);
  scene.source = source_text(document);
  return scene;
}

bool is_scene(const std::string& text, const std::string& name, const GeometryFinder& finder) {
  try {
    parse(text, name, finder, {});
    return true;
  } catch (const ConfigError&) {
    return false;
  }
}

/// `why` is an error about the scene that `file` stores, whose remedy is of a scene that is written by hand.
[[noreturn]] void refuse_stored(const std::string& file, const std::string& why) {
  const bool weights = file.ends_with(".safetensors");
  throw InputError("'" + file + "': the scene stored in it is damaged or of another version (" +
                   why.substr(0, why.find(". ")) + "). " +
                   (weights ? "Train again, or copy the file anew" : "Make it again, or copy it anew"));
}

constexpr std::size_t largest_file = std::size_t(16) << 20;

std::string folder_of(const std::string& path) { return std::filesystem::absolute(path).parent_path().string(); }

}  // namespace

Scene parse_scene(const std::string& text, const std::string& name, const std::string& folder,
                  const std::vector<std::string>& overrides) {
  return parse(text, name, SceneFolder(folder), overrides);
}

Scene parse_stored_scene(const std::string& text, const std::string& name, const std::string& file,
                         const std::vector<std::string>& overrides) {
  const AroundTrajectory finder(file);
  try {
    parse_json(text, name);
  } catch (const Error& error) {
    refuse_stored(file, error.what());
  }
  try {
    return parse(text, name, finder, overrides);
  } catch (const ConfigError& error) {
    if (!overrides.empty() && is_scene(text, name, finder)) throw;
    refuse_stored(file, error.what());
  }
}

Scene parse_scene_keys(const std::string& text, const std::string& name) {
  const ConfigDocument document = parse_document<Scene>(text, name, {});
  Scene scene = read_config<Scene>(document);
  check_scene(document, scene);
  return scene;
}

Scene read_scene(const std::string& path, const std::vector<std::string>& overrides) {
  Scene scene = parse_scene(read_file(path, largest_file), path, folder_of(path), overrides);
  scene.file = path;
  return scene;
}

std::vector<std::string> scene_mistakes(const std::string& path, const std::vector<std::string>& overrides) {
  ConfigDocument document = parse_document<Scene>(read_file(path, largest_file), path, overrides);
  std::vector<std::string> mistakes;
  document.mistakes = &mistakes;
  Scene scene = read_config<Scene>(document);
  if (!mistakes.empty()) {  // the checks between other keys would speak of defaults
    check_named(document, SceneFolder(folder_of(path)), scene);
    return mistakes;
  }
  check_scene(document, scene);
  load_geometry(document, SceneFolder(folder_of(path)), scene);
  return mistakes;
}

std::string with_frames(const std::string& scene_json, int64_t frames) {
  JsonNode root = parse_json(scene_json, "stored scene");
  root.set("frames", JsonNode::of(frames));
  return write_json(root, JsonLayout::compact);
}

std::string scene_to_json(const Scene& scene) { return write_json(json_of(scene), JsonLayout::indented); }

std::string scene_defaults() { return commented_json(describe<Scene>(), json_of(example_scene())); }

std::string scene_format_markdown() {
  return "# Scene format\n\n"
         "A scene is a JSON file; `//` and `/* */` comments are allowed. Units are SI, y is up by convention. Unknown "
         "keys\n"
         "are errors. Paths are relative to the scene file. `--set key.path=value` replaces a value for one run, e.g.\n"
         "`--set domain.dx=0.01`, `--set sources.0.velocity=[0,-1,0]` or, of a list one item, `--set gravity.1=-5`.\n"
         "`graupel simulate --print-defaults` writes a scene with every key. Editors check and complete scenes with\n"
         "`scenes/schema.json` (name it under the key `\"$schema\"`).\n\n"
         "Sources may have every shape but `plane` and `vdb`, emitters none of these and no `points`, obstacles every "
         "shape but\n`points`. The domain needs at "
         "least\n"
         "16 cells along each edge inside its walls and at most 2^21 cells along an edge. "
         "Each 4^3 cells take 13 bytes, also empty\nones: 12 GB for 60 m along each edge at a dx of 1/64 m. "
         "Obstacles may reach out of it; "
         "one\nthat its motion never leads in is an error, and so is one smaller than two voxels of its grid, or "
         "thinner than a\ntenth of one. A material starts from its `preset`, then its other keys apply.\n\n"
         "A mesh must be closed. Its parts are united, wherever each faces; one inside another that faces the other "
         "way\nis the wall of a cavity (a tank). Parts that enclose a room only together have none. A `vdb` keeps its "
         "cavities.\n\n"
         "This file is made from the declarations in `core/scene/scene.h` and the headers that it names.\n" +
         description_markdown(describe<Scene>(), "Top level") + preset_markdown() + sweep_markdown() +
         random_markdown() + category_markdown();
}

std::string scene_schema_json() { return description_schema(describe<Scene>(), "Graupel scene"); }

}  // namespace graupel::io
