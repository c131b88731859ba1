#include "io/converted_scene.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/error.h"
#include "io/motion_moments.h"
#include "io/scene_reader.h"

namespace graupel::io {

namespace {

constexpr double radius_in_cells = 2.24;
constexpr double fewest_cells = 16;  // along an edge, as scenes need

/// Grid spacing that fits the walls: at least 16 cells between them, whole ones between periodic walls.
double grid_spacing(const SimulatorMetadata& metadata) {
  double shortest = metadata.bounds[0][1] - metadata.bounds[0][0], shortest_periodic = 0;
  for (std::size_t axis = 0; axis < metadata.bounds.size(); ++axis) {
    const double extent = metadata.bounds[axis][1] - metadata.bounds[axis][0];
    shortest = std::min(shortest, extent);
    if (metadata.periodic[axis])
      shortest_periodic = shortest_periodic > 0 ? std::min(shortest_periodic, extent) : extent;
  }
  if (metadata.grid_spacing) return *metadata.grid_spacing;
  const double wished = std::min(metadata.connectivity_radius / radius_in_cells, shortest / fewest_cells);
  return shortest_periodic > 0 ? shortest_periodic / std::ceil(shortest_periodic / wished - 1e-9) : wished;
}

void set_walls(const SimulatorMetadata& metadata, Domain& domain) {
  domain.dimensions = metadata.dimensions;
  domain.dx = grid_spacing(metadata);
  const double margin = static_cast<double>(domain.wall_cells) * domain.dx;
  for (int axis = 0; axis < metadata.dimensions; ++axis) {
    const auto& [low, high] = metadata.bounds[static_cast<std::size_t>(axis)];
    domain.origin[axis] = low - margin;
    domain.size[axis] = high - low + 2 * margin;
  }
  std::optional<WallConfig>* faces[] = {&domain.faces.x_low,  &domain.faces.x_high, &domain.faces.y_low,
                                        &domain.faces.y_high, &domain.faces.z_low,  &domain.faces.z_high};
  for (std::size_t face = 0; face < 2 * metadata.periodic.size(); ++face)
    if (metadata.periodic[face / 2]) *faces[face] = WallConfig{.kind = Wall::periodic, .friction = {}};
}

struct Box {
  Vec3d low, high;
  double particles = 0;
  void add(const Vec3d& x) {
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = particles > 0 ? std::min(low[axis], x[axis]) : x[axis];
      high[axis] = particles > 0 ? std::max(high[axis], x[axis]) : x[axis];
    }
    ++particles;
  }
};

/// Where the particles of each type are in the first frame.
std::map<int32_t, Box> boxes_of(const ParticleSeries& series, double plane) {
  std::map<int32_t, Box> boxes;
  const auto axes = static_cast<std::size_t>(series.dimensions);
  for (std::size_t p = 0; p < series.particle_type.size(); ++p) {
    Vec3d x = {0, 0, plane};
    for (std::size_t axis = 0; axis < axes; ++axis)
      x[static_cast<int>(axis)] = double(series.position[p * axes + axis]);
    boxes[static_cast<int32_t>(series.particle_type[p])].add(x);
  }
  return boxes;
}

Source source_of(const std::string& material, const Box& box, const Domain& domain) {
  Source source;
  source.material = material;
  source.position = (box.low + box.high) * 0.5;
  double cells = 1;
  for (int axis = 0; axis < 3; ++axis) {
    source.size[axis] = std::max(box.high[axis] - box.low[axis], domain.dx);
    if (axis < domain.axes()) cells *= source.size[axis] / domain.dx;
  }
  source.particles_per_cell = std::clamp(box.particles / cells, 1e-3, 1000.0);
  return source;
}

}  // namespace

Scene converted_scene(const SimulatorMetadata& metadata, DataSetFormat format, const ParticleSeries& series,
                      const std::vector<std::string>& overrides) {
  Scene scene;
  scene.name = metadata.name;
  scene.description = std::string("Converted from ") + word_of(format) +
                      ": obstacles are particles, if any; sources are the bounding boxes of the particles";
  set_walls(metadata, scene.domain);
  const auto gravity = metadata.gravity.value_or(std::array<double, 3>{0, 0, 0});
  scene.gravity = {gravity[0], gravity[1], gravity[2]};
  scene.frames = series.frames - 1;
  scene.frame_time = metadata.frame_time;
  const auto boxes = boxes_of(series, scene.domain.plane());
  for (const auto& [name, model] : EnumWords<MaterialModel>::words) {
    const auto found = boxes.find(particle_type_of(model));
    if (found == boxes.end()) continue;
    MaterialConfig& material = scene.materials[name];
    material.name = name;
    material.model = model;
    scene.sources.push_back(source_of(material.name, found->second, scene.domain));
  }
  if (scene.sources.empty())
    throw InputError(series.where + " has obstacle particles alone, no material. Leave it out");
  return parse_scene(scene_to_json(scene), "the scene of " + series.where, "", overrides);
}

}  // namespace graupel::io
