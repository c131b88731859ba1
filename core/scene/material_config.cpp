#include "core/scene/material_config.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/system/error.h"

namespace graupel {

namespace {

MaterialConfig named(const char* name, MaterialModel model, double density) {
  MaterialConfig m;
  m.preset = name;
  m.model = model;
  m.density = density;
  return m;
}

MaterialConfig elastic(const char* name, MaterialModel model, double density, double youngs_modulus,
                       double poissons_ratio) {
  MaterialConfig m = named(name, model, density);
  m.youngs_modulus = youngs_modulus;
  m.poissons_ratio = poissons_ratio;
  return m;
}

/// Softer than the real ones where stiffness costs steps and is not seen.
void add_everyday_presets(std::vector<MaterialConfig>& all) {
  all.push_back(named("water", MaterialModel::water, 1000));
  all.push_back(elastic("jelly", MaterialModel::jelly, 1000, 1e5, 0.3));
  all.push_back(elastic("snow", MaterialModel::snow, 400, 1.4e5, 0.2));
  all.push_back(elastic("sand", MaterialModel::sand, 1600, 1e6, 0.3));

  MaterialConfig tait = named("tait_water", MaterialModel::water, 1000);
  tait.equation_of_state = EquationOfState::tait;
  all.push_back(tait);
  MaterialConfig honey = named("honey", MaterialModel::water, 1400);
  honey.viscosity = 10;
  all.push_back(honey);
  all.push_back(elastic("dry_sand", MaterialModel::sand, 1600, 1e6, 0.3));
  MaterialConfig wet_sand = elastic("wet_sand", MaterialModel::sand, 1900, 1e6, 0.3);
  wet_sand.cohesion = 500;
  all.push_back(wet_sand);
  all.push_back(elastic("neo_hookean", MaterialModel::neo_hookean, 1100, 1e5, 0.4));
  MaterialConfig metal = elastic("metal", MaterialModel::metal, 2700, 5e6, 0.33);
  metal.yield_stress = 2e4;
  metal.hardening_modulus = 1e5;
  all.push_back(metal);
  MaterialConfig cake = elastic("cake", MaterialModel::cake, 500, 1e5, 0.3);
  cake.yield_stress = 4e3;
  cake.softening_modulus = 5e3;
  all.push_back(cake);
  MaterialConfig toothpaste = elastic("toothpaste", MaterialModel::toothpaste, 1300, 1e5, 0.4);
  toothpaste.yield_stress = 200;
  toothpaste.consistency = 50;
  toothpaste.flow_index = 0.5;
  all.push_back(toothpaste);
  MaterialConfig foam = elastic("foam", MaterialModel::foam, 200, 5e4, 0.3);
  foam.yield_stress = 200;
  foam.consistency = 20;
  all.push_back(foam);
  all.push_back(named("stationary", MaterialModel::stationary, 1000));
}

/// Taichi Elements (commit 2451c98) at unit size: E = 1e6 Pa, nu = 0.2 and 1000 kg/m^3 for all, water with lambda as
/// its bulk modulus, jelly softened by 0.3, snow yielding at [1 - 2.5e-2, 1 + 4.5e-3] with hardening exponent 10 and no
/// cap, sand of 45 degrees.
void add_taichi_presets(std::vector<MaterialConfig>& all) {
  MaterialConfig water = named("taichi_water", MaterialModel::water, 1000);
  water.bulk_modulus = 1e6 * 0.2 / (1.2 * 0.6);
  all.push_back(water);
  all.push_back(elastic("taichi_jelly", MaterialModel::jelly, 1000, 0.3e6, 0.2));
  MaterialConfig snow = elastic("taichi_snow", MaterialModel::snow, 1000, 1e6, 0.2);
  snow.critical_stretch = 4.5e-3;
  snow.max_hardening = 0;
  snow.hardening_update = HardeningUpdate::before;
  all.push_back(snow);
  MaterialConfig sand = elastic("taichi_sand", MaterialModel::sand, 1000, 1e6, 0.2);
  sand.friction_angle = 45;
  sand.volume_correction = VolumeCorrection::taichi;
  all.push_back(sand);
  all.push_back(named("taichi_stationary", MaterialModel::stationary, 1000));
}

/// NSF, Table 1 and appendix F. There tau_Y bounds |dev tau|, so that sigma_Y = sqrt(3/2) tau_Y, H = 3 mu xi and the
/// softening modulus is 3/2 theta; eta = 2 k. Densities and Poisson's ratios are not printed, nor are the moduli of
/// metal, cake and toothpaste: those here keep the sound CFL below 1 at the printed steps and grids. Sand is that of
/// the authors' example in warp-mpm.
void add_nsf_presets(std::vector<MaterialConfig>& all) {
  const double uniaxial = std::sqrt(1.5);
  all.push_back(elastic("nsf_bread", MaterialModel::jelly, 1, 7, 0.3));
  all.push_back(elastic("nsf_jelly", MaterialModel::jelly, 1, 1, 0.3));
  all.push_back(elastic("nsf_ball", MaterialModel::jelly, 10, 40, 0.3));
  MaterialConfig sand = elastic("nsf_sand", MaterialModel::sand, 200, 2000, 0.2);
  sand.volume_correction = VolumeCorrection::none;
  all.push_back(sand);
  MaterialConfig metal = elastic("nsf_metal", MaterialModel::metal, 1, 10, 0.3);
  metal.yield_stress = uniaxial * 0.05;
  metal.hardening_modulus = 3 * (10 / 2.6) * 0.1;  // xi = 0.1, the middle of the paper's range
  metal.hardening_update = HardeningUpdate::before;
  all.push_back(metal);
  MaterialConfig cake = elastic("nsf_cake", MaterialModel::cake, 1, 5, 0.3);
  cake.yield_stress = uniaxial * 0.1;
  cake.softening_modulus = 1.5 * 0.03;
  cake.hardening_update = HardeningUpdate::before;
  all.push_back(cake);
  MaterialConfig toothpaste = elastic("nsf_toothpaste", MaterialModel::toothpaste, 1, 5, 0.3);
  toothpaste.yield_stress = 0.05;
  toothpaste.consistency = 0.17 / 2;
  all.push_back(toothpaste);
}

/// CROM for MPM, Table 2; LiCROM's hole demo, whose stable neo-Hookean mu = lambda = 5e5 Pa before the remapping are
/// these E and nu after it; and the cubes by which claymore's speed is measured (its Tait law has K / gamma = 4e4 Pa).
void add_other_published_presets(std::vector<MaterialConfig>& all) {
  all.push_back(elastic("crom_solid", MaterialModel::jelly, 1000, 12500, 0.3));
  all.push_back(elastic("crom_tower", MaterialModel::jelly, 1000, 80000, 0.2));
  all.push_back(elastic("licrom_holes", MaterialModel::neo_hookean, 1000, 8.75e5, 1.0 / 6));
  all.push_back(elastic("claymore_jelly", MaterialModel::jelly, 1000, 5e4, 0.4));
  MaterialConfig sand = elastic("claymore_sand", MaterialModel::sand, 1000, 1e5, 0.3);
  sand.friction_angle = 30;
  all.push_back(sand);
  MaterialConfig water = named("claymore_water", MaterialModel::water, 1000);
  water.equation_of_state = EquationOfState::tait;
  water.tait_exponent = 7.15;
  water.bulk_modulus = 7.15 * 4e4;
  water.viscosity = 0.01;
  all.push_back(water);
}

std::vector<MaterialConfig> make_presets() {
  std::vector<MaterialConfig> all;
  add_everyday_presets(all);
  add_taichi_presets(all);
  add_nsf_presets(all);
  add_other_published_presets(all);
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

const std::string& material_preset_words() {
  static const std::string words = [] {
    std::string w;
    for (const auto& name : material_preset_names()) w += (w.empty() ? "" : " ") + name;
    return w;
  }();
  return words;
}

namespace {

struct ParticleType {
  int32_t id;
  MaterialModel model;
};

/// 4 to 8 are those of the data sets of learned simulators where these have them.
constexpr ParticleType particle_types[] = {{4, MaterialModel::jelly},  {5, MaterialModel::water},
                                           {6, MaterialModel::sand},   {7, MaterialModel::toothpaste},
                                           {8, MaterialModel::snow},   {9, MaterialModel::neo_hookean},
                                           {10, MaterialModel::metal}, {11, MaterialModel::cake},
                                           {12, MaterialModel::foam},  {13, MaterialModel::stationary}};

bool applies_to(const FieldInfo& info, const MaterialConfig& material) {
  if (info.only_for.empty()) return true;
  std::istringstream words{std::string(info.only_for)};
  for (std::string word; words >> word;)
    if (word == word_of(material.model) || word == word_of(material.equation_of_state)) return true;
  return false;
}

}  // namespace

void check_material(const MaterialConfig& material) {
  MaterialConfig::fields([&](auto member, const FieldInfo& info) {
    if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>) {
      const double value = material.*member;
      if (!applies_to(info, material) || (std::isfinite(value) && info.range.contains(value))) return;
      std::ostringstream text;
      text << "material '" << material.name << "': " << info.name << " is out of range (" << value << ", allowed "
           << (info.range.low_open ? "above " : "from ") << info.range.low;
      if (std::isfinite(info.range.high)) text << (info.range.high_open ? " to below " : " to ") << info.range.high;
      text << "). Change the value";
      throw ConfigError(text.str());
    }
  });
}

int32_t particle_type_of(MaterialModel model) {
  for (const ParticleType& type : particle_types)
    if (type.model == model) return type.id;
  return 0;
}

std::string particle_type_name(int32_t id) {
  if (id == obstacle_particle_type) return "obstacle";
  for (const ParticleType& type : particle_types)
    if (type.id == id) return word_of(type.model);
  return "type" + std::to_string(id);
}

}  // namespace graupel
