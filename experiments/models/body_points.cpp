#include "experiments/models/body_points.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/parallel/parallel_for.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

using Json = nlohmann::json;

std::set<std::string> discretisation_keys(const std::string& scene_json) {
  std::set<std::string> keys = {"/domain/origin",  "/domain/size",   "/domain/dx", "/domain/wall_cells",
                                "/obstacle_voxel", "/obstacle_band", "/time_step"};
  const std::size_t sources = Json::parse(scene_json).at("sources").size();
  for (std::size_t i = 0; i < sources; ++i)
    for (const char* key : {"sampling", "particles_per_cell"}) keys.insert("/sources/" + std::to_string(i) + "/" + key);
  return keys;
}

bool has_own_particles(const rom::ReducedModel& model, const mpm::SampledParticles& particles, double tolerance) {
  if (3 * particles.position.size() != model.reference.size()) return false;
  for (std::size_t p = 0; p < particles.position.size(); ++p)
    for (std::size_t d = 0; d < 3; ++d)
      if (!(std::abs(particles.position[p][static_cast<int>(d)] - static_cast<double>(model.reference[3 * p + d])) <=
            tolerance))
        return false;
  return true;
}

mpm::SampledParticles own_particles(const rom::ReducedModel& model, const Scene& scene) {
  Json placed = Json::parse(io::scene_to_json(scene));
  const Json trained = Json::parse(model.scene_json);
  for (const std::string& key : discretisation_keys(model.scene_json)) {
    const Json::json_pointer pointer(key);
    if (trained.contains(pointer)) placed[pointer] = trained.at(pointer);
  }
  const Scene body = io::parse_scene(placed.dump(), "the model's scene", scene.file);
  return mpm::sample_sources(body, trained.value("seed", uint64_t(0)));
}

rom::MlsParticles interpolation_particles(const Scene& scene, const mpm::SampledParticles& sampled) {
  rom::MlsParticles particles;
  particles.kind = particle_kinds(sampled);
  for (const Source& source : scene.sources)
    particles.spacing = std::max(particles.spacing, scene.domain.spacing(source.particles_per_cell));
  for (std::size_t p = 0; p < sampled.position.size(); ++p) {
    particles.numbers.push_back(static_cast<int32_t>(p));
    particles.reference.push_back(sampled.position[p].cast<float>());
  }
  return particles;
}

PointFrames::PointFrames(std::unique_ptr<rom::PointPositions<float>> points, std::size_t count, Content content)
    : points_(std::move(points)), count_(count), content_(content) {}

ParticleFrame PointFrames::frame(const rom::LatentState& state, double time) const {
  const auto n = static_cast<int64_t>(count_);
  std::vector<float> position(static_cast<std::size_t>(3 * mpm::padded_to_tile(n))), velocity;
  ParticleFrame frame;
  frame.time = time;
  frame.position.resize(count_);
  const auto copy = [n](std::vector<float>& from, std::vector<Vec3f>& to) {
    const mpm::TiledView<float, 3> tiles{from.data()};
    const auto one = [&](int64_t i) { to[static_cast<std::size_t>(i)] = tiles.vec(i); };
    parallel_for_cpu(n, one, Grain{16384});
  };
  if (content_ == Content::positions) {
    points_->decode(state, position.data());
  } else {
    velocity.resize(position.size());
    points_->decode(state, position.data(), velocity.data());
    frame.velocity.resize(count_);
    copy(velocity, frame.velocity);
  }
  copy(position, frame.position);
  return frame;
}

}  // namespace graupel::experiments
