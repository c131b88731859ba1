// What is exported of a frame: its particles with their attributes, and the surface of each material.
#include <set>
#include <utility>

#include "core/scene/material_config.h"
#include "io/export/export.h"

namespace graupel::io {

namespace {

/// Where a particle's volume ratio is stored.
enum class VolumeRatio { one, plastic, determinant };

VolumeRatio volume_ratio_of(int32_t type) {
  for (const MaterialModel model :
       {MaterialModel::water, MaterialModel::jelly, MaterialModel::neo_hookean, MaterialModel::toothpaste})
    if (type == particle_type_of(model)) return VolumeRatio::plastic;
  const bool has_no_stress = type == obstacle_particle_type || type == particle_type_of(MaterialModel::stationary);
  return has_no_stress ? VolumeRatio::one : VolumeRatio::determinant;
}

/// Determinant of a matrix that lies row by row.
float determinant_of(const float* m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

/// [n] of all particles; empty where the fields do not tell those of all that are ever in the run.
std::vector<float> volume_ratios(const std::vector<int32_t>& particle_type, const ParticleFrame& frame) {
  const std::vector<float>& plastic = frame.fields[ParticleField::plastic];
  const std::vector<float>& deformation = frame.fields[ParticleField::deformation_gradient];
  std::vector<float> ratio(frame.position.size(), 1.0f);
  for (std::size_t i = 0; i < ratio.size(); ++i) {
    const VolumeRatio stored = volume_ratio_of(particle_type[i]);
    if (stored == VolumeRatio::one) continue;
    if ((stored == VolumeRatio::plastic ? plastic : deformation).empty()) return {};
    ratio[i] = stored == VolumeRatio::plastic ? plastic[i] : determinant_of(&deformation[9 * i]);
  }
  return ratio;
}

/// Names of materials as parts of names of files: of letters, digits and '_', all different, none that of obstacles.
std::vector<std::string> file_names(const std::vector<std::string>& names) {
  constexpr std::size_t longest = 60;
  const char* allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_";
  std::set<std::string> taken = {particle_type_name(obstacle_particle_type)};
  std::vector<std::string> out;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::string name = names[i].empty() ? "material" : names[i].substr(0, longest);
    for (std::size_t at = 0; (at = name.find_first_not_of(allowed, at)) != std::string::npos;) name[at] = '_';
    std::string different = name;
    for (std::size_t k = i; !taken.insert(different).second; ++k) different = name + "_" + std::to_string(k);
    out.push_back(different);
  }
  return out;
}

}  // namespace

PointFrame points_of(const std::vector<int32_t>& particle_type, const ParticleFrame& frame,
                     const ParticleMaterials& materials) {
  PointFrame out;
  out.time = frame.time;
  out.materials.names = materials.names;
  const std::vector<float> ratio = volume_ratios(particle_type, frame);
  out.stores_velocity = !frame.velocity.empty();
  out.stores_volume_ratio = !ratio.empty();
  for (std::size_t i = 0; i < frame.position.size(); ++i) {
    if (!frame.is_active(i)) continue;
    out.id.push_back(static_cast<int32_t>(i));
    out.particle_type.push_back(particle_type[i]);
    out.position.push_back(frame.position[i]);
    if (!frame.velocity.empty()) out.velocity.push_back(frame.velocity[i]);
    if (!ratio.empty()) out.volume_ratio.push_back(ratio[i]);
    if (!materials.empty()) out.materials.index.push_back(materials.index[i]);
  }
  return out;
}

std::vector<SurfaceBody> surface_bodies(const std::vector<int32_t>& particle_type, const ParticleMaterials& materials,
                                        const SurfaceSettings& settings) {
  std::set<std::pair<int32_t, std::optional<int32_t>>> found;
  for (std::size_t i = 0; i < particle_type.size(); ++i)
    found.emplace(particle_type[i], materials.empty() ? std::nullopt : std::optional(materials.index[i]));
  std::vector<SurfaceBody> bodies;
  bodies.reserve(found.size());
  for (const auto& [type, index] : found) bodies.push_back({type, index, settings});
  return bodies;
}

std::vector<MaterialSurface> surfaces_of(const PointFrame& points, const std::vector<SurfaceBody>& bodies,
                                         const std::string& where) {
  const std::vector<std::string> names = file_names(points.materials.names);
  std::vector<MaterialSurface> surfaces;
  for (const SurfaceBody& body : bodies) {
    std::vector<Vec3f> position, velocity;
    for (std::size_t i = 0; i < points.position.size(); ++i) {
      if (points.particle_type[i] != body.particle_type) continue;
      if (body.index && points.materials.index[i] != *body.index) continue;
      position.push_back(points.position[i]);
      if (!points.velocity.empty()) velocity.push_back(points.velocity[i]);
    }
    const std::string material = body.index.value_or(-1) >= 0 ? names[static_cast<std::size_t>(*body.index)]
                                                              : particle_type_name(body.particle_type);
    surfaces.push_back({material, body.particle_type, body.index,
                        ParticleSurface(position, velocity, body.settings, where + ", " + material)});
  }
  return surfaces;
}

}  // namespace graupel::io
