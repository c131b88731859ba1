// Materials as a scene names them: a constitutive model with physical parameters, or a preset that sets them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/fields.h"

namespace graupel {

/// Constitutive models (docs/method.md gives the equations and papers).
enum class MaterialModel {
  water,  ///< weakly compressible, tau = K J (J - 1) I
  jelly,  ///< fixed corotated elasticity
  snow,   ///< fixed corotated with multiplicative plasticity and hardening (Stomakhin et al. 2013)
  sand    ///< StVK-Hencky with Drucker-Prager yield (Klar et al. 2016)
};
template <>
struct EnumWords<MaterialModel> {
  static constexpr std::pair<const char*, MaterialModel> words[] = {{"water", MaterialModel::water},
                                                                    {"jelly", MaterialModel::jelly},
                                                                    {"snow", MaterialModel::snow},
                                                                    {"sand", MaterialModel::sand}};
};

/// How sand regains volume after it was stretched apart.
enum class VolumeCorrection {
  klar,    ///< Klar et al. 2016, eq. 29: spread evenly over the logarithmic strains
  taichi,  ///< Taichi Elements: enters the trace only
  none
};
template <>
struct EnumWords<VolumeCorrection> {
  static constexpr std::pair<const char*, VolumeCorrection> words[] = {
      {"klar", VolumeCorrection::klar}, {"taichi", VolumeCorrection::taichi}, {"none", VolumeCorrection::none}};
};

/// One material. Elastic constants are those of the undamaged, unhardened material.
struct MaterialConfig {
  std::string name;    ///< key in the scene's "materials"
  std::string preset;  ///< "" or a name of material_preset()
  MaterialModel model = MaterialModel::water;
  double density = 1000;        ///< rho0 [kg/m^3]
  double bulk_modulus = 2.5e5;  ///< K [Pa], water
  double youngs_modulus = 1e6;  ///< E [Pa]
  double poissons_ratio = 0.2;  ///< nu
  double friction_angle = 35;   ///< phi [degrees], sand
  VolumeCorrection volume_correction = VolumeCorrection::klar;
  double critical_compression = 2.5e-2;  ///< theta_c, snow
  double critical_stretch = 7.5e-3;      ///< theta_s, snow
  double hardening = 10;                 ///< xi, snow: h = exp(xi (1 - J_p))
  double max_hardening = 20;             ///< cap of h: keeps the sound speed bounded; 0 = no cap (Taichi)

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using M = MaterialConfig;
    visit(&M::preset, FieldInfo{.name = "preset",
                                .unit = "",
                                .meaning = "Named set of constants that the other keys start from: water, jelly, snow, "
                                           "sand, taichi_water, taichi_jelly, taichi_snow or taichi_sand"});
    visit(&M::model, FieldInfo{.name = "model", .unit = "", .meaning = "Constitutive model"});
    visit(&M::density,
          FieldInfo{.name = "density", .unit = "kg/m^3", .meaning = "Density at rest", .range = Range::positive()});
    visit(&M::bulk_modulus, FieldInfo{.name = "bulk_modulus",
                                      .unit = "Pa",
                                      .meaning = "Bulk modulus; the sound speed is sqrt(bulk_modulus / density)",
                                      .range = Range::positive(),
                                      .only_for = "water"});
    visit(&M::youngs_modulus, FieldInfo{.name = "youngs_modulus",
                                        .unit = "Pa",
                                        .meaning = "Young's modulus",
                                        .range = Range::positive(),
                                        .only_for = "jelly snow sand"});
    visit(&M::poissons_ratio, FieldInfo{.name = "poissons_ratio",
                                        .unit = "",
                                        .meaning = "Poisson's ratio",
                                        .range = {.low = 0, .high = 0.5, .high_open = true},
                                        .only_for = "jelly snow sand"});
    visit(&M::friction_angle,
          FieldInfo{.name = "friction_angle",
                    .unit = "degrees",
                    .meaning = "Internal friction angle of the Drucker-Prager cone (triaxial compression)",
                    .range = {.low = 0, .high = 90, .high_open = true},
                    .only_for = "sand"});
    visit(&M::volume_correction, FieldInfo{.name = "volume_correction",
                                           .unit = "",
                                           .meaning = "How sand regains the volume it gained in tension",
                                           .only_for = "sand"});
    visit(&M::critical_compression, FieldInfo{.name = "critical_compression",
                                              .unit = "",
                                              .meaning = "Singular values of F below 1 minus this yield",
                                              .range = {.low = 0, .high = 1, .high_open = true},
                                              .only_for = "snow"});
    visit(&M::critical_stretch, FieldInfo{.name = "critical_stretch",
                                          .unit = "",
                                          .meaning = "Singular values of F above 1 plus this yield",
                                          .range = Range::not_negative(),
                                          .only_for = "snow"});
    visit(&M::hardening, FieldInfo{.name = "hardening",
                                   .unit = "",
                                   .meaning = "Exponent of the hardening factor exp(hardening (1 - J_p))",
                                   .range = Range::not_negative(),
                                   .only_for = "snow"});
    visit(&M::max_hardening, FieldInfo{.name = "max_hardening",
                                       .unit = "",
                                       .meaning = "Cap of the hardening factor; 0 for none",
                                       .range = Range::not_negative(),
                                       .only_for = "snow"});
  }
};

/// Constants by name, e.g. "taichi_snow"; empty for an unknown name.
std::optional<MaterialConfig> material_preset(const std::string& name);
/// All preset names, for messages and docs.
const std::vector<std::string>& material_preset_names();

/// Particle type ids in data files: 5 water, 6 sand, 8 snow, 4 jelly (3 obstacle).
int32_t particle_type_of(MaterialModel model);
inline constexpr int32_t obstacle_particle_type = 3;
/// "water", "sand", ... of a particle type id; "type<k>" for an unknown one.
std::string particle_type_name(int32_t type);

}  // namespace graupel
