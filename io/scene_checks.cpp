// Checks between the keys of a scene, and loading of the geometry it names.
#include "io/scene_checks.h"

#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "io/config_values.h"
#include "io/mesh_file.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

constexpr double fewest_cells = 16;             // per edge, inside the walls
constexpr double most_cells = double(1 << 21);  // per edge: cell indices are packed into 21 bits an axis

ConfigPlace body_place(const ConfigDocument& document, const char* list, std::size_t index, const char* key) {
  return find_place(document, {list, std::to_string(index), key});
}

void check_domain(const ConfigDocument& document, const Domain& domain) {
  for (int axis = 0; axis < 3; ++axis) {
    const double cells = domain.size[axis] / domain.dx;
    const double needed = fewest_cells + 2 * static_cast<double>(domain.wall_cells);
    const std::string figures = number_text(cells) + " cells along " + std::string(1, "xyz"[axis]) + ", ";
    if (cells < needed * (1 - 1e-9))
      config_fail(find_place(document, {"domain", "size"}),
                  "is too small for its grid (" + figures + "at least " + number_text(needed) + ": 16 and the walls)",
                  "Enlarge the domain or reduce dx");
    if (cells > most_cells)
      config_fail(find_place(document, {"domain", "size"}),
                  "has too many cells (" + figures + "at most " + number_text(most_cells) + ")",
                  "Increase dx or reduce the domain");
  }
}

void check_body(const ConfigDocument& document, const char* list, std::size_t index, const Body& body) {
  if (!(norm(body.rotation_axis) > 0))
    config_fail(body_place(document, list, index, "rotation_axis"), "must not be zero ([0, 0, 0])",
                "Give the direction of the axis, e.g. [0, 1, 0]");
}

void check_source(const ConfigDocument& document, std::size_t index, const Source& source, const Scene& scene) {
  const ConfigPlace shape = body_place(document, "sources", index, "shape");
  if (source.shape == Shape::plane)
    config_fail(shape, "cannot be filled with material (\"plane\" is a half-space)",
                "Use a box, or make it an obstacle");
  if (source.shape == Shape::vdb)
    config_fail(shape, "cannot be filled with material (\"vdb\" is for obstacles only)",
                "Use a mesh or points, or make it an obstacle");
  if (scene.materials.count(source.material)) return;
  std::vector<std::string_view> names;
  std::string list;
  for (const auto& [name, material] : scene.materials) {
    names.push_back(name);
    list += (list.empty() ? "" : ", ") + name;
  }
  const ConfigPlace place = body_place(document, "sources", index, "material");
  config_fail(place, "names no material of the scene (" + place.value() + ", there are: " + list + ")",
              "Use one of them or add it to 'materials'." + did_you_mean(source.material, names));
}

JsonNode& file_node(ConfigDocument& document, const char* list, std::size_t index) {
  return *document.root.find(list)->items[index].find("file");
}

void load_body(ConfigDocument& document, const char* list, std::size_t index, const GeometryFinder& finder,
               Body& body) {
  if (body.shape != Shape::mesh && body.shape != Shape::vdb && body.shape != Shape::points) return;
  const std::string where = body_place(document, list, index, "file").text();
  const std::string given = body.file;
  body.file = finder.find(given);
  if (!fs::is_regular_file(body.file))
    throw InputError(where + " names a file that does not exist (\"" + given + "\", looked for at '" + body.file +
                     "'). " + finder.remedy(given));
  try {
    if (body.shape == Shape::mesh) body.mesh = std::make_shared<const TriangleMesh>(read_mesh(body.file, body.scale));
    if (body.shape == Shape::points)
      body.points = std::make_shared<const std::vector<Vec3d>>(read_points(body.file, body.scale));
  } catch (const InputError& error) {
    throw InputError(where + ": " + error.what());
  }
  file_node(document, list, index).text = body.file;
}

}  // namespace

void check_scene(const ConfigDocument& document, const Scene& scene) {
  check_domain(document, scene.domain);
  if (scene.sources.empty())
    config_fail(find_place(document, {"sources"}), "must not be empty", "Add a source, or there is no material");
  for (std::size_t i = 0; i < scene.sources.size(); ++i) {
    check_body(document, "sources", i, scene.sources[i]);
    check_source(document, i, scene.sources[i], scene);
  }
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    check_body(document, "obstacles", i, scene.obstacles[i]);
    if (scene.obstacles[i].shape == Shape::points)
      config_fail(body_place(document, "obstacles", i, "shape"), "has no surface (\"points\" is for sources only)",
                  "Use a mesh or a vdb level set");
  }
}

void load_geometry(ConfigDocument& document, const GeometryFinder& finder, Scene& scene) {
  for (std::size_t i = 0; i < scene.sources.size(); ++i) load_body(document, "sources", i, finder, scene.sources[i]);
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i)
    load_body(document, "obstacles", i, finder, scene.obstacles[i]);
}

}  // namespace graupel::io
