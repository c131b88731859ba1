// Text of metadata.json for other programs.
#include <algorithm>

#include "io/json_node.h"
#include "io/simulator_metadata.h"

namespace graupel::io {

namespace {

using Splits = std::map<std::string, SplitFigures>;

template <typename Values>
JsonNode list_of(const Values& values) {
  JsonNode list = JsonNode::array();
  for (const auto value : values) list.items.push_back(JsonNode::of(value));
  return list;
}

void add_bounds(JsonNode& out, const SimulatorMetadata& metadata) {
  JsonNode bounds = JsonNode::array();
  for (const auto& pair : metadata.bounds) bounds.items.push_back(list_of(pair));
  out.set("bounds", std::move(bounds));
}

void add_motion(JsonNode& out, const MotionFigures& motion) {
  out.set("vel_mean", list_of(motion.velocity_mean));
  out.set("vel_std", list_of(motion.velocity_std));
  out.set("acc_mean", list_of(motion.acceleration_mean));
  out.set("acc_std", list_of(motion.acceleration_std));
}

/// Keys that only we read, and that others pass over.
void add_own_keys(JsonNode& out, const SimulatorMetadata& metadata, const std::map<int64_t, std::string>& type_names) {
  if (metadata.grid_spacing) out.set("grid_spacing", JsonNode::of(*metadata.grid_spacing));
  if (metadata.gravity) out.set("gravity", list_of(*metadata.gravity));
  JsonNode names = JsonNode::object();
  for (const auto& [id, name] : type_names) names.set(std::to_string(id), JsonNode::of(name));
  out.set("material_names", std::move(names));
}

}  // namespace

std::string gns_metadata_text(const SimulatorMetadata& metadata, const Splits& splits,
                              const std::map<int64_t, std::string>& type_names) {
  int64_t fewest = splits.begin()->second.fewest_frames, most = 0;
  bool property = false;
  for (const auto& [name, split] : splits) {
    fewest = std::min(fewest, split.fewest_frames);
    most = std::max(most, split.most_frames);
    property = property || split.material_property;
  }
  const int64_t dim = metadata.dimensions;
  JsonNode out = JsonNode::object();
  out.set("case", JsonNode::of(metadata.name));
  add_bounds(out, metadata);
  out.set("sequence_length", fewest == most ? JsonNode::of(most) : JsonNode());
  out.set("default_connectivity_radius", JsonNode::of(metadata.connectivity_radius));
  out.set("dim", JsonNode::of(dim));
  out.set("dt", JsonNode::of(metadata.frame_time));
  add_motion(out, metadata.motion);
  // Inputs of a node: 5 velocities, distances to the walls, 16 numbers of the type, the property; of an edge: a vector
  // and its length.
  out.set("nnode_in", JsonNode::of(5 * dim + 2 * dim + 16 + (property ? 1 : 0)));
  out.set("nedge_in", JsonNode::of(dim + 1));
  if (property) out.set("material_feature_len", JsonNode::of(int64_t(1)));
  if (metadata.particle_spacing) out.set("dx", JsonNode::of(*metadata.particle_spacing));
  add_own_keys(out, metadata, type_names);
  return write_json(out, JsonLayout::indented);
}

std::string lagrangebench_metadata_text(const SimulatorMetadata& metadata, const Splits& splits,
                                        const std::map<int64_t, std::string>& type_names) {
  constexpr double radius_in_spacings = 1.45;  // LagrangeBench's own choice
  int64_t most_frames = 0, most_particles = 0;
  for (const auto& [name, split] : splits) {
    most_frames = std::max(most_frames, split.most_frames);
    most_particles = std::max(most_particles, split.most_particles);
  }
  JsonNode out = JsonNode::object();
  out.set("case", JsonNode::of(metadata.name));
  out.set("solver", JsonNode::of("MPM"));
  out.set("dim", JsonNode::of(int64_t(metadata.dimensions)));
  out.set("dx", JsonNode::of(metadata.particle_spacing.value_or(metadata.connectivity_radius / radius_in_spacings)));
  out.set("dt", JsonNode::of(metadata.frame_time));
  out.set("t_end", JsonNode::of(metadata.frame_time * static_cast<double>(most_frames - 1)));
  out.set("write_every", JsonNode::of(int64_t(1)));
  for (const auto& [name, split] : splits) {
    out.set("sequence_length_" + name, JsonNode::of(split.most_frames - 1));
    out.set("num_trajs_" + name, JsonNode::of(split.trajectories));
  }
  out.set("num_particles_max", JsonNode::of(most_particles));
  out.set("periodic_boundary_conditions", list_of(metadata.periodic));
  add_bounds(out, metadata);
  out.set("default_connectivity_radius", JsonNode::of(metadata.connectivity_radius));
  add_motion(out, metadata.motion);
  add_own_keys(out, metadata, type_names);
  return write_json(out, JsonLayout::indented);
}

}  // namespace graupel::io
