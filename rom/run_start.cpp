#include "rom/run_start.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "rom/cubature/sample_selection.h"

namespace graupel::rom {

void check_deformation_scene(const Scene& scene) {
  if (scene.transfer.scheme != TransferScheme::pic)
    throw ConfigError(fmt::format(
        "the scene's transfers carry affine velocities (transfer.scheme {}), and this reduced model knows none. Train "
        "and run it with transfer.scheme pic",
        word_of(scene.transfer.scheme)));
  for (const auto& [name, material] : materials_in_use(scene))
    if (material.model != MaterialModel::jelly && material.model != MaterialModel::neo_hookean &&
        material.model != MaterialModel::stationary)
      throw ConfigError(fmt::format(
          "material '{}' is not elastic, and this reduced model knows no plastic state. Use jelly or neo_hookean, or a "
          "model of `graupel train nsf`",
          name));
}

void check_start(const ReducedModel& model, const mpm::PreparedScene& prepared) {
  if (model.fields->stress_follows_deformation()) check_deformation_scene(prepared.scene);
  const auto& position = prepared.particles.position;
  const auto n = static_cast<std::size_t>(model.fields->particles());
  if (position.size() != n)
    throw ConfigError(fmt::format(
        "the scene has {} particles, the model {}. Use the scene and the seed that the model was trained with",
        position.size(), n));
  const double tolerance = 1e-4 * prepared.scene.domain.dx;
  for (std::size_t p = 0; p < n; ++p)
    for (int d = 0; d < 3; ++d)
      if (!(std::abs(position[p][d] - static_cast<double>(model.reference[3 * p + static_cast<std::size_t>(d)])) <=
            tolerance))
        throw ConfigError(fmt::format(
            "particle {} of the scene starts elsewhere than the model's (coordinate {}: {:.6g} m, the model's {:.6g} "
            "m). Use the scene and the seed that the model was trained with",
            p, d, position[p][d], model.reference[3 * p + static_cast<std::size_t>(d)]));
}

double step_factor_of(const ReducedModel& model, const std::optional<double>& wanted) {
  const double factor = wanted.value_or(model.step_factor);
  constexpr double least = 1e-3;  // a thousand times the steps of the training
  if (!(factor >= least && std::isfinite(factor)))
    throw ConfigError(fmt::format("a time step factor of {} is out of range (from {}). Use 1", factor, least));
  return factor;
}

std::vector<int32_t> samples_of_run(const ReducedModel& model, const std::optional<std::vector<int32_t>>& wanted,
                                    const mpm::SampledParticles& particles) {
  constexpr int64_t of_each_boundary = 5;
  std::vector<int32_t> samples = wanted.value_or(model.samples);
  if (!model.fields->stress_follows_deformation()) return samples;
  return with_boundary_samples(std::move(samples), particles.script, of_each_boundary);
}

LatentState start_of_run(const ReducedModel& model, const mpm::SampledParticles& particles,
                         std::vector<double> parameters) {
  LatentState state;
  state.parameters = std::move(parameters);
  const auto encoder = model.fields->bind_samples(model.encoder);
  const auto rows = static_cast<Eigen::Index>(3 * model.encoder.size());
  Eigen::VectorXd position(rows), velocity(rows);
  for (std::size_t i = 0; i < model.encoder.size(); ++i)
    for (int d = 0; d < 3; ++d) {
      const auto p = static_cast<std::size_t>(model.encoder[i]);
      position[static_cast<Eigen::Index>(3 * i) + d] = particles.position[p][d];
      velocity[static_cast<Eigen::Index>(3 * i) + d] = particles.velocity[p][d];
    }
  const auto r = static_cast<Eigen::Index>(model.start_latent.size());
  Eigen::VectorXd latent = Eigen::Map<const Eigen::VectorXd>(model.start_latent.data(), r);
  if (model.conv_encoder) {
    std::vector<double> all;
    for (const Vec3d& x : particles.position) all.insert(all.end(), x.a, x.a + 3);
    const std::vector<double> encoded = model.conv_encoder->encode(all);
    std::copy(encoded.begin(), encoded.end(), latent.data());
  } else {
    fit_latent(*encoder, position, {}, {.iterations = 20}, latent);
  }
  Eigen::MatrixXd jacobian;
  encoder->jacobian(latent.data(), jacobian);
  const Eigen::VectorXd rate = (jacobian.transpose() * jacobian).ldlt().solve(jacobian.transpose() * velocity);
  state.latent.assign(latent.data(), latent.data() + r);
  state.velocity.assign(rate.data(), rate.data() + r);
  return state;
}

}  // namespace graupel::rom
