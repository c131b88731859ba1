#include "io/scene/category_reader.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <type_traits>
#include <utility>

#include "core/scene/particle_fields.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/config/config_reader.h"
#include "io/config/config_writer.h"
#include "io/mesh/mesh_file.h"
#include "io/scene/geometry_finder.h"
#include "io/scene/material_start.h"
#include "io/scene/scene_checks.h"

namespace graupel::io {

namespace fs = std::filesystem;

template <>
struct ConfigStart<RecipeMaterial> {
  static void begin(const ConfigPlace& place, const std::string& key, RecipeMaterial& out) {
    ConfigStart<MaterialConfig>::begin(place, key, out);
  }
};

namespace {

constexpr std::size_t largest_file = std::size_t(16) << 20;

template <typename List>
void check_not_empty(const ConfigDocument& document, const std::vector<std::string>& keys, const List& list) {
  if (!list.empty()) return;
  const ConfigPlace place = find_place(document, keys);
  config_fail(place, "is empty (" + place.value() + ", at least 1 entry)", "Name at least one");
}

/// The range of every constant that the material's model has.
void check_ranges(const ConfigDocument& document, const std::string& name, const RecipeMaterial& material) {
  std::vector<std::string_view> known;
  std::vector<Range> allowed;
  std::vector<KindField> kinds;
  MaterialConfig::fields([&](auto member, const FieldInfo& info) {
    using Field = std::remove_cvref_t<decltype(material.*member)>;
    if constexpr (ConfigEnum<Field>) kinds.push_back({info.name, enum_words<Field>(), word_of(material.*member)});
    if constexpr (std::is_same_v<Field, double>)
      if (applies(info, kinds)) known.push_back(info.name), allowed.push_back(info.range);
  });
  for (const auto& [key, interval] : material.ranges) {
    const ConfigPlace place = find_place(document, {"materials", name, "ranges", key});
    const auto found = std::find(known.begin(), known.end(), key);
    if (found == known.end()) {
      std::string words;
      for (const auto word : known) words += (words.empty() ? "" : ", ") + std::string(word);
      config_fail(place, "is no constant of " + std::string(word_of(material.model)) + " (allowed: " + words + ")",
                  "Remove or correct it." + did_you_mean(key, known));
    }
    const Range& range = allowed[static_cast<std::size_t>(found - known.begin())];
    if (!range.contains(interval.low) || !range.contains(interval.high))
      config_fail(place, "is out of range (" + place.value() + ", allowed " + range_text(range) + ")",
                  "Change the value");
  }
}

/// Each category finds a material of its models.
void check_materials(const ConfigDocument& document, const CategoryRecipe& recipe) {
  check_not_empty(document, {"materials"}, recipe.materials);
  for (const auto& [name, material] : recipe.materials) check_ranges(document, name, material);
  for (std::size_t i = 0; i < recipe.categories.size(); ++i) {
    const std::vector<MaterialModel> models = models_of(recipe.categories[i]);
    std::string words;
    for (const MaterialModel model : models) words += (words.empty() ? "" : " or ") + std::string(word_of(model));
    if (!models.empty() && std::none_of(recipe.materials.begin(), recipe.materials.end(), [&](const auto& entry) {
          return std::find(models.begin(), models.end(), entry.second.model) != models.end();
        }))
      config_fail(
          find_place(document, {"categories", std::to_string(i)}),
          "needs a material of the model " + words + " (" + word_of(recipe.categories[i]) + "; 'materials' has none)",
          "Add one, or take the category out");
  }
}

void check_shapes(const ConfigDocument& document, const char* part, const std::vector<Shape>& shapes,
                  const std::vector<Shape>& allowed) {
  check_not_empty(document, {part, "shapes"}, shapes);
  std::string words;
  for (const Shape shape : allowed) words += (words.empty() ? "" : ", ") + std::string(word_of(shape));
  for (std::size_t i = 0; i < shapes.size(); ++i)
    if (std::find(allowed.begin(), allowed.end(), shapes[i]) == allowed.end())
      config_fail(find_place(document, {part, "shapes", std::to_string(i)}),
                  "cannot be drawn (" + std::string(word_of(shapes[i])) + ", allowed: " + words + ")",
                  "Use one of them");
}

void check_files(const ConfigDocument& document, const char* part, const std::vector<Shape>& shapes, Shape shape,
                 const char* key, const std::vector<std::string>& files) {
  const auto found = std::find(shapes.begin(), shapes.end(), shape);
  if (found == shapes.end() || !files.empty()) return;
  config_fail(find_place(document, {part, "shapes", std::to_string(found - shapes.begin())}),
              "has no file to draw from (" + std::string(word_of(shape)) + ", '" + key + "' is empty)",
              "Name files under '" + std::string(key) + "', or take the shape out");
}

void check_level_sets(const ConfigDocument& document, const std::vector<std::string>& files) {
  for (std::size_t i = 0; i < files.size(); ++i)
    if (fs::path(files[i]).extension() != ".vdb")
      config_fail(find_place(document, {"obstacles", "level_sets", std::to_string(i)}),
                  "is no level set (\"" + files[i] + "\", allowed: files that end in .vdb)",
                  "Name a .vdb file, or list a mesh under 'meshes'");
}

void check_domain_sizes(const ConfigDocument& document, const RecipeDomain& recipe) {
  check_not_empty(document, {"domain", "sizes"}, recipe.sizes);
  check_not_empty(document, {"domain", "floor", "kinds"}, recipe.floor.kinds);
  check_not_empty(document, {"domain", "walls", "kinds"}, recipe.walls.kinds);
  Domain domain;
  domain.dx = recipe.dx;
  domain.wall_cells = recipe.wall_cells;
  for (std::size_t i = 0; i < recipe.sizes.size(); ++i) {
    domain.size = recipe.sizes[i];
    check_grid(find_place(document, {"domain", "sizes", std::to_string(i)}), domain);
  }
}

void check_recipe(const ConfigDocument& document, const CategoryRecipe& recipe) {
  check_not_empty(document, {"categories"}, recipe.categories);
  check_domain_sizes(document, recipe.domain);
  check_materials(document, recipe);
  check_shapes(document, "bodies", recipe.bodies.shapes, {Shape::box, Shape::sphere, Shape::cylinder, Shape::mesh});
  check_files(document, "bodies", recipe.bodies.shapes, Shape::mesh, "meshes", recipe.bodies.meshes);
  check_shapes(document, "obstacles", recipe.obstacles.shapes,
               {Shape::box, Shape::half_box, Shape::sphere, Shape::half_sphere, Shape::cone, Shape::pyramid,
                Shape::cylinder, Shape::mesh, Shape::vdb});
  check_files(document, "obstacles", recipe.obstacles.shapes, Shape::mesh, "meshes", recipe.obstacles.meshes);
  check_files(document, "obstacles", recipe.obstacles.shapes, Shape::vdb, "level_sets", recipe.obstacles.level_sets);
  check_level_sets(document, recipe.obstacles.level_sets);
  check_not_empty(document, {"obstacles", "surface", "kinds"}, recipe.obstacles.surface.kinds);
  const double cells = recipe.bodies.size.low / recipe.domain.dx;
  const double least = recipe.bodies.particles_per_cell * cells * cells * cells;
  if (static_cast<double>(recipe.max_particles) < least)
    config_fail(find_place(document, {"max_particles"}),
                "is less than a body of the smallest size has (" + std::to_string(recipe.max_particles) +
                    ", at least " + number_text(std::ceil(least)) + ")",
                "Raise it, or lower bodies.size");
  try {
    FieldSet::parse(recipe.fields_stored);
  } catch (const ConfigError& error) {
    throw ConfigError(find_place(document, {"fields"}).text() + " is not a list of fields: " + error.what());
  }
}

std::vector<RecipeGeometry> load(const ConfigDocument& document, const char* part, const char* key,
                                 const std::vector<std::string>& files) {
  const SceneFolder finder(fs::absolute(document.name).parent_path().string());
  std::vector<RecipeGeometry> all;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::string where = find_place(document, {part, key, std::to_string(i)}).text();
    RecipeGeometry geometry{.file = finder.find(files[i]), .mesh = {}};
    if (!fs::is_regular_file(geometry.file))
      throw InputError(where + " names a file that does not exist (\"" + files[i] + "\", looked for at '" +
                       geometry.file + "'). Paths are relative to the recipe; correct the path or add the file");
    try {
      if (std::string_view(key) == "meshes")
        geometry.mesh = std::make_shared<const TriangleMesh>(read_mesh(geometry.file));
    } catch (const InputError& error) {
      throw InputError(where + ": " + error.what());
    }
    all.push_back(std::move(geometry));
  }
  return all;
}

/// Checks between keys, and the geometry.
void complete(const ConfigDocument& document, CategoryRecipe& recipe) {
  check_recipe(document, recipe);
  recipe.bodies.geometry = load(document, "bodies", "meshes", recipe.bodies.meshes);
  recipe.obstacles.mesh_geometry = load(document, "obstacles", "meshes", recipe.obstacles.meshes);
  recipe.obstacles.level_set_geometry = load(document, "obstacles", "level_sets", recipe.obstacles.level_sets);
}

}  // namespace

bool is_category_recipe(const std::string& path) {
  return parse_json(read_file(path, largest_file), path).find("categories") != nullptr;
}

CategoryRecipe read_category_recipe(const std::string& path, const std::vector<std::string>& overrides) {
  const ConfigDocument document = parse_document<CategoryRecipe>(read_file(path, largest_file), path, overrides);
  auto recipe = read_config<CategoryRecipe>(document);
  complete(document, recipe);
  return recipe;
}

std::vector<std::string> category_recipe_mistakes(const std::string& path) {
  ConfigDocument document = ConfigDocument::parse(read_file(path, largest_file), path);
  std::vector<std::string> mistakes;
  document.mistakes = &mistakes;
  auto recipe = read_config<CategoryRecipe>(document);
  if (mistakes.empty()) document.attempt([&] { complete(document, recipe); });
  return mistakes;
}

std::string category_recipe_to_json(const CategoryRecipe& recipe) {
  return write_json(json_of(recipe), JsonLayout::indented);
}

}  // namespace graupel::io
