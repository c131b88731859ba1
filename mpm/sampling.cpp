#include "mpm/sampling.h"

#include <fmt/format.h>

#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "mpm/source_body.h"

namespace graupel::mpm {

namespace {

/// Point of the box for draw `index`, uniform.
Vec3d random_point(const Random& random, uint64_t index, const sparsegrid::LocalBox& box) {
  Vec3d x;
  for (int d = 0; d < 3; ++d) x[d] = random.uniform(index, d, box.low[d], box.high[d]);
  return x;
}

/// Taichi Elements' counts: int(n V/dx^3 + 1) for boxes, ceil(n V/dx^3) for all others.
int64_t particle_number(const Source& source, double volume, double dx) {
  const double expected = source.particles_per_cell * volume / (dx * dx * dx);
  return static_cast<int64_t>(source.shape == Shape::box ? expected + 1 : std::ceil(expected));
}

/// Uniform random points in the body. Attempt a of particle i is draw i + a 2^32, so that a particle depends on its own
/// number alone.
std::vector<Vec3d> random_points(const Source& source, const SourceBody& body, double dx, const Random& random) {
  constexpr uint64_t most_attempts = 1000000;
  std::vector<Vec3d> points(static_cast<std::size_t>(particle_number(source, body.volume(), dx)));
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

std::vector<Vec3d> local_points(const Source& source, std::size_t index, double dx, const Random& random) {
  if (source.shape == Shape::points) return source.points ? *source.points : std::vector<Vec3d>{};
  const SourceBody body(source, index, dx / 4);
  return source.sampling == Sampling::random ? random_points(source, body, dx, random)
                                             : lattice_points(source, body, dx, random);
}

}  // namespace

SampledParticles sample_sources(const Scene& scene, uint64_t seed) {
  SampledParticles all;
  for (const auto& [name, material] : scene.materials) all.material_names.push_back(name);
  const double dx = scene.domain.dx;
  for (std::size_t s = 0; s < scene.sources.size(); ++s) {
    const Source& source = scene.sources[s];
    const auto found = scene.materials.find(source.material);
    if (found == scene.materials.end())
      throw ConfigError(
          fmt::format("source {} has the unknown material '{}'. Define it under materials", s, source.material));
    const auto material = static_cast<int32_t>(std::distance(scene.materials.begin(), found));
    const Mat3d rotation = source.rotation();
    for (const Vec3d& local : local_points(source, s, dx, Random(seed, RandomPurpose::particle_position, s))) {
      all.position.push_back(rotation * local + source.position);
      all.velocity.push_back(source.velocity);
      all.volume.push_back(dx * dx * dx / source.particles_per_cell);
      all.material.push_back(material);
      all.source.push_back(static_cast<int32_t>(s));
    }
  }
  return all;
}

}  // namespace graupel::mpm
