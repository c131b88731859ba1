#include "io/graupel_data_set.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "core/error.h"
#include "io/hdf5_dataset.h"
#include "io/json_node.h"
#include "io/motion_moments.h"
#include "io/scene_reader.h"
#include "io/trajectory_layout.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

constexpr const char* property_dataset = "material_property";

struct SceneFacts {
  Scene scene;  ///< without its bodies
  bool obstacles = false;
};

/// Domain, gravity and times of a stored scene. Its bodies are left out: their geometry need not be there any more.
SceneFacts facts_of(const std::string& scene_json, const std::string& where) {
  try {
    JsonNode root = parse_json(scene_json, "scene");
    SceneFacts facts;
    const JsonNode* obstacles = root.find("obstacles");
    facts.obstacles = obstacles && !obstacles->items.empty();
    const JsonNode* materials = root.find("materials");
    if (!materials || materials->members.empty()) throw ConfigError("it has no materials");
    const std::string box = R"({"shape": "box", "size": [1, 1, 1], "position": [0, 0, 0], "material": )" +
                            write_json(JsonNode::of(materials->members.front().key), JsonLayout::compact) + "}";
    for (const char* bodies : {"obstacles", "emitters", "sinks", "kinematic_regions", "sources"})
      root.set(bodies, JsonNode::array());
    root.find("sources")->items.push_back(parse_json(box, "source"));
    facts.scene = parse_scene(write_json(root, JsonLayout::compact), "scene", "");
    return facts;
  } catch (const ConfigError& error) {
    throw InputError(where + " has a damaged scene (" + error.what() + "). Make the data set again");
  }
}

SimulatorMetadata metadata_of(const Scene& scene, double frame_time) {
  SimulatorMetadata out;
  const Domain& domain = scene.domain;
  out.name = scene.name;
  out.dimensions = domain.axes();
  for (int axis = 0; axis < domain.axes(); ++axis) {
    out.bounds.push_back({domain.wall_low()[axis], domain.wall_high()[axis]});
    out.periodic.push_back(period_of(domain)[axis] > 0);
  }
  out.frame_time = frame_time;
  out.grid_spacing = domain.dx;
  out.gravity = {scene.gravity[0], scene.gravity[1], scene.gravity[2]};
  return out;
}

bool same_surroundings(const SimulatorMetadata& a, const SimulatorMetadata& b) {
  return a.dimensions == b.dimensions && a.bounds == b.bounds && a.periodic == b.periodic &&
         a.frame_time == b.frame_time;
}

/// [frames, particles, 3], without its third axis.
std::vector<float> in_plane(const std::vector<float>& position) {
  std::vector<float> out;
  out.reserve(position.size() / 3 * 2);
  for (std::size_t k = 0; k < position.size(); k += 3) out.insert(out.end(), {position[k], position[k + 1]});
  return out;
}

}  // namespace

GraupelSplit::GraupelSplit(const std::string& file, std::optional<SimulatorMetadata>& common)
    : file_(file), reader_(file) {
  std::string last_json;
  SceneFacts facts;
  for (int i = 0; i < reader_.count(); ++i) {
    const std::string where = "'" + file + "': trajectory " + std::to_string(i);
    const Trajectory header = reader_.header(i);
    if (header.scene_json.empty())
      throw InputError(where + " has no scene, which its walls are known from. Use data of 'graupel generate'");
    if (i == 0 || header.scene_json != last_json) facts = facts_of(header.scene_json, where);
    last_json = header.scene_json;
    const SimulatorMetadata found = metadata_of(facts.scene, header.frame_time);
    if (!common) common = found;
    if (!same_surroundings(*common, found))
      throw InputError(where + " has other walls, dimensions or frame times than the first one, and other formats " +
                       "know one for all. Convert them apart");
    with_obstacles_ += facts.obstacles ? 1 : 0;
  }
  dimensions_ = common->dimensions;
}

ParticleSeries GraupelSplit::read(int64_t i) const {
  const int number = static_cast<int>(i);
  const Trajectory header = reader_.header(number);
  ParticleSeries series;
  series.where = "'" + file_ + "': trajectory " + std::to_string(i);
  series.dimensions = dimensions_;
  series.particles = static_cast<int64_t>(header.particle_count());
  series.frames = static_cast<int64_t>(header.frame_count());
  if (header.diverged_at_frame >= 0) series.frames = std::min(series.frames, header.diverged_at_frame);
  if (series.frames == 0) throw InputError(series.where + " has no usable frame. Leave it out");
  if (!reader_.frames(number, 0, 1).front().active.empty())
    throw InputError(series.where + " has particles that come or go, which other formats do not know. Convert scenes " +
                     "without emitters, sinks and open walls");
  series.position = reader_.positions(number, 0, series.frames);
  if (series.dimensions == 2) series.position = in_plane(series.position);
  series.particle_type.assign(header.particle_type.begin(), header.particle_type.end());
  series.material_property = material_property(i, series.particles);
  return series;
}

std::vector<float> GraupelSplit::material_property(int64_t i, int64_t particles) const {
  try {
    const hdf5::Handle file = hdf5::open_file(file_);
    const hdf5::Handle group(H5Gopen2(file, trajectory_group(i).c_str(), H5P_DEFAULT), H5Gclose, "cannot open a group");
    if (!hdf5::has_member(group, property_dataset)) return {};
    const auto dataset = hdf5::open_dataset(group, property_dataset, 2, hdf5::NumberKind::real, fs::file_size(file_));
    if (dataset.size != std::vector<hsize_t>{static_cast<hsize_t>(particles), 1})
      throw hdf5::Failure("'material_property' and 'position' have different numbers of particles");
    std::vector<float> values(static_cast<std::size_t>(particles));
    dataset.read_rows(0, dataset.size[0], hdf5::Element::float32, values.data());
    return values;
  } catch (const hdf5::Failure& failure) {
    throw InputError("cannot read '" + file_ + "' (" + failure.what() + "). Make it again or choose another");
  }
}

namespace {

std::vector<Vec3f> frame_positions(const ParticleSeries& series, int64_t frame, float plane) {
  const auto n = static_cast<std::size_t>(series.particles), axes = static_cast<std::size_t>(series.dimensions);
  const float* from = series.position.data() + static_cast<std::size_t>(frame) * n * axes;
  std::vector<Vec3f> out(n);
  for (std::size_t p = 0; p < n; ++p) {
    out[p] = {from[p * axes], from[p * axes + 1], plane};
    if (axes == 3) out[p][2] = from[p * axes + 2];
  }
  return out;
}

void write_trajectory(const std::string& file, const ParticleSeries& series, const OwnTrajectory& own) {
  Trajectory header;
  header.particle_type.assign(series.particle_type.begin(), series.particle_type.end());
  header.frame_time = own.scene.frame_time;
  header.scene_json = scene_to_json(own.scene);
  header.made_by = own.made_by;
  TrajectoryWriter writer(file, header, {.velocity = false});
  const auto plane = static_cast<float>(own.scene.domain.plane());
  const Vec3d period = period_of(own.scene.domain);
  for (int64_t t = 0; t < series.frames; ++t) {
    ParticleFrame frame;
    frame.time = static_cast<double>(t) * own.scene.frame_time;
    frame.position = frame_positions(series, t, plane);
    if (t == 0 && series.frames > 1) {
      const std::vector<Vec3f> next = frame_positions(series, 1, plane);
      for (std::size_t p = 0; p < next.size(); ++p)
        frame.velocity.push_back(
            (displacement(frame.position[p], next[p], period) * (1 / own.scene.frame_time)).cast<float>());
    }
    writer.append(frame);
  }
  if (!series.material_property.empty())
    writer.table({.name = property_dataset,
                  .units = "",
                  .description = "Material property of each particle, as GNS stores it",
                  .columns = 1,
                  .values = series.material_property});
  writer.finish();
}

}  // namespace

void write_graupel_split(const std::string& file, int64_t count, const SeriesSource& source,
                         const std::function<OwnTrajectory(const ParticleSeries&)>& describe) {
  std::vector<std::string> parts;
  for (int64_t i = 0; i < count; ++i) {
    const ParticleSeries series = source(i);
    parts.push_back(file + "." + trajectory_group(i));
    write_trajectory(parts.back(), series, describe(series));
  }
  merge_trajectories(parts, file);
  for (const std::string& part : parts) std::remove(part.c_str());
}

}  // namespace graupel::io
