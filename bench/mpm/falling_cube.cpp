#include "bench/mpm/falling_cube.h"

#include <algorithm>
#include <cmath>

namespace graupel::bench {

namespace {

constexpr double step = 1e-4;  ///< [s]

}  // namespace

std::vector<std::string> material_words() {
  std::vector<std::string> words = {"all", "tait_water"};
  for (const auto& [word, model] : EnumWords<MaterialModel>::words)
    if (model != MaterialModel::stationary) words.emplace_back(word);
  return words;
}

MaterialConfig cube_material(const std::string& name) {
  const bool tait = name == "tait_water";
  const auto taichi = material_preset(tait ? "taichi_water" : "taichi_" + name);
  MaterialConfig m = taichi ? *taichi : *material_preset(name);
  m.name = name;
  if (tait) {
    m.equation_of_state = EquationOfState::tait;
    m.tait_exponent = 7.15;
    m.viscosity = 0.01;
  }
  m.density = 1000;
  m.youngs_modulus = name == "jelly" ? 5e4 : 1e5;
  m.poissons_ratio = name == "jelly" ? 0.4 : 0.3;
  m.friction_angle = 30;
  m.bulk_modulus = 4e4;
  m.yield_stress = 1000;
  m.consistency = 10;
  return m;
}

Scene cube_scene(const std::string& material, int64_t cells) {
  Scene scene;
  scene.name = material;
  scene.domain.dx = 1.0 / 256;
  const double dx = scene.domain.dx, side = static_cast<double>(cells) * dx;
  scene.domain.size = Vec3d::filled(std::max(1.0, side + 64 * dx));
  scene.materials[material] = cube_material(material);
  Source source;
  source.material = material;
  source.sampling = Sampling::jittered_lattice;
  source.size = {side, side, side};
  const double middle = scene.domain.size[0] / 2;
  source.position = {middle, static_cast<double>(scene.domain.wall_cells + 6) * dx + side / 2, middle};
  scene.sources.push_back(source);
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = steps_per_frame;
  scene.frame_time = static_cast<double>(steps_per_frame) * step;
  return scene;
}

int64_t cube_side(int64_t particles) {
  return std::max<int64_t>(1, std::llround(std::cbrt(static_cast<double>(particles) / 8)));
}

}  // namespace graupel::bench
