#include "mpm/sampling.h"

#include <fmt/format.h>

#include <cmath>

#include "core/system/error.h"
#include "mpm/scene/emission.h"
#include "mpm/scene/plane_section.h"

namespace graupel::mpm {

namespace {

/// Point of the box for draw `index`, uniform.
Vec3d random_point(const Random& random, uint64_t index, const sparsegrid::LocalBox& box) {
  Vec3d x;
  for (int d = 0; d < 3; ++d) x[d] = random.uniform(index, d, box.low[d], box.high[d]);
  return x;
}

/// Taichi Elements' counts: int(n V/dx^3 + 1) for boxes, ceil(n V/dx^3) for all others; in the plane with A/dx^2.
int64_t particle_number(const Source& source, double measure, double cell) {
  const double expected = source.particles_per_cell * measure / cell;
  return static_cast<int64_t>(source.shape == Shape::box ? expected + 1 : std::ceil(expected));
}

/// Uniform random points in the body. Attempt a of particle i is draw i + a 2^32, so that a particle depends on its own
/// number alone.
std::vector<Vec3d> random_points(const Source& source, const SourceBody& body, double dx, const Random& random) {
  constexpr uint64_t most_attempts = 1000000;
  std::vector<Vec3d> points(static_cast<std::size_t>(particle_number(source, body.volume(), dx * dx * dx)));
  for (std::size_t i = 0; i < points.size(); ++i) {
    uint64_t attempt = 0;
    do {
      points[i] = random_point(random, i + (attempt << 32), body.bounds());
    } while (source.shape != Shape::box && !body.contains(points[i]) && ++attempt < most_attempts);
    if (attempt == most_attempts)
      throw ConfigError(fmt::format("no point of a {} was found inside its bounds. Check that it encloses a volume",
                                    word_of(source.shape)));
  }
  return points;
}

/// One point in every cell of a lattice of spacing dx / n^(1/3) around the body's centre, moved at random inside it.
std::vector<Vec3d> lattice_points(const Source& source, const SourceBody& body, double dx, const Random& random) {
  const double spacing = dx / std::cbrt(source.particles_per_cell);
  const sparsegrid::LocalBox& box = body.bounds();
  Vec<int64_t, 3> n;
  Vec3d low;
  for (int d = 0; d < 3; ++d) {
    n[d] = static_cast<int64_t>(std::ceil((box.high[d] - box.low[d]) / spacing - 1e-9));
    low[d] = (box.low[d] + box.high[d] - static_cast<double>(n[d]) * spacing) / 2;
  }
  std::vector<Vec3d> points;
  for (int64_t i = 0; i < n[0]; ++i)
    for (int64_t j = 0; j < n[1]; ++j)
      for (int64_t k = 0; k < n[2]; ++k) {
        const auto cell = static_cast<uint64_t>((i * n[1] + j) * n[2] + k);
        const Vec3d corner = low + spacing * Vec<int64_t, 3>{i, j, k}.cast<double>();
        const Vec3d x = random_point(random, cell, {corner, corner + Vec3d::filled(spacing)});
        if (body.contains(x)) points.push_back(x);
      }
  return points;
}

/// The same two rules in the plane.
std::vector<Vec3d> random_points(const Source& source, const PlaneSection& section, double dx, const Random& random) {
  std::vector<Vec3d> points(static_cast<std::size_t>(particle_number(source, section.area(), dx * dx)));
  constexpr uint64_t most_attempts = 1000000;
  for (std::size_t i = 0; i < points.size(); ++i) {
    Vec2d x;
    uint64_t attempt = 0;
    do {
      for (int a = 0; a < 2; ++a) x[a] = random.uniform(i + (attempt << 32), a, section.low()[a], section.high()[a]);
    } while (!section.contains(x) && ++attempt < most_attempts);
    if (attempt == most_attempts)
      throw ConfigError(fmt::format("no point of a {} was found in the plane. Check that it encloses an area",
                                    word_of(source.shape)));
    points[i] = section.local(x);
  }
  return points;
}

std::vector<Vec3d> lattice_points(const PlaneSection& section, double spacing, const Random& random) {
  Vec<int64_t, 2> n;
  Vec2d low;
  for (int a = 0; a < 2; ++a) {
    n[a] = static_cast<int64_t>(std::ceil((section.high()[a] - section.low()[a]) / spacing - 1e-9));
    low[a] = (section.low()[a] + section.high()[a] - static_cast<double>(n[a]) * spacing) / 2;
  }
  std::vector<Vec3d> points;
  for (int64_t i = 0; i < n[0]; ++i)
    for (int64_t j = 0; j < n[1]; ++j) {
      const Vec2d corner = low + spacing * Vec<int64_t, 2>{i, j}.cast<double>();
      Vec2d x;
      for (int a = 0; a < 2; ++a)
        x[a] = random.uniform(static_cast<uint64_t>(i * n[1] + j), a, corner[a], corner[a] + spacing);
      if (section.contains(x)) points.push_back(section.local(x));
    }
  return points;
}

std::vector<Vec3d> plane_points(const Source& source, std::size_t index, const SourceBody& body, const Domain& domain,
                                const Random& random) {
  const PlaneSection section(source, body, domain.plane());
  if (!section.is_met())
    throw ConfigError(
        fmt::format("source {} ({} of '{}') does not reach the plane of a scene with two dimensions (z = {:.6g} m, its "
                    "centre is at "
                    "{:.6g} m). Move it, or the domain",
                    index, word_of(source.shape), source.material, domain.plane(), source.position[2]));
  return source.sampling == Sampling::random
             ? random_points(source, section, domain.dx, random)
             : lattice_points(section, domain.spacing(source.particles_per_cell), random);
}

int32_t material_index(const Scene& scene, const std::string& material, const std::string& user) {
  const auto found = scene.materials.find(material);
  if (found == scene.materials.end())
    throw ConfigError(fmt::format("{} has the unknown material '{}'. Define it under materials", user, material));
  return static_cast<int32_t>(std::distance(scene.materials.begin(), found));
}

/// Particles that are given one by one.
void add_state(const Scene& scene, std::size_t s, const ParticleState& state, SampledParticles& all) {
  const std::size_t n = state.position.size();
  all.given.resize(all.position.size());
  for (std::size_t i = 0; i < n; ++i) {
    Vec3d x = state.position[i];
    if (scene.domain.is_plane()) x[2] = scene.domain.plane();
    all.position.push_back(x);
    all.velocity.push_back(state.velocity.empty() ? Vec3d::zero() : state.velocity[i]);
    all.spin.push_back(Vec3d::zero());
    all.volume.push_back(state.volume.empty() ? scene.domain.cell_volume() / scene.sources[s].particles_per_cell
                                              : state.volume[i]);
    all.material.push_back(material_index(scene, state.material.size() == 1 ? state.material[0] : state.material[i],
                                          fmt::format("particle {}", i)));
    all.source.push_back(static_cast<int32_t>(s));
    GivenState given;
    if (!state.deformation_gradient.empty()) given.deformation_gradient = state.deformation_gradient[i];
    if (!state.affine_velocity.empty()) given.affine_velocity = state.affine_velocity[i];
    if (!state.plastic.empty()) given.internal = state.plastic[i];
    all.given.push_back(given);
  }
}

void add_source(const Scene& scene, std::size_t s, uint64_t seed, SampledParticles& all) {
  const Source& source = scene.sources[s];
  if (source.state) return add_state(scene, s, *source.state, all);
  const int32_t material = material_index(scene, source.material, fmt::format("source {}", s));
  const Mat3d rotation = source.rotation();
  const Vec3d center = source.spin_center.value_or(source.position);
  for (const Vec3d& local : sample_body(source, s, scene.domain, Random(seed, RandomPurpose::particle_position, s))) {
    Vec3d x = rotation * local + source.position;
    if (scene.domain.is_plane()) x[2] = scene.domain.plane();
    all.position.push_back(x);
    all.velocity.push_back(source.velocity + cross(source.angular_velocity, x - center));
    all.spin.push_back(source.angular_velocity);
    all.volume.push_back(scene.domain.cell_volume() / source.particles_per_cell);
    all.material.push_back(material);
    all.source.push_back(static_cast<int32_t>(s));
  }
}

void add_emitter(const Scene& scene, std::size_t e, uint64_t seed, SampledParticles& all) {
  const Emitter& emitter = scene.emitters[e];
  const int32_t material = material_index(scene, emitter.material, fmt::format("emitter {}", e));
  const EmittedParticles emitted = sample_emitter(emitter, e, scene.domain, seed);
  for (std::size_t i = 0; i < emitted.position.size(); ++i) {
    all.position.push_back(emitted.position[i]);
    if (scene.domain.is_plane()) all.position.back()[2] = scene.domain.plane();
    all.velocity.push_back(emitter.velocity);
    all.spin.push_back(Vec3d::zero());
    all.volume.push_back(scene.domain.cell_volume() / emitter.particles_per_cell);
    all.material.push_back(material);
    all.source.push_back(static_cast<int32_t>(scene.sources.size() + e));
    all.birth_time.push_back(emitted.time[i]);
  }
}

/// Scripts of sources, then of regions, which take what is inside them at the start from the sources' scripts.
void add_scripts(const Scene& scene, SampledParticles& all) {
  constexpr double never = std::numeric_limits<double>::infinity();
  std::vector<int32_t> of_source(scene.sources.size() + scene.emitters.size(), -1);
  for (std::size_t s = 0; s < scene.sources.size(); ++s) {
    const Source& source = scene.sources[s];
    if (!source.motion) continue;
    of_source[s] = static_cast<int32_t>(all.scripts.size());
    all.scripts.push_back(
        {*source.motion, source.position, source.release_time.value_or(never), fmt::format("source {}", s)});
  }
  const auto first_region = static_cast<int32_t>(all.scripts.size());
  for (std::size_t r = 0; r < scene.kinematic_regions.size(); ++r) {
    const KinematicRegion& region = scene.kinematic_regions[r];
    all.scripts.push_back(
        {region.motion, region.position, region.release_time.value_or(never), fmt::format("kinematic region {}", r)});
  }
  if (all.scripts.empty()) return;
  for (std::size_t i = 0; i < all.position.size(); ++i) {
    int32_t script = of_source[static_cast<std::size_t>(all.source[i])];
    const bool at_start = static_cast<std::size_t>(all.source[i]) < scene.sources.size();
    for (std::size_t r = 0; at_start && r < scene.kinematic_regions.size(); ++r)
      if (scene.kinematic_regions[r].contains(all.position[i])) script = first_region + static_cast<int32_t>(r);
    all.script.push_back(script);
  }
}

}  // namespace

std::vector<Vec3d> sample_body(const Source& source, std::size_t index, const Domain& domain, const Random& random) {
  if (source.shape == Shape::points) return source.points ? *source.points : std::vector<Vec3d>{};
  const double dx = domain.dx;
  const SourceBody body(source, index, dx / 4);
  if (domain.is_plane()) return plane_points(source, index, body, domain, random);
  return source.sampling == Sampling::random ? random_points(source, body, dx, random)
                                             : lattice_points(source, body, dx, random);
}

SampledParticles sample_sources(const Scene& scene, uint64_t seed) {
  SampledParticles all;
  for (const auto& [name, material] : scene.materials) all.material_names.push_back(name);
  for (std::size_t s = 0; s < scene.sources.size(); ++s) add_source(scene, s, seed, all);
  if (!scene.emitters.empty()) all.birth_time.assign(all.position.size(), 0.0);
  for (std::size_t e = 0; e < scene.emitters.size(); ++e) add_emitter(scene, e, seed, all);
  if (!all.given.empty()) all.given.resize(all.position.size());
  add_scripts(scene, all);
  return all;
}

}  // namespace graupel::mpm
