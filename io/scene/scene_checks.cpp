// Checks between the keys of a scene, and loading of the geometry it names.
#include "io/scene/scene_checks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/scene/checks/plane_check.h"
#include "core/system/error.h"
#include "io/config/config_values.h"
#include "io/mesh/mesh_file.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

constexpr double fewest_cells = 16;             // per edge, inside the walls
constexpr double most_cells = double(1 << 21);  // per edge: cell indices are packed into 21 bits an axis

ConfigPlace body_place(const ConfigDocument& document, const char* list, std::size_t index, const char* key) {
  return find_place(document, {list, std::to_string(index), key});
}

const char* face_name(int axis, int side) {
  constexpr const char* names[] = {"x_low", "x_high", "y_low", "y_high", "z_low", "z_high"};
  return names[2 * axis + side];
}

void check_faces(const ConfigDocument& document, const Domain& domain) {
  for (int axis = 0; axis < domain.axes(); ++axis) {
    const bool low = domain.wall(axis, 0) == Wall::periodic, high = domain.wall(axis, 1) == Wall::periodic;
    if (!low && !high) continue;
    const ConfigPlace place = find_place(document, {"domain", "faces", face_name(axis, low ? 0 : 1), "kind"});
    if (low != high)
      config_fail(place,
                  "has no partner (\"periodic\", but " + std::string(face_name(axis, low ? 1 : 0)) + " is \"" +
                      word_of(domain.wall(axis, low ? 1 : 0)) + "\")",
                  "Make both walls of an axis periodic, or neither");
    const double cells = (domain.wall_high()[axis] - domain.wall_low()[axis]) / domain.dx;
    if (std::abs(cells - std::round(cells)) > 1e-6)
      config_fail(place, "needs a whole number of cells between the walls (" + number_text(cells) + ")",
                  "Change the size of the domain along this axis, or dx");
  }
}

template <typename Key>
void check_key_times(const ConfigPlace& place, const std::vector<Key>& keys) {
  for (std::size_t k = 1; k < keys.size(); ++k)
    if (!(keys[k].time > keys[k - 1].time))
      config_fail(place,
                  "has keyframes out of order (key " + std::to_string(k) + " at " + number_text(keys[k].time) +
                      " s, above " + number_text(keys[k - 1].time) + " s)",
                  "Sort them by time, no two at the same");
}

/// Squares of lengths outside this range are no numbers.
constexpr double shortest = 1e-100, longest = 1e100;

/// Throws where a direction or a force is zero, or has no square; the message begins with `what`.
void check_length(const ConfigPlace& place, const char* what, const Vec3d& vector, const char* remedy) {
  const double length = std::hypot(vector[0], vector[1], vector[2]);
  if (length == 0) config_fail(place, std::string(what) + "must not be zero ([0, 0, 0])", remedy);
  if (length >= shortest && length <= longest) return;
  config_fail(place,
              std::string(what) + "is too " + (length < shortest ? "short" : "long") + " ([" + number_text(vector[0]) +
                  ", " + number_text(vector[1]) + ", " + number_text(vector[2]) +
                  "], allowed lengths: " + number_text(shortest) + " to " + number_text(longest) + ")",
              remedy);
}

void check_motion(const ConfigPlace& place, const Motion& motion) {
  check_length(place, "has an axis that ", motion.axis, "Give the direction of the axis, e.g. [0, 1, 0]");
  if (motion.end_time && !(*motion.end_time > motion.start_time))
    config_fail(place,
                "ends before it starts (end_time " + number_text(*motion.end_time) + " s, above start_time " +
                    number_text(motion.start_time) + " s)",
                "Raise end_time");
  if (motion.kind == MotionKind::keyframes && motion.keyframes.empty())
    config_fail(place, "has no poses (\"keyframes\": [], at least 1)", "Add a keyframe");
  check_key_times(place, motion.keyframes);
}

void check_region(const ConfigDocument& document, const char* list, std::size_t index, const Region& region) {
  if (region.shape == RegionShape::half_space)
    check_length(body_place(document, list, index, "normal"), "", region.normal,
                 "Give the direction out of the half-space, e.g. [0, 1, 0]");
}

void check_body(const ConfigDocument& document, const char* list, std::size_t index, const Body& body) {
  check_length(body_place(document, list, index, "rotation_axis"), "", body.rotation_axis,
               "Give the direction of the axis, e.g. [0, 1, 0]");
}

void check_material_name(const ConfigPlace& place, const std::string& material, const std::vector<std::string>& names) {
  std::string known;
  for (const std::string& name : names) {
    if (name == material) return;
    known += (known.empty() ? "" : ", ") + name;
  }
  config_fail(place, "names no material of the scene (" + place.value() + ", there are: " + known + ")",
              "Use one of them or add it to 'materials'." + did_you_mean(material, {names.begin(), names.end()}));
}

/// What sources and emitters have in common.
void check_filled(const ConfigDocument& document, const char* list, std::size_t index, const Body& source,
                  const std::string& material, const Scene& scene) {
  const ConfigPlace shape = body_place(document, list, index, "shape");
  if (source.shape == Shape::plane)
    config_fail(shape, "cannot be filled with material (\"plane\" is a half-space)",
                "Use a box, or make it an obstacle");
  if (source.shape == Shape::vdb)
    config_fail(shape, "cannot be filled with material (\"vdb\" is for obstacles only)",
                "Use a mesh or points, or make it an obstacle");
  std::vector<std::string> names;
  for (const auto& [name, config] : scene.materials) names.push_back(name);
  check_material_name(body_place(document, list, index, "material"), material, names);
}

void check_source(const ConfigDocument& document, std::size_t index, const Scene& scene) {
  const Source& source = scene.sources[index];
  check_body(document, "sources", index, source);
  check_filled(document, "sources", index, source, source.material, scene);
  if (source.motion) check_motion(body_place(document, "sources", index, "motion"), *source.motion);
  if (source.release_time && !source.motion)
    config_fail(body_place(document, "sources", index, "release_time"),
                "has no effect without 'motion' (" + number_text(*source.release_time) + " s)",
                "Add \"motion\": {}, which holds the body until then, or leave it out");
}

void check_emitter(const ConfigDocument& document, std::size_t index, const Scene& scene) {
  const Emitter& emitter = scene.emitters[index];
  check_body(document, "emitters", index, emitter);
  check_filled(document, "emitters", index, emitter, emitter.material, scene);
  if (emitter.shape == Shape::points)
    config_fail(body_place(document, "emitters", index, "shape"), "has no volume (\"points\" is for sources only)",
                "Use a box, another body or a mesh");
  if (emitter.emission == Emission::burst) {
    const ConfigPlace times = body_place(document, "emitters", index, "times");
    if (emitter.times.empty()) config_fail(times, "must not be empty", "Give the time of a burst");
    for (std::size_t k = 1; k < emitter.times.size(); ++k)
      if (!(emitter.times[k] > emitter.times[k - 1]))
        config_fail(
            times,
            "must ascend (" + number_text(emitter.times[k]) + " s after " + number_text(emitter.times[k - 1]) + " s)",
            "Sort the times, no two the same");
    return;
  }
  check_length(body_place(document, "emitters", index, "emission"), "needs a velocity (\"stream\"), which ",
               emitter.velocity, "Give the emitter a velocity, or use bursts");
  if (!(emitter.end_time > emitter.start_time))
    config_fail(body_place(document, "emitters", index, "end_time"),
                "must be above start_time (" + number_text(emitter.end_time) + " s, start_time " +
                    number_text(emitter.start_time) + " s)",
                "Raise end_time");
}

void check_load(const ConfigDocument& document, std::size_t index, const Scene& scene) {
  const TimedLoad& load = scene.loads[index];
  check_length(body_place(document, "loads", index, "force"), "", load.force,
               "Give the force on all that is in the ball [N]");
  const double end = static_cast<double>(scene.frames) * scene.frame_time;
  if (!(load.start < end))
    config_fail(body_place(document, "loads", index, "start"),
                "is not within the run (" + number_text(load.start) + " s, which ends at " + number_text(end) + " s)",
                "Start the load earlier, or give the scene more frames");
  Vec3d nearest = load.place;
  for (int d = 0; d < scene.domain.axes(); ++d)
    nearest[d] = std::clamp(nearest[d], scene.wall_low()[d], scene.wall_high()[d]);
  if (norm(nearest - load.place) > load.radius)
    config_fail(body_place(document, "loads", index, "place"),
                "lies outside the walls (" + number_text(norm(nearest - load.place)) + " m away, radius " +
                    number_text(load.radius) + " m)",
                "Move it to the material");
}

void check_obstacle(const ConfigDocument& document, std::size_t index, const Obstacle& obstacle) {
  check_body(document, "obstacles", index, obstacle);
  if (obstacle.shape == Shape::points)
    config_fail(body_place(document, "obstacles", index, "shape"), "has no surface (\"points\" is for sources only)",
                "Use a mesh or a vdb level set");
  if (obstacle.motion) check_motion(body_place(document, "obstacles", index, "motion"), *obstacle.motion);
}

void check_steps(const ConfigDocument& document, const Scene& scene) {
  if (scene.sources.empty() && scene.emitters.empty())
    config_fail(find_place(document, {"sources"}), "must not be empty", "Add a source, or there is no material");
  if (scene.time_step.min_step > scene.time_step.max_step)
    config_fail(find_place(document, {"time_step", "min_step"}),
                "must not be above max_step (" + number_text(scene.time_step.min_step) + " s, max_step " +
                    number_text(scene.time_step.max_step) + " s)",
                "Lower min_step or raise max_step");
}

JsonNode& file_node(ConfigDocument& document, const char* list, std::size_t index) {
  return *document.root.find(list)->items[index].find("file");
}

void load_body(ConfigDocument& document, const char* list, std::size_t index, const GeometryFinder& finder,
               Body& body) {
  if (body.shape != Shape::mesh && body.shape != Shape::vdb && body.shape != Shape::points) return;
  const std::string where = body_place(document, list, index, "file").text();
  const std::string given = body.file;
  if (given.empty())
    throw InputError(where +
                     " is empty (\"\"). Name a file: particles and meshes that a program gave in memory are not "
                     "stored with its scene");
  body.file = finder.find(given);
  std::error_code code;
  const fs::file_status status = fs::status(body.file, code);
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw InputError(where + " names a folder or device (\"" + given + "\", at '" + body.file + "'). Name a file");
  if (!fs::is_regular_file(status))
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

void check_grid(const ConfigPlace& place, const Domain& domain) {
  for (int axis = 0; axis < domain.axes(); ++axis) {
    const double cells = domain.size[axis] / domain.dx;
    const double needed = fewest_cells + 2 * static_cast<double>(domain.wall_cells);
    const std::string figures = number_text(cells) + " cells along " + std::string(1, "xyz"[axis]) + ", ";
    if (cells < needed * (1 - 1e-9))
      config_fail(place,
                  "is too small for its grid (" + figures + "at least " + number_text(needed) + ": 16 and the walls)",
                  "Enlarge the domain or reduce dx");
    if (cells > most_cells)
      config_fail(place, "has too many cells (" + figures + "at most " + number_text(most_cells) + ")",
                  "Increase dx or reduce the domain");
  }
}

void check_scene(const ConfigDocument& document, const Scene& scene) {
  const auto check = [&](const auto& part) { document.attempt(part); };
  check([&] { check_grid(find_place(document, {"domain", "size"}), scene.domain); });
  check([&] { check_faces(document, scene.domain); });
  check([&] {
    if (const auto out = first_out_of_plane(scene))
      config_fail(find_place(document, out->path), out->problem, out->remedy);
  });
  check([&] { check_steps(document, scene); });
  for (std::size_t i = 0; i < scene.sources.size(); ++i) check([&] { check_source(document, i, scene); });
  for (std::size_t i = 0; i < scene.emitters.size(); ++i) check([&] { check_emitter(document, i, scene); });
  for (std::size_t i = 0; i < scene.kinematic_regions.size(); ++i)
    check([&] {
      check_region(document, "kinematic_regions", i, scene.kinematic_regions[i]);
      check_motion(body_place(document, "kinematic_regions", i, "motion"), scene.kinematic_regions[i].motion);
    });
  check([&] { check_key_times(find_place(document, {"gravity_keyframes"}), scene.gravity_keyframes); });
  for (std::size_t i = 0; i < scene.loads.size(); ++i) check([&] { check_load(document, i, scene); });
  for (std::size_t i = 0; i < scene.sinks.size(); ++i)
    check([&] { check_region(document, "sinks", i, scene.sinks[i]); });
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i)
    check([&] { check_obstacle(document, i, scene.obstacles[i]); });
}

void load_geometry(ConfigDocument& document, const GeometryFinder& finder, Scene& scene) {
  const auto load = [&](const char* list, auto& bodies) {
    for (std::size_t i = 0; i < bodies.size(); ++i)
      document.attempt([&] { load_body(document, list, i, finder, bodies[i]); });
  };
  load("sources", scene.sources);
  load("emitters", scene.emitters);
  load("obstacles", scene.obstacles);
}

void check_named(ConfigDocument& document, const GeometryFinder& finder, Scene& scene) {
  const auto is_text = [](const JsonNode* node) { return node != nullptr && node->kind == JsonNode::Kind::string; };
  std::vector<std::string> names;
  const JsonNode* const materials = document.root.find("materials");
  const bool any_materials = materials != nullptr && materials->kind == JsonNode::Kind::object;
  if (any_materials)
    for (const JsonMember& material : materials->members) names.push_back(material.key);
  const auto check = [&](const char* list, auto& bodies) {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const JsonNode& item = document.root.find(list)->items[i];
      if (const JsonNode* material = item.find("material"); any_materials && is_text(material))
        document.attempt(
            [&] { check_material_name(body_place(document, list, i, "material"), material->text, names); });
      if (is_text(item.find("file"))) document.attempt([&] { load_body(document, list, i, finder, bodies[i]); });
    }
  };
  check("sources", scene.sources);
  check("emitters", scene.emitters);
  check("obstacles", scene.obstacles);
}

}  // namespace graupel::io
