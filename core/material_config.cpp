#include "core/material_config.h"

#include <algorithm>

namespace graupel {

namespace {

MaterialConfig named(const char* name, MaterialModel model) {
  MaterialConfig m;
  m.preset = name;
  m.model = model;
  return m;
}

// Physically named defaults, and Taichi Elements' constants (commit 2451c98): E = 1e6 Pa, nu = 0.2 for all, water with
// lambda as its bulk modulus, jelly softened by 0.3, snow yielding at [1 - 2.5e-2, 1 + 4.5e-3] with hardening exponent
// 10 and no cap, sand of 45 degrees.
std::vector<MaterialConfig> make_presets() {
  std::vector<MaterialConfig> all;
  all.push_back(named("water", MaterialModel::water));
  MaterialConfig jelly = named("jelly", MaterialModel::jelly);
  jelly.youngs_modulus = 1e5;
  jelly.poissons_ratio = 0.3;
  all.push_back(jelly);
  MaterialConfig snow = named("snow", MaterialModel::snow);
  snow.density = 400;
  snow.youngs_modulus = 1.4e5;
  all.push_back(snow);
  MaterialConfig sand = named("sand", MaterialModel::sand);
  sand.density = 1600;
  sand.poissons_ratio = 0.3;
  all.push_back(sand);

  const double taichi_lambda = 1e6 * 0.2 / (1.2 * 0.6);
  MaterialConfig tw = named("taichi_water", MaterialModel::water);
  tw.bulk_modulus = taichi_lambda;
  all.push_back(tw);
  MaterialConfig tj = named("taichi_jelly", MaterialModel::jelly);
  tj.youngs_modulus = 0.3e6;
  all.push_back(tj);
  MaterialConfig ts = named("taichi_snow", MaterialModel::snow);
  ts.critical_stretch = 4.5e-3;
  ts.max_hardening = 0;
  all.push_back(ts);
  MaterialConfig td = named("taichi_sand", MaterialModel::sand);
  td.friction_angle = 45;
  td.volume_correction = VolumeCorrection::taichi;
  all.push_back(td);
  return all;
}

const std::vector<MaterialConfig>& presets() {
  static const std::vector<MaterialConfig> all = make_presets();
  return all;
}

}  // namespace

std::optional<MaterialConfig> material_preset(const std::string& name) {
  const auto found = std::find_if(presets().begin(), presets().end(), [&](const auto& m) { return m.preset == name; });
  if (found == presets().end()) return std::nullopt;
  return *found;
}

const std::vector<std::string>& material_preset_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> n;
    for (const auto& m : presets()) n.push_back(m.preset);
    return n;
  }();
  return names;
}

int32_t particle_type_of(MaterialModel model) {
  switch (model) {
    case MaterialModel::water:
      return 5;
    case MaterialModel::sand:
      return 6;
    case MaterialModel::snow:
      return 8;
    case MaterialModel::jelly:
      return 4;
  }
  return 0;
}

std::string particle_type_name(int32_t type) {
  switch (type) {
    case 3:
      return "obstacle";
    case 4:
      return "jelly";
    case 5:
      return "water";
    case 6:
      return "sand";
    case 8:
      return "snow";
    default:
      return "type" + std::to_string(type);
  }
}

}  // namespace graupel
