#include "experiments/viewer/page_data.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "compare/metrics/particle_run.h"
#include "compare/pictures/raster.h"
#include "core/scene/material_config.h"
#include "experiments/process/json_text.h"
#include "experiments/viewer/body_mesh.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::ordered_json;

template <typename T>
Json list_of(const Vec<T, 3>& v) {
  return {v[0], v[1], v[2]};
}

/// What the page colours a particle by: its material where that is stored, else its type.
uint8_t key_of(const RunFacts& facts, std::size_t particle) {
  const int32_t key =
      facts.materials.empty() ? facts.particle_type[particle] : facts.materials.index[particle] + 1;  // 0: none
  return static_cast<uint8_t>(std::clamp(key, 0, 255));
}

/// The colour of a law's k-th material: that of the law, then darker and lighter ones.
compare::Color shade(const compare::Color& color, int k) {
  const int mixed = std::min(60, 35 * ((k + 1) / 2)), other = k % 2 == 1 ? 0 : 255;  // per cent of black or white
  compare::Color out = color;
  for (auto& channel : out) channel = static_cast<uint8_t>(((100 - mixed) * channel + mixed * other) / 100);
  return out;
}

Json materials_of(const RunFacts& facts) {
  struct Found {
    int32_t type;
    std::size_t particles;
  };
  std::map<uint8_t, Found> by_key;
  for (std::size_t i = 0; i < facts.particle_type.size(); ++i)
    ++by_key.try_emplace(key_of(facts, i), Found{facts.particle_type[i], 0}).first->second.particles;
  std::map<int32_t, int> of_law;
  Json materials = Json::array();
  for (const auto& [key, found] : by_key) {
    const compare::Color color = shade(compare::color_of_type(found.type), of_law[found.type]++);
    materials.push_back({{"type", key},
                         {"name", facts.materials.empty() || key == 0 ? particle_type_name(found.type)
                                                                      : facts.materials.names[key - 1U]},
                         {"particles", found.particles},
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

}  // namespace

std::string facts_json(const Sources& sides) {
  Json all = Json::array();
  for (const auto& source : sides) all.push_back(side_facts(source->facts()));
  return json_text(Json({{"sides", all}}));
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
  return json_text(Json({{"sides", all}}));
}

std::string type_bytes(const RunFacts& facts) {
  std::string bytes;
  for (std::size_t i = 0; i < facts.particle_type.size(); ++i) bytes.push_back(static_cast<char>(key_of(facts, i)));
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
