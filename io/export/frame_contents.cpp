// What is exported of a frame: its particles with their attributes, and the surface of each material.
#include <compare>
#include <map>
#include <set>

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

/// [n] of all particles; empty where the fields do not tell those of all that are in the run.
std::vector<float> volume_ratios(const std::vector<int32_t>& particle_type, const ParticleFrame& frame) {
  const std::vector<float>& plastic = frame.fields[ParticleField::plastic];
  const std::vector<float>& deformation = frame.fields[ParticleField::deformation_gradient];
  std::vector<float> ratio(frame.position.size(), 1.0f);
  for (std::size_t i = 0; i < ratio.size(); ++i) {
    if (!frame.is_active(i)) continue;
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

/// A body's particle type, and its index in ParticleMaterials where there is one.
using Body = std::pair<int32_t, std::optional<int32_t>>;

/// Which particles are of each material.
std::map<Body, std::vector<std::size_t>> bodies_of(const PointFrame& points) {
  std::map<Body, std::vector<std::size_t>> bodies;
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    std::optional<int32_t> index;
    if (!points.materials.empty()) index = points.materials.index[i];
    bodies[{points.particle_type[i], index}].push_back(i);
  }
  return bodies;
}

}  // namespace

PointFrame points_of(const std::vector<int32_t>& particle_type, const ParticleFrame& frame,
                     const ParticleMaterials& materials) {
  PointFrame out;
  out.time = frame.time;
  out.materials.names = materials.names;
  const std::vector<float> ratio = volume_ratios(particle_type, frame);
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

std::vector<MaterialSurface> surfaces_of(const PointFrame& points, const SurfaceSettings& settings,
                                         const std::string& where) {
  const std::vector<std::string> names = file_names(points.materials.names);
  std::vector<MaterialSurface> surfaces;
  for (const auto& [body, particles] : bodies_of(points)) {
    const auto& [particle_type, index] = body;
    std::vector<Vec3f> position, velocity;
    for (const std::size_t i : particles) {
      position.push_back(points.position[i]);
      if (!points.velocity.empty()) velocity.push_back(points.velocity[i]);
    }
    const std::string material =
        index.value_or(-1) >= 0 ? names[static_cast<std::size_t>(*index)] : particle_type_name(particle_type);
    surfaces.push_back(
        {material, particle_type, index, ParticleSurface(position, velocity, settings, where + ", " + material)});
  }
  return surfaces;
}

}  // namespace graupel::io
