#include "experiments/viewer/page_data.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "compare/metrics/particle_run.h"
#include "compare/pictures/raster.h"
#include "core/scene/material_config.h"
#include "experiments/viewer/body_mesh.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::ordered_json;

template <typename T>
Json list_of(const Vec<T, 3>& v) {
  return {v[0], v[1], v[2]};
}

uint8_t byte_of(int32_t type) { return static_cast<uint8_t>(std::clamp(type, 0, 255)); }

Json materials_of(const RunFacts& facts) {
  std::map<int32_t, std::size_t> count;
  for (const int32_t type : facts.particle_type) ++count[byte_of(type)];
  Json materials = Json::array();
  for (const auto& [type, particles] : count) {
    const compare::Color color = compare::color_of_type(type);
    materials.push_back({{"type", type},
                         {"name", particle_type_name(type)},
                         {"particles", particles},
                         {"color", {color[0], color[1], color[2]}}});
  }
  return materials;
}

/// Edges along which the run is periodic [m], 0 along the others.
Json period_of(const RunFacts& facts) {
  Vec3d period = Vec3d::zero();
  if (facts.scene)
    for (int d = 0; d < facts.scene->domain.axes(); ++d)
      if (facts.scene->domain.wall(d, 0) == Wall::periodic)
        period[d] = facts.scene->wall_high()[d] - facts.scene->wall_low()[d];
  return list_of(period);
}

/// Unit vector against gravity; y without a scene.
Json up_of(const RunFacts& facts) {
  Vec3d up = {0, 1, 0};
  if (facts.scene && facts.dimensions == 3) {
    const int axis = compare::vertical_axis(facts.scene->gravity);
    up = Vec3d::zero();
    up[axis] = facts.scene->gravity[axis] > 0 ? -1 : 1;
  }
  return list_of(up);
}

Json side_facts(const RunFacts& facts) {
  return {{"name", facts.name},
          {"made_by", facts.made_by},
          {"note", facts.note},
          {"live", facts.live},
          {"run", facts.run},
          {"particles", facts.particle_type.size()},
          {"dimensions", facts.dimensions},
          {"times", facts.times},
          {"low", list_of(facts.box.low)},
          {"high", list_of(facts.box.high)},
          {"has_scene", facts.scene.has_value()},
          {"up", up_of(facts)},
          {"period", period_of(facts)},
          {"plane", facts.scene && facts.dimensions == 2 ? Json(facts.scene->domain.plane()) : Json(nullptr)},
          {"radius", compare::sphere_radius(std::pow(facts.spacing, 3))},
          {"materials", materials_of(facts)},
          {"moving_obstacles", facts.moving_obstacles()},
          {"record_bytes", facts.record_bytes()}};
}

template <typename T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Names of files may hold bytes that are no UTF-8.
std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

std::string facts_json(const Sources& sides) {
  Json all = Json::array();
  for (const auto& source : sides) all.push_back(side_facts(source->facts()));
  return text_of({{"sides", all}});
}

std::string status_json(const Sources& sides) {
  Json all = Json::array();
  for (const auto& source : sides) {
    const RunStatus status = source->status();
    all.push_back({{"run", source->facts().run},
                   {"frames", status.frames},
                   {"state", status.state},
                   {"message", status.message},
                   {"frame_seconds", status.frame_seconds}});
  }
  return text_of({{"sides", all}});
}

std::string type_bytes(const RunFacts& facts) {
  std::string bytes;
  for (const int32_t type : facts.particle_type) bytes.push_back(static_cast<char>(byte_of(type)));
  return bytes;
}

std::string obstacle_bytes(const RunFacts& facts) {
  std::string head, body;
  append(head, static_cast<uint32_t>(facts.scene ? facts.scene->obstacles.size() : 0));
  if (!facts.scene) return head;
  int32_t moving = 0;
  for (const Obstacle& obstacle : facts.scene->obstacles) {
    const std::vector<SurfaceCorner> corners = shaded_corners(body_mesh(*facts.scene, obstacle));
    append(head, static_cast<uint32_t>(corners.size()));
    append(head, obstacle.motion ? moving++ : int32_t(-1));
    body.append(reinterpret_cast<const char*>(corners.data()), corners.size() * sizeof(SurfaceCorner));
  }
  return head + body;
}

}  // namespace graupel::experiments
