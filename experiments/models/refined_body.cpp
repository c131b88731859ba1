#include "experiments/models/refined_body.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/parallel/memory.h"
#include "core/system/error.h"

namespace graupel::experiments {

namespace {

constexpr int64_t most_points = (int64_t(1) << 31) - 1;
constexpr double point_bytes = 130;  ///< here and while a frame is written

}  // namespace

void check_refined_size(int64_t particles, int64_t times, uint64_t available) {
  if (particles * times > most_points)
    throw ConfigError(fmt::format("--refine {} makes {} points of {} particles (allowed: {}). Use a smaller number",
                                  times, particles * times, particles, most_points));
  const double needed = point_bytes * static_cast<double>(particles * times);
  if (needed > static_cast<double>(available))
    throw ConfigError(fmt::format(
        "--refine {} makes {} points, which need about {:.2g} GB of memory ({:.2g} GB are free). Use a smaller number",
        times, particles * times, 1e-9 * needed, 1e-9 * static_cast<double>(available)));
}

RefinedBody::RefinedBody(const LoadedModel& model, const Scene& scene, uint64_t seed, int64_t times) {
  const mpm::SampledParticles sampled = mpm::sample_sources(scene, seed);
  const std::size_t n = sampled.position.size();
  check_refined_size(static_cast<int64_t>(n), times, available_bytes(Device::cpu));
  rom::MlsParticles particles = interpolation_particles(scene, sampled);
  std::vector<double> side;
  for (std::size_t p = 0; p < n; ++p) {
    const auto source = static_cast<std::size_t>(sampled.source[p]);
    side.push_back(scene.domain.spacing(static_cast<double>(scene.sources[source].particles_per_cell)));
    const std::string& material = sampled.material_names[static_cast<std::size_t>(sampled.material[p])];
    particle_type_.insert(particle_type_.end(), static_cast<std::size_t>(times),
                          particle_type_of(scene.materials.at(material).model));
  }
  rom::ReferencePoints points =
      rom::refined_points(particles, side, static_cast<int>(times), scene.domain.axes(), seed);
  std::vector<float> reference;
  for (const Vec3f& x : points.position) reference.insert(reference.end(), x.a, x.a + 3);
  std::unique_ptr<rom::PointPositions<float>> bound = model.model.fields->bind_any_points(reference);
  if (!bound)
    bound = std::make_unique<rom::MlsPositions<float>>(*model.model.fields, std::move(particles), std::move(points));
  points_ = std::make_unique<PointFrames>(std::move(bound), particle_type_.size(), PointFrames::Content::positions);
}

}  // namespace graupel::experiments
