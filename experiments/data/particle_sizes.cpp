#include "experiments/data/particle_sizes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/system/error.h"
#include "mpm/sampling.h"

namespace graupel::experiments {

namespace {

/// Of the bodies of a scene: material and particles in a cell.
template <typename Visit>
void for_each_body(const Scene& scene, const Visit& visit) {
  for (const Source& source : scene.sources) visit(source.material, source.particles_per_cell);
  for (const Emitter& emitter : scene.emitters) visit(emitter.material, emitter.particles_per_cell);
}

/// Whether the sizes follow from the keys: solvers keep the scene's particles, and all are of one size.
bool has_one_size(const Scene& scene, const Trajectory& header) {
  std::set<double> per_cell;
  for_each_body(scene, [&](const std::string&, double n) { per_cell.insert(n); });
  return header.made_by == "mpm" && per_cell.size() == 1;
}

/// By the particles that the scene makes; empty where the trajectory has others.
std::vector<float> sizes_of_sampled(const Scene& scene, const Trajectory& header) {
  mpm::SampledParticles sampled;
  try {
    sampled = mpm::sample_sources(scene, header.seed);
  } catch (const ConfigError&) {
    return {};
  }
  const std::size_t particles = sampled.volume.size(), points = header.particle_count();
  if (particles == 0 || points % particles != 0) return {};
  const std::size_t times = points / particles;
  std::vector<int32_t> type;
  for (const std::string& name : sampled.material_names)
    type.push_back(particle_type_of(scene.materials.at(name).model));
  std::vector<float> sizes;
  sizes.reserve(points);
  for (std::size_t i = 0; i < points; ++i) {
    const std::size_t p = i / times;
    if (header.particle_type[i] != type[static_cast<std::size_t>(sampled.material[p])]) return {};
    sizes.push_back(static_cast<float>(
        std::pow(sampled.volume[p] / static_cast<double>(times), 1.0 / static_cast<double>(scene.domain.axes()))));
  }
  return sizes;
}

using BodyKey = std::pair<int32_t, int32_t>;  ///< type, index of the material or -1
BodyKey body_of(const Trajectory& header, std::size_t i) {
  return {header.particle_type[i], header.materials.empty() ? -1 : header.materials.index[i]};
}

/// The widest spacing that a scene gives to bodies of a material; to all bodies where it has none of it.
double widest_spacing(const Scene& scene, const Trajectory& header, const BodyKey& body) {
  double own = 0, all = 0;
  for_each_body(scene, [&](const std::string& material, double per_cell) {
    const double spacing = scene.domain.spacing(per_cell);
    const auto& [type, index] = body;
    const bool counts = index >= 0 ? header.materials.names[static_cast<std::size_t>(index)] == material
                                   : particle_type_of(scene.materials.at(material).model) == type;
    all = std::max(all, spacing);
    if (counts) own = std::max(own, spacing);
  });
  return own > 0 ? own : all;
}

std::vector<float> sizes_of_materials(const Scene& scene, const Trajectory& header) {
  std::map<BodyKey, float> of_body;
  std::vector<float> sizes;
  sizes.reserve(header.particle_count());
  for (std::size_t i = 0; i < header.particle_count(); ++i) {
    const auto [found, is_new] = of_body.try_emplace(body_of(header, i), 0.0f);
    if (is_new) found->second = static_cast<float>(widest_spacing(scene, header, found->first));
    sizes.push_back(found->second);
  }
  return sizes;
}

}  // namespace

std::vector<float> particle_sizes(const StoredScene& stored, const Trajectory& header) {
  if (stored.best() == nullptr) return {};
  const Scene& scene = *stored.best();
  if (scene.sources.empty() && scene.emitters.empty()) return {};
  if (stored.whole && !has_one_size(scene, header)) {
    std::vector<float> sizes = sizes_of_sampled(scene, header);
    if (!sizes.empty()) return sizes;
  }
  return sizes_of_materials(scene, header);
}

double widest_size(const std::vector<float>& sizes, const Trajectory& header, const io::SurfaceBody& body) {
  const BodyKey key = {body.particle_type, body.index.value_or(-1)};
  float widest = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (body_of(header, i) == key) widest = std::max(widest, sizes[i]);
  return widest;
}

}  // namespace graupel::experiments
