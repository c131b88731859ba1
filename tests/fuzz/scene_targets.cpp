// Scenes and recipes: read, written again, and the smaller ones set up or drawn.
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_reader.h"
#include "mpm/simulation.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/json_mutator.h"
#include "tests/fuzz/small_scene.h"

namespace graupel::fuzz {

namespace {

const char* const no_folder = "/nonexistent";

void run_scene(const std::string& bytes) {
  const Scene read = io::parse_scene(bytes, "scene.json", no_folder);
  const std::string text = io::scene_to_json(read);
  expect(io::scene_to_json(io::parse_scene(text, "written.json", no_folder)) == text,
         "a scene that was written reads back as another one");
  if (!is_small(read)) return;
  const auto run = mpm::Simulation::create(read, {});
  run->advance_substep();
  static_cast<void>(run->frame());
}

/// The scene of sweeps.
constexpr const char* base_scene = R"({
  "materials": { "jelly": { "preset": "jelly" } },
  "sources": [{ "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5], "material": "jelly",
    "velocity": [0, 0, 0] }] })";

template <typename Read, typename Write>
void expect_same_when_read_again(const std::string& path, Read read, Write write) {
  const std::string text = write(read(path, {}));
  expect(write(read(file_with(text, "written.json"), {})) == text,
         "a recipe that was written reads back as another one");
}

/// Sweeps may draw thousands of scenes, which takes seconds.
bool draws_many(const std::string& bytes) {
  const Json root = Json::parse(bytes, nullptr, false, true);
  if (!root.is_object() || !root.contains("draw") || !root["draw"].is_object()) return false;
  for (const Json& runs : root["draw"])
    if (runs.is_number() && runs.get<double>() > 50) return true;
  return false;
}

void run_recipe(const std::string& bytes) {
  if (draws_many(bytes)) return;
  static const std::string base = file_with(base_scene, "scene.json");
  const std::string path = file_with(bytes, "input.json");
  if (io::is_sweep(path))
    expect_same_when_read_again(path, io::read_sweep, [](const io::Sweep& s) { return io::sweep_to_json(s.recipe); });
  else if (io::is_category_recipe(path))
    expect_same_when_read_again(path, io::read_category_recipe, io::category_recipe_to_json);
  else
    expect_same_when_read_again(path, io::read_recipe, io::recipe_to_json);
}

}  // namespace

const Target targets::scene = {"scene", run_scene, mutate_json_text};
const Target targets::recipe = {"recipe", run_recipe, mutate_json_text};

}  // namespace graupel::fuzz
