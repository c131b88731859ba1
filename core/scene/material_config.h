// Materials as a scene names them: a constitutive model with physical parameters, or a preset that sets them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/fields.h"

namespace graupel {

/// Constitutive models (docs/reference/method.md gives the equations and papers).
enum class MaterialModel {
  water,        ///< weakly compressible, linear or Tait pressure, Newtonian viscosity
  jelly,        ///< fixed corotated elasticity
  snow,         ///< fixed corotated with multiplicative plasticity and hardening (Stomakhin et al. 2013)
  sand,         ///< StVK-Hencky with Drucker-Prager yield (Klar et al. 2016)
  neo_hookean,  ///< stable neo-Hookean elasticity (Smith et al. 2018)
  metal,        ///< StVK-Hencky with von Mises yield and isotropic hardening
  cake,         ///< StVK-Hencky with von Mises yield that softens until the material is broken
  toothpaste,   ///< neo-Hookean with Herschel-Bulkley flow of the isochoric part (Yue et al. 2015)
  foam,         ///< StVK-Hencky with Herschel-Bulkley flow
  stationary    ///< keeps its place and velocity, has mass and no stress
};
template <>
struct EnumWords<MaterialModel> {
  static constexpr std::pair<const char*, MaterialModel> words[] = {{"water", MaterialModel::water},
                                                                    {"jelly", MaterialModel::jelly},
                                                                    {"snow", MaterialModel::snow},
                                                                    {"sand", MaterialModel::sand},
                                                                    {"neo_hookean", MaterialModel::neo_hookean},
                                                                    {"metal", MaterialModel::metal},
                                                                    {"cake", MaterialModel::cake},
                                                                    {"toothpaste", MaterialModel::toothpaste},
                                                                    {"foam", MaterialModel::foam},
                                                                    {"stationary", MaterialModel::stationary}};
};

/// Pressure of water at the volume ratio J.
enum class EquationOfState {
  linear,  ///< p = K (1 - J)
  tait     ///< p = K / gamma (J^-gamma - 1)
};
template <>
struct EnumWords<EquationOfState> {
  static constexpr std::pair<const char*, EquationOfState> words[] = {{"linear", EquationOfState::linear},
                                                                      {"tait", EquationOfState::tait}};
};

/// Elasticity below the stress of a yielding material.
enum class Elasticity {
  hencky,    ///< the law that the yield criterion is written in
  corotated  ///< yield in Hencky strains, stress by fixed corotated elasticity, as the NSF authors' code has it
};
template <>
struct EnumWords<Elasticity> {
  static constexpr std::pair<const char*, Elasticity> words[] = {{"hencky", Elasticity::hencky},
                                                                 {"corotated", Elasticity::corotated}};
};

/// Which strength the stress of a step feels: that after the step's own plastic flow, or that before it.
enum class HardeningUpdate {
  after,  ///< implicit: the stress lies on the yield surface of the new state
  before  ///< explicit, as in Taichi Elements and in NSF
};
template <>
struct EnumWords<HardeningUpdate> {
  static constexpr std::pair<const char*, HardeningUpdate> words[] = {{"after", HardeningUpdate::after},
                                                                      {"before", HardeningUpdate::before}};
};

/// How sand regains volume after it was stretched apart.
enum class VolumeCorrection {
  klar,    ///< Klar et al. 2016, Tampubolon et al. 2017: spread evenly over the logarithmic strains
  taichi,  ///< Taichi Elements: enters the trace only
  none     ///< stretched sand forgets at once (NSF)
};
template <>
struct EnumWords<VolumeCorrection> {
  static constexpr std::pair<const char*, VolumeCorrection> words[] = {
      {"klar", VolumeCorrection::klar}, {"taichi", VolumeCorrection::taichi}, {"none", VolumeCorrection::none}};
};

/// The names of all presets with spaces between them.
const std::string& material_preset_words();

/// One material. Elastic constants are those of the undamaged, unhardened material.
struct MaterialConfig {
  std::string name;    ///< key in the scene's "materials"
  std::string preset;  ///< "" or a name of material_preset()
  MaterialModel model = MaterialModel::water;
  double density = 1000;        ///< rho0 [kg/m^3]
  double bulk_modulus = 2.5e5;  ///< K at rest [Pa], water
  EquationOfState equation_of_state = EquationOfState::linear;
  double tait_exponent = 7;     ///< gamma, water of the Tait law
  double viscosity = 0;         ///< dynamic viscosity [Pa s], water
  double youngs_modulus = 1e6;  ///< E [Pa]
  double poissons_ratio = 0.2;  ///< nu
  double friction_angle = 35;   ///< phi [degrees], sand
  double cohesion = 0;          ///< c [Pa], sand
  VolumeCorrection volume_correction = VolumeCorrection::klar;
  double critical_compression = 2.5e-2;  ///< theta_c, snow
  double critical_stretch = 7.5e-3;      ///< theta_s, snow
  double hardening = 10;                 ///< xi, snow: h = exp(xi (1 - J_p))
  double max_hardening = 20;             ///< cap of h: keeps the sound speed bounded; 0 = no cap (Taichi)
  double yield_stress = 1e4;             ///< sigma_Y in uniaxial tension [Pa]
  double hardening_modulus = 0;          ///< d sigma_Y / d (equivalent plastic strain) [Pa], metal
  double softening_modulus = 0;          ///< the same, as a loss [Pa], cake
  double consistency = 100;  ///< k [Pa s^n], toothpaste and foam: shear stress = sigma_Y / sqrt(3) + k rate^n
  double flow_index = 1;     ///< n, toothpaste and foam
  Elasticity elasticity = Elasticity::hencky;
  HardeningUpdate hardening_update = HardeningUpdate::after;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using M = MaterialConfig;
    visit(&M::preset,
          FieldInfo{"preset", "", "Named set of constants that the other keys start from (table below)"}.offering(
              material_preset_words()));
    visit(&M::model, FieldInfo{"model", "", "Constitutive model"});
    visit(&M::density, FieldInfo{"density", "kg/m^3", "Density at rest", Range::positive()});
    visit(&M::bulk_modulus,
          FieldInfo{"bulk_modulus", "Pa", "Bulk modulus; the sound speed is sqrt(bulk_modulus / density)",
                    Range::positive()}
              .only_in("water"));
    visit(&M::equation_of_state,
          FieldInfo{"equation_of_state", "", "Pressure: linear, K (1 - J), or tait, K / gamma (J^-gamma - 1)"}.only_in(
              "water"));
    visit(&M::tait_exponent,
          FieldInfo{"tait_exponent", "", "Exponent gamma of the Tait law", Range::between(1, 20)}.only_in("tait"));
    visit(&M::viscosity,
          FieldInfo{"viscosity", "Pa s", "Dynamic viscosity (Newtonian)", Range::not_negative()}.only_in("water"));
    visit(&M::youngs_modulus, FieldInfo{"youngs_modulus", "Pa", "Young's modulus", Range::positive()}.only_in(
                                  "jelly snow sand neo_hookean metal cake toothpaste foam"));
    visit(&M::poissons_ratio,
          FieldInfo{"poissons_ratio", "", "Poisson's ratio", {.low = 0, .high = 0.5, .high_open = true}}.only_in(
              "jelly snow sand neo_hookean metal cake toothpaste foam"));
    visit(&M::friction_angle, FieldInfo{"friction_angle",
                                        "degrees",
                                        "Internal friction angle of the Drucker-Prager cone (triaxial compression)",
                                        {.low = 0, .high = 90, .high_open = true}}
                                  .only_in("sand"));
    visit(&M::cohesion,
          FieldInfo{"cohesion", "Pa", "Mohr-Coulomb cohesion; holds tension up to cohesion cot(friction_angle)",
                    Range::not_negative()}
              .only_in("sand"));
    visit(&M::volume_correction,
          FieldInfo{"volume_correction", "", "How sand regains the volume it gained in tension"}.only_in("sand"));
    visit(&M::critical_compression, FieldInfo{"critical_compression",
                                              "",
                                              "Singular values of F below 1 minus this yield",
                                              {.low = 0, .high = 1, .high_open = true}}
                                        .only_in("snow"));
    visit(&M::critical_stretch,
          FieldInfo{"critical_stretch", "", "Singular values of F above 1 plus this yield", Range::not_negative()}
              .only_in("snow"));
    visit(&M::hardening,
          FieldInfo{"hardening", "", "Exponent of the hardening factor exp(hardening (1 - J_p))", Range::not_negative()}
              .only_in("snow"));
    visit(&M::max_hardening,
          FieldInfo{"max_hardening", "", "Cap of the hardening factor; 0 for none", Range::not_negative()}.only_in(
              "snow"));
    visit(&M::yield_stress, FieldInfo{"yield_stress", "Pa", "Yield stress in uniaxial tension (in shear: over sqrt(3))",
                                      Range::not_negative()}
                                .only_in("metal cake toothpaste foam"));
    visit(&M::hardening_modulus,
          FieldInfo{"hardening_modulus", "Pa", "Rise of the yield stress over equivalent plastic strain",
                    Range::not_negative()}
              .only_in("metal"));
    visit(&M::softening_modulus,
          FieldInfo{"softening_modulus", "Pa",
                    "Fall of the yield stress over equivalent plastic strain; at zero the material is broken",
                    Range::not_negative()}
              .only_in("cake"));
    visit(&M::consistency,
          FieldInfo{"consistency", "Pa s^n",
                    "k of the flow law: shear stress = yield_stress / sqrt(3) + k (shear rate)^flow_index",
                    Range::not_negative()}
              .only_in("toothpaste foam"));
    visit(&M::flow_index,
          FieldInfo{"flow_index", "", "Exponent n of the flow law; below 1 it thins in shear", Range::between(0.1, 3)}
              .only_in("toothpaste foam"));
    visit(&M::elasticity,
          FieldInfo{"elasticity", "", "Law of the stress (corotated: as the code of NSF's authors)"}.only_in("cake"));
    visit(&M::hardening_update,
          FieldInfo{"hardening_update", "",
                    "Whether a step's stress feels the hardening after or before its own plastic flow"}
              .only_in("snow metal cake"));
  }
};

/// Constants by name, e.g. "taichi_snow"; empty for an unknown name.
std::optional<MaterialConfig> material_preset(const std::string& name);
/// All preset names, for messages and docs.
const std::vector<std::string>& material_preset_names();
/// Throws ConfigError for a constant out of its range, for materials that no reader has checked.
void check_material(const MaterialConfig& material);

/// Particle type ids in data files: 4 jelly, 5 water, 6 sand, 7 toothpaste, 8 snow, 9 neo_hookean, 10 metal, 11 cake,
/// 12 foam, 13 stationary (3 obstacle).
int32_t particle_type_of(MaterialModel model);
inline constexpr int32_t obstacle_particle_type = 3;
/// "water", "sand", ... of a particle type id; "type<k>" for an unknown one.
std::string particle_type_name(int32_t type);

}  // namespace graupel
