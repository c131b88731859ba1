#include "hybrid/effective_constants.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace graupel::hybrid {

namespace {

constexpr double degree = std::numbers::pi / 180;

bool is_angle(const ConstantRule& rule) { return rule.member == &MaterialConfig::friction_angle; }

/// p exp(offset + slope ln(p / reference)); 0 stays 0.
double replaced(double p, double reference, double offset, double slope) {
  return p > 0 ? p * std::exp(offset + slope * std::log(p / reference)) : p;
}

}  // namespace

const std::vector<ConstantRule>& constant_rules() {
  using M = MaterialConfig;
  static const std::vector<ConstantRule> rules = {
      {MaterialModel::water, "bulk_modulus", &M::bulk_modulus, 2.8e5, false, 1e3, 1e8},
      {MaterialModel::water, "viscosity", &M::viscosity, 0.3, true, 0, 1e4},
      {MaterialModel::sand, "youngs_modulus", &M::youngs_modulus, 1e6, false, 1e3, 1e9},
      {MaterialModel::sand, "friction_angle", &M::friction_angle, 32, true, 1, 80},
      {MaterialModel::sand, "cohesion", &M::cohesion, 70, false, 0, 1e6},
      {MaterialModel::snow, "youngs_modulus", &M::youngs_modulus, 3e5, true, 1e3, 1e9},
      {MaterialModel::snow, "critical_compression", &M::critical_compression, 0.025, true, 1e-4, 0.5},
      {MaterialModel::snow, "critical_stretch", &M::critical_stretch, 0.005, true, 1e-5, 0.5},
      {MaterialModel::snow, "hardening", &M::hardening, 8, true, 0, 30},
      {MaterialModel::jelly, "youngs_modulus", &M::youngs_modulus, 1.6e5, true, 1e3, 1e9}};
  return rules;
}

EffectiveConstants::EffectiveConstants() : offset(constant_rules().size(), 0), slope(constant_rules().size(), 0) {}

MaterialConfig EffectiveConstants::material(const MaterialConfig& of) const {
  MaterialConfig effective = of;
  for (std::size_t r = 0; r < constant_rules().size(); ++r) {
    const ConstantRule& rule = constant_rules()[r];
    if (rule.model != of.model || (offset[r] == 0 && slope[r] == 0)) continue;
    double& p = effective.*rule.member;
    const double own = p;
    if (is_angle(rule))
      p = std::atan(replaced(std::tan(p * degree), std::tan(rule.reference * degree), offset[r], slope[r])) / degree;
    else
      p = replaced(p, rule.reference, offset[r], slope[r]);
    p = std::clamp(p, std::min(rule.low, own), std::max(rule.high, own));
  }
  return effective;
}

Scene EffectiveConstants::scene(const Scene& of) const {
  Scene effective = of;
  for (auto& [name, config] : effective.materials) config = material(config);
  const double factor = std::exp(wall_friction);
  effective.domain.wall_friction *= factor;
  for (int face = 0; face < 6; ++face)
    if (auto& wall = effective.domain.faces.at(face / 2, face % 2); wall && wall->friction) *wall->friction *= factor;
  return effective;
}

}  // namespace graupel::hybrid
