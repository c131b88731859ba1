// Scenes: from files and dicts, with particles and meshes from arrays.
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <filesystem>

#include "library/io.h"
#include "library/particle_state.h"
#include "library/python/arrays.h"
#include "library/python/files.h"

namespace graupel::python {

namespace {

using Numbers = Array<double>;

/// [n, 3], and of scenes with two dimensions also [n, 2].
std::vector<Vec3d> vectors_of(const char* name, nb::handle values, bool plane = false) {
  std::vector<Vec3d> vectors;
  if (values.is_none()) return vectors;
  const Numbers array = array_from<double>(name, values);
  const bool flat = plane && array.ndim() == 2 && array.shape(1) == 2;
  if (!flat) check_shape(name, array, {3}, plane ? "[particles, 2] or [particles, 3]" : "[n, 3]");
  const std::size_t width = flat ? 2 : 3;
  vectors.assign(array.shape(0), Vec3d::zero());
  for (std::size_t i = 0; i < vectors.size(); ++i)
    for (std::size_t d = 0; d < width; ++d) vectors[i][static_cast<int>(d)] = array.data()[width * i + d];
  return vectors;
}

std::vector<Mat3d> matrices_of(const char* name, nb::handle values) {
  std::vector<Mat3d> matrices;
  if (values.is_none()) return matrices;
  const Numbers array = array_from<double>(name, values);
  check_shape(name, array, {3, 3}, "[particles, 3, 3]");
  matrices.resize(array.shape(0));
  for (std::size_t i = 0; i < matrices.size(); ++i)
    for (int k = 0; k < 9; ++k) matrices[i](k / 3, k % 3) = array.data()[9 * i + static_cast<std::size_t>(k)];
  return matrices;
}

std::vector<double> numbers_of(const char* name, nb::handle values) {
  if (values.is_none()) return {};
  const Numbers array = array_from<double>(name, values);
  check_shape(name, array, {}, "[particles]");
  return {array.data(), array.data() + array.shape(0)};
}

std::vector<std::string> names_of(const Scene& scene) {
  std::vector<std::string> names;
  for (const auto& [name, material] : scene.materials) names.push_back(name);
  return names;
}

/// One name, a name a particle, or numbers into Scene.materials; without any the scene's only material.
std::vector<std::string> materials_of(const Scene& scene, nb::handle materials) {
  const std::vector<std::string> known = names_of(scene);
  if (materials.is_none()) {
    if (known.size() == 1) return known;
    throw ConfigError("the scene has " + std::to_string(known.size()) +
                      " materials (allowed without materials=: 1). Name those of the particles");
  }
  if (nb::isinstance<nb::str>(materials)) return {nb::cast<std::string>(materials)};
  std::vector<std::string> names;
  if (nb::try_cast(materials, names)) return names;
  const auto indices = array_from<int64_t>("materials", materials);
  check_shape("materials", indices, {}, "[particles]");
  for (std::size_t i = 0; i < indices.shape(0); ++i) {
    const int64_t index = indices.data()[i];
    if (index < 0 || index >= static_cast<int64_t>(known.size()))
      throw ConfigError("materials[" + std::to_string(i) + "] = " + std::to_string(index) +
                        " is not in the scene (allowed: 0 to " + std::to_string(known.size() - 1) +
                        ", places in Scene.materials). Correct it");
    names.push_back(known[static_cast<std::size_t>(index)]);
  }
  return names;
}

PyScene with_arrays(const PyScene& scene, nb::object positions, nb::object materials, nb::object velocities,
                    nb::object deformation_gradients, nb::object affine_velocities, nb::object plastic,
                    nb::object volumes) {
  const bool plane = scene.domain.is_plane();
  ParticleState state;
  state.position = vectors_of("positions", positions, plane);
  state.velocity = vectors_of("velocities", velocities, plane);
  state.deformation_gradient = matrices_of("deformation_gradients", deformation_gradients);
  state.affine_velocity = matrices_of("affine_velocities", affine_velocities);
  state.plastic = numbers_of("plastic", plastic);
  state.volume = numbers_of("volumes", volumes);
  state.material = materials_of(scene, materials);
  return {with_particles(scene, std::move(state)), scene.file};
}

/// An obstacle of triangles in memory.
PyScene with_mesh(const PyScene& scene, nb::object vertices, nb::object corner_numbers,
                  const std::array<double, 3>& position, const std::string& contact, double friction) {
  const auto triangles = array_from<int64_t>("triangles", corner_numbers);
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->vertices = vectors_of("vertices", vertices);
  for (std::size_t i = 0; i < mesh->vertices.size(); ++i)
    for (int d = 0; d < 3; ++d)
      if (!std::isfinite(mesh->vertices[i][d]))
        throw ConfigError("vertices[" + std::to_string(i) + "] is not finite. Correct the mesh");
  check_shape("triangles", triangles, {3}, "[triangles, 3]");
  for (std::size_t t = 0; t < triangles.shape(0); ++t) {
    std::array<int32_t, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const int64_t corner = triangles.data()[3 * t + k];
      if (corner < 0 || corner >= static_cast<int64_t>(mesh->vertices.size()))
        throw ConfigError("triangles[" + std::to_string(t) + "] names the vertex " + std::to_string(corner) +
                          " (allowed: 0 to " + std::to_string(mesh->vertices.size()) + " - 1). Correct the mesh");
      corners[k] = static_cast<int32_t>(corner);
    }
    mesh->triangles.push_back(corners);
  }
  Obstacle obstacle;
  obstacle.shape = Shape::mesh;
  obstacle.mesh = mesh;
  obstacle.position = {position[0], position[1], position[2]};
  obstacle.friction = friction;
  bool known = false;
  for (const auto& [word, value] : EnumWords<Contact>::words)
    if (contact == word) obstacle.contact = value, known = true;
  if (!known)
    throw ConfigError("contact is not known ('" + contact + "', allowed: stick, slip, separate). Choose one of these");
  if (!(friction >= 0 && std::isfinite(friction)))
    throw ConfigError("friction is not possible (" + std::to_string(friction) +
                      ", allowed: 0 or more, finite). Correct it");
  for (const double x : position)
    if (!std::isfinite(x)) throw ConfigError("position is not finite (" + std::to_string(x) + "). Correct it");
  PyScene with = scene;
  with.obstacles.push_back(obstacle);
  return with;
}

nb::tuple tuple_of(const Vec3d& v) { return nb::make_tuple(v[0], v[1], v[2]); }

nb::module_ plain() { return nb::module_::import_("graupel._plain"); }

std::vector<std::string> changes_of(nb::handle changes) {
  return nb::cast<std::vector<std::string>>(plain().attr("change_words")(changes));
}

PyScene scene_from_file(nb::object path, nb::object changes) {
  const std::string file = path_of(path);
  const std::vector<std::string> words = changes_of(changes);
  const WithoutGil others_run;
  return {io::read_scene(file, words), std::filesystem::absolute(file).string()};
}

PyScene scene_from_dict(nb::handle keys, nb::object folder, nb::object changes) {
  const auto text = nb::cast<std::string>(plain().attr("json_text")(keys));
  const std::string place = path_of(folder);
  const std::vector<std::string> words = changes_of(changes);
  const WithoutGil others_run;
  return {io::parse_scene(text, "scene", place, words), ""};
}

}  // namespace

void bind_scene(nb::module_& module) {
  using namespace nb::literals;
  nb::class_<PyScene>(
      module, "Scene",
      "A checked scene: domain, materials, sources, obstacles, time step. It never changes.\n\n"
      "docs/reference/scene_format.md lists the keys. Made by from_file(), from_dict() or SceneBuilder.")
      .def_static("from_file", &scene_from_file, "path"_a, "changes"_a = nb::none(),
                  nb::sig("def from_file(path: str | os.PathLike, changes: dict | None = None) -> Scene"),
                  "Reads a scene file. changes: {'domain.dx': 0.02} sets keys before the checks.\n\n"
                  "Raises ConfigError for a scene that is not possible, InputError for a file that is missing or "
                  "damaged.")
      .def_static("from_dict", &scene_from_dict, "keys"_a, "folder"_a = ".", "changes"_a = nb::none(),
                  nb::sig("def from_dict(keys: dict, folder: str | os.PathLike = '.', changes: dict | None = None) -> "
                          "Scene"),
                  "Checks a dict with the keys of a scene file. Relative paths of meshes start at folder.")
      .def(
          "to_dict",
          [](const PyScene& scene) { return nb::module_::import_("json").attr("loads")(io::scene_to_json(scene)); },
          nb::sig("def to_dict(self) -> dict"),
          "Every key with its value, defaults included. Arrays of with_particles() and with_mesh() are not in it.")
      .def(
          "with_particles", &with_arrays, "positions"_a, nb::kw_only(), "materials"_a = nb::none(),
          "velocities"_a = nb::none(), "deformation_gradients"_a = nb::none(), "affine_velocities"_a = nb::none(),
          "plastic"_a = nb::none(), "volumes"_a = nb::none(),
          nb::sig("def with_particles(self, positions: ArrayLike, *, materials: str | Sequence[str] | ArrayLike | None "
                  "= None, velocities: ArrayLike | None = None, deformation_gradients: ArrayLike | None = None, "
                  "affine_velocities: ArrayLike | None = None, plastic: ArrayLike | None = None, volumes: ArrayLike | "
                  "None = None) -> Scene"),
          "The scene with these particles in place of its sources, in their order.\n\n"
          "positions [n, 3] m (of two dimensions also [n, 2]), velocities like them, m/s, default at rest.\n"
          "deformation_gradients [n, 3, 3], the elastic part; affine_velocities [n, 3, 3] 1/s; plastic [n], the\n"
          "field of that name; volumes [n] m^3, default that of a cell / 8.\n"
          "materials: a name, a name a particle, or places in Scene.materials [n].\n"
          "Raises ConfigError with the number, value and allowed range of the first bad particle: not finite, out of\n"
          "the walls, det F <= 0, volume <= 0, unknown material, or an array of another length.")
      .def("with_mesh", &with_mesh, "vertices"_a, "triangles"_a, nb::kw_only(),
           "position"_a = std::array<double, 3>{0, 0, 0}, "contact"_a = "separate", "friction"_a = 0.0,
           nb::sig("def with_mesh(self, vertices: ArrayLike, triangles: ArrayLike, *, position: tuple[float, float, "
                   "float] = (0, 0, 0), contact: str = 'separate', friction: float = 0.0) -> Scene"),
           "The scene with an obstacle of triangles in memory.\n\n"
           "vertices [n, 3] m, triangles [m, 3] numbers of vertices, counter-clockwise seen from outside, closed.\n"
           "contact: 'separate', 'slip' or 'stick'; friction: Coulomb's coefficient. Files: key 'obstacles' of a dict.")
      .def_prop_ro("name", [](const PyScene& scene) { return scene.name; })
      .def_prop_ro(
          "frames", [](const PyScene& scene) { return scene.frames; }, "Frames after the first.")
      .def_prop_ro(
          "frame_time", [](const PyScene& scene) { return scene.frame_time; }, "Time between frames [s].")
      .def_prop_ro(
          "dx", [](const PyScene& scene) { return scene.domain.dx; }, "Grid spacing [m].")
      .def_prop_ro(
          "dimensions", [](const PyScene& scene) { return scene.domain.dimensions; }, "2 or 3.")
      .def_prop_ro(
          "seed", [](const PyScene& scene) { return scene.seed; }, "Of the particle sampling.")
      .def_prop_ro(
          "origin", [](const PyScene& scene) { return tuple_of(scene.domain.origin); },
          "Lower corner of the domain [m].")
      .def_prop_ro(
          "size", [](const PyScene& scene) { return tuple_of(scene.domain.size); }, "Edges of the domain [m].")
      .def_prop_ro(
          "gravity", [](const PyScene& scene) { return tuple_of(scene.gravity); }, "[m/s^2].")
      .def_prop_ro(
          "wall_low", [](const PyScene& scene) { return tuple_of(scene.wall_low()); },
          "Lower corner of the box that holds the material [m].")
      .def_prop_ro(
          "wall_high", [](const PyScene& scene) { return tuple_of(scene.wall_high()); },
          "Upper corner of the box that holds the material [m].")
      .def_prop_ro(
          "materials", [](const PyScene& scene) { return names_of(scene); }, "Names of the materials, sorted.")
      .def("__repr__", [](const PyScene& scene) {
        return "<graupel.Scene '" + scene.name + "': " + std::to_string(scene.sources.size()) + " sources, " +
               std::to_string(scene.obstacles.size()) + " obstacles, " + std::to_string(scene.frames) + " frames>";
      });
}

}  // namespace graupel::python
