#include "rom/reduced_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "rom/fields/deformation_fields.h"
#include "rom/solver/eulerian_quadrature.h"
#include "rom/solver/lagrangian_quadrature.h"

namespace graupel::rom {

namespace {

/// The scene, once its particles are known to be the model's.
mpm::PreparedScene checked(const ReducedModel& model, mpm::PreparedScene prepared) {
  check_start(model, prepared);
  return prepared;
}

/// Steps of a frame, and how often each may be halved: until it is no longer than the training's.
int64_t steps_of(const ReducedModel& model, double frame_time, double factor) {
  const double training_step = model.frame_time / static_cast<double>(model.substeps_per_frame);
  return std::max<int64_t>(1, static_cast<int64_t>(std::ceil(frame_time / (training_step * factor) - 1e-6)));
}
int halvings_of(const ReducedModel& model, double frame_time, double factor, LongSteps long_steps) {
  // A step that is taken back would have to take back integrated gradients.
  if (long_steps == LongSteps::kept || model.gradient == GradientKind::integrated) return 0;
  const double step = frame_time / static_cast<double>(steps_of(model, frame_time, factor)),
               training_step = model.frame_time / static_cast<double>(model.substeps_per_frame);
  return std::max(0, static_cast<int>(std::ceil(std::log2(step / training_step) - 1e-6)));
}

/// Decoded positions know no walls, and the grid ends a few cells behind them: points are held within a cell of the
/// walls. Throws DivergedError when more than a hundredth of them had to be.
template <typename T>
void hold_inside(const Scene& scene, const mpm::ParticleView<T>& particles) {
  const Vec3d margin = Vec3d::filled(scene.domain.dx);
  const Vec<T, 3> low = (scene.wall_low() - margin).template cast<T>(),
                  high = (scene.wall_high() + margin).template cast<T>();
  int64_t outside = 0;
  for (int64_t slot = 0; slot < particles.count; ++slot) {
    Vec<T, 3> x = particles.position.vec(slot);
    bool inside = true;
    for (int d = 0; d < 3; ++d) {
      if (x[d] > low[d] && x[d] < high[d]) continue;
      inside = false;
      x[d] = x[d] < high[d] ? low[d] : high[d];
    }
    if (inside) continue;
    ++outside;
    particles.position.set_vec(slot, x);
  }
  if (100 * outside > particles.count)
    throw DivergedError(
        "the body of the reduced model has left the domain. Use more samples, a smaller time step factor, or "
        "parameters nearer to those of the training");
}

/// One step of Gauss-Newton from where the latent's velocity takes it is exact to rounding in all measurements of
/// NSF's models; CROM's authors iterate.
int iterations_of(ProjectionKind projection) { return projection == ProjectionKind::position ? 1 : 20; }

std::vector<int32_t> all_of(int64_t n) {
  std::vector<int32_t> all(static_cast<std::size_t>(n));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

template <typename T>
ReducedSolver<T>::ReducedSolver(const ReducedModel& model, mpm::PreparedScene prepared, std::vector<double> parameters,
                                const ReducedOptions& options)
    : model_(model),
      prepared_(checked(model, std::move(prepared))),
      options_(options),
      step_factor_(step_factor_of(model, options.step_factor)),
      manifold_pull_(options.manifold_pull.value_or(model.manifold_pull)),
      projection_(options.projection.value_or(model.projection)),
      manifold_(model.training_latents, model.latents(), model.training_run,
                1 + static_cast<int>(model.parameters.size())),
      samples_(samples_of_run(model, options.samples, prepared_.particles)),
      grid_(prepared_),
      sample_field_(model.fields->bind_samples(samples_)),
      output_(model.fields->bind_positions_f32(all_of(model.fields->particles()))),
      scene_loads_(prepared_.scene.loads.size()),
      control_(halvings_of(model, prepared_.scene.frame_time, step_factor_, options.long_steps)) {
  GRAUPEL_ASSERT(parameters.size() == model_.parameters.size());
  state_ = start_of_run(model, prepared_.particles, std::move(parameters));
  if (state_.parameters.size() == 1) curve_ = manifold_.between(model.run_parameters, state_.parameters.front());
  quadrature_ = make_quadrature();
}

template <typename T>
std::unique_ptr<Quadrature<T>> ReducedSolver<T>::make_quadrature() {
  const mpm::GridGeometry<T, 3> geometry = mpm::grid_of<T>(prepared_.scene.domain);
  if (options_.quadrature.value_or(model_.quadrature) == QuadratureKind::lagrangian)
    return std::make_unique<LagrangianQuadrature<T>>(*model_.fields,
                                                     model_.integration_points(prepared_.particles.volume), samples_,
                                                     geometry, model_.gradient, grid_);
  if (model_.gradient == GradientKind::integrated)
    throw ConfigError(
        "Eulerian quadrature has other points in every step, and no deformation gradients that could be integrated "
        "(gradient integrated). Use quadrature lagrangian");
  const auto* const fields = dynamic_cast<const DeformationFields*>(model_.fields.get());
  if (fields == nullptr)
    throw ConfigError(
        "Eulerian quadrature needs a deformation map that knows every material point, and no stress field (a model of "
        "`graupel train crom`). Use quadrature lagrangian");
  constexpr int points_per_axis = 2;  // of a cell, as in the paper
  return std::make_unique<EulerianQuadrature<T>>(fields->deformation(), model_.reference, prepared_.particles, samples_,
                                                 geometry, points_per_axis, grid_);
}

template <typename T>
void ReducedSolver<T>::advance_frame() {
  const double frame_time = prepared_.scene.frame_time;
  trust_ = {};
  down_weighted_sum_ = 0;
  // In ticks, the shortest steps that there may be.
  const int64_t wanted = control_.longest(), ticks = wanted * steps_of(model_, frame_time, step_factor_);
  int64_t steps = 0;
  for (int64_t tick = 0; tick < ticks;) {
    if (tick % (2 * control_.length()) == 0) control_.lengthen_if_due();
    const int64_t length = control_.length();
    if (!try_step(frame_time * static_cast<double>(length) / static_cast<double>(ticks))) continue;
    tick += length;
    ++steps;
  }
  trust_.down_weighted = down_weighted_sum_ / static_cast<double>(steps);
  trust_.latent_distance = latent_distance(model_, state_.latent) / model_.latent_reach;
}

/// A step, or false where it is to be repeated at half the length; then nothing has changed but the statistics.
template <typename T>
bool ReducedSolver<T>::try_step(double dt) {
  const LatentState state = state_;
  const ErrorIndicator trust = trust_;
  const double time = time_, down_weighted = down_weighted_sum_;
  const auto take_back = [&] {
    state_ = state;
    trust_ = trust;
    time_ = time;
    down_weighted_sum_ = down_weighted;
    for (std::size_t l = 0; l < scene_loads_.size(); ++l)
      if (prepared_.scene.loads[l].start >= time) scene_loads_[l] = {};  // that began in the step
    ++statistics_.reduced_steps;
    return false;
  };
  try {
    step(dt);
  } catch (const DivergedError&) {
    if (!control_.can_halve()) throw;
    control_.halve();
    return take_back();
  }
  const auto lost = static_cast<double>(std::count(motion_.weight.begin(), motion_.weight.end(), 0.0));
  constexpr double negligible = 2e-3;  // of dx
  return control_.keep(misfit_, negligible * prepared_.scene.domain.dx / dt,
                       lost / static_cast<double>(samples_.size())) ||
         take_back();
}

template <typename T>
void ReducedSolver<T>::step(double dt) {
  Stopwatch timer;
  StepTiming& timing = statistics_.timing;
  push(dt);
  quadrature_->find(state_, grid_);
  timing.search += timer.lap();
  quadrature_->fill(state_, grid_);
  if (model_.fields->stress_follows_deformation() && model_.gradient == GradientKind::map)
    grid_.take_stress_of_deformation();
  hold_inside(prepared_.scene, grid_.particles());
  timing.decode += timer.lap();
  sample_field_->evaluate(state_.latent.data(), motion_.before);
  grid_.step(time_, dt, model_.gradient, model_.contact_weight, motion_.weight);
  timing.grid += timer.lap();
  project_samples(dt);
  timing.inversion += timer.lap();
  time_ += dt;
  ++timing.steps;
}

/// The samples' way to the next latent state (rom/projection/projection.h), and what it tells of its error.
template <typename T>
void ReducedSolver<T>::project_samples(double dt) {
  const mpm::ParticleView<T> particles = grid_.particles();
  motion_.after.resize(motion_.before.size());
  double moved2 = 0, furthest = 0;
  for (Eigen::Index s = 0; s < motion_.after.size() / 3; ++s) {
    const Vec<T, 3> x = particles.position.vec(s), way = static_cast<T>(dt) * particles.velocity.vec(s);
    for (int d = 0; d < 3; ++d) {
      // Without an obstacle or wall in the way, not rounded to the precision of positions: it would count in
      // velocities. The particle was decoded in that precision, so it is some units in the last place off.
      const double before = motion_.before[3 * s + d], moved = static_cast<double>(x[d]) - before,
                   rounding = 4 * static_cast<double>(std::numeric_limits<T>::epsilon() * std::abs(x[d]));
      const bool free = std::abs(moved - static_cast<double>(way[d])) <= rounding;
      motion_.after[3 * s + d] = free ? before + static_cast<double>(way[d]) : static_cast<double>(x[d]);
    }
    const double way2 = (motion_.after.segment<3>(3 * s) - motion_.before.segment<3>(3 * s)).squaredNorm();
    moved2 += way2;
    furthest = std::max(furthest, way2);
  }
  const FitReport report = project(projection_, *sample_field_, motion_, dt,
                                   options_.iterations.value_or(iterations_of(projection_)), state_);
  misfit_ = report.distance / dt;
  if (manifold_pull_ > 0) pull(dt);

  const auto samples = static_cast<double>(samples_.size());
  const double moved = std::sqrt(moved2 / samples), least = 1e-4 * prepared_.scene.domain.dx;
  trust_.residual = std::max(trust_.residual, report.distance / std::max(moved, least));
  down_weighted_sum_ += report.down_weighted;
  quadrature_->moved(std::sqrt(furthest));
  statistics_.largest_condition = std::max(statistics_.largest_condition, report.condition);
  iteration_sum_ += report.iterations;
  integration_sum_ += particles.count;
  statistics_.most_integration = std::max(statistics_.most_integration, particles.count);
}

/// A part of the way to where the training went, without a change of velocity.
template <typename T>
void ReducedSolver<T>::pull(double dt) {
  const auto r = static_cast<Eigen::Index>(state_.latent.size());
  const Eigen::VectorXd latent = Eigen::Map<const Eigen::VectorXd>(state_.latent.data(), r);
  const double place = (time_ + dt) / model_.frame_time;
  const Eigen::VectorXd way =
      manifold_pull_ *
      ((curve_.size() > 0 ? nearest_on_curve(curve_, latent, place) : manifold_.project(latent)) - latent);
  Eigen::Map<Eigen::VectorXd>(state_.latent.data(), r) += way;
  if (!state_.previous.empty()) Eigen::Map<Eigen::VectorXd>(state_.previous.data(), r) += way;
}

template <typename T>
LoadResponse ReducedSolver<T>::apply(const Load& load) {
  std::erase_if(loads_, [&](const BodyLoad& old) { return old.is_over(time_); });
  BodyLoad added(*model_.fields, {load, time_}, frame().position, moving_mass());
  LoadResponse response = added.response(state_.latent.data());
  if (const double fastest = fastest_of_training(model_); fastest > 0) {
    const Eigen::VectorXd change = load.duration * added.acceleration(state_.latent.data());
    std::vector<double> after = state_.velocity;
    for (std::size_t k = 0; k < after.size(); ++k) after[k] += change[static_cast<Eigen::Index>(k)];
    response.speed = scaled_norm(model_, after) / fastest;
  }
  loads_.push_back(std::move(added));
  return response;
}

/// [particles] Mass of those that forces move now, 0 for the others [kg].
template <typename T>
std::vector<double> ReducedSolver<T>::moving_mass() const {
  const mpm::SampledParticles& all = prepared_.particles;
  std::vector<double> mass(all.position.size(), 0.0);
  for (std::size_t p = 0; p < mass.size(); ++p) {
    const MaterialConfig& material =
        prepared_.scene.materials.at(all.material_names[static_cast<std::size_t>(all.material[p])]);
    const bool is_led = !all.script.empty() && all.script[p] >= 0 &&
                        time_ < all.scripts[static_cast<std::size_t>(all.script[p])].release_time;
    if (material.model != MaterialModel::stationary && !is_led) mass[p] = material.density * all.volume[p];
  }
  return mass;
}

/// The loads' impulses in a step. Those of the scene that begin in it are carried by what is in their ball now.
template <typename T>
void ReducedSolver<T>::push(double dt) {
  for (std::size_t l = 0; l < scene_loads_.size(); ++l)
    if (scene_loads_[l].phase == LoadPhase::waits && prepared_.scene.loads[l].acts(time_, dt) > 0) begin_load(l);
  for (const SceneLoad& of_scene : scene_loads_)
    if (of_scene.load) push_by(*of_scene.load, dt);
  for (const BodyLoad& load : loads_) push_by(load, dt);
}

template <typename T>
void ReducedSolver<T>::begin_load(std::size_t number) {
  const TimedLoad& load = prepared_.scene.loads[number];
  SceneLoad& begun = scene_loads_[number];
  const std::vector<Vec3f> position = frame().position;
  const std::vector<double> mass = moving_mass();
  begun.phase = BodyLoad::has_carriers(load, position, mass) ? LoadPhase::acts : LoadPhase::has_no_carriers;
  if (begun.phase == LoadPhase::acts) begun.load.emplace(*model_.fields, load, position, mass);
}

/// The velocity is also the difference to the latent before.
template <typename T>
void ReducedSolver<T>::push_by(const BodyLoad& load, double dt) {
  const double seconds = load.acts(time_, dt);
  if (seconds == 0) return;
  const Eigen::VectorXd change = seconds * load.acceleration(state_.latent.data());
  for (std::size_t k = 0; k < state_.velocity.size(); ++k) {
    state_.velocity[k] += change[static_cast<Eigen::Index>(k)];
    if (!state_.previous.empty()) state_.previous[k] -= state_.last_step * change[static_cast<Eigen::Index>(k)];
  }
}

template <typename T>
ParticleFrame ReducedSolver<T>::frame() const {
  const int64_t n = model_.fields->particles();
  std::vector<float> position(static_cast<std::size_t>(3 * mpm::padded_to_tile(n))), velocity(position.size());
  output_->decode(state_, position.data(), velocity.data());
  ParticleFrame frame;
  frame.time = time_;
  frame.position.resize(static_cast<std::size_t>(n));
  frame.velocity.resize(static_cast<std::size_t>(n));
  for (int64_t p = 0; p < n; ++p) {
    frame.position[static_cast<std::size_t>(p)] = mpm::TiledView<float, 3>{position.data()}.vec(p);
    frame.velocity[static_cast<std::size_t>(p)] = mpm::TiledView<float, 3>{velocity.data()}.vec(p);
  }
  return frame;
}

template <typename T>
ReducedStatistics ReducedSolver<T>::statistics() const {
  ReducedStatistics s = statistics_;
  const auto steps = static_cast<double>(std::max<int64_t>(1, s.timing.steps));
  s.samples = static_cast<int64_t>(samples_.size());
  s.mean_integration = static_cast<double>(integration_sum_) / steps;
  s.mean_iterations = static_cast<double>(iteration_sum_) / steps;
  s.loads_without_carriers = std::count_if(scene_loads_.begin(), scene_loads_.end(), [](const SceneLoad& load) {
    return load.phase == LoadPhase::has_no_carriers;
  });
  s.bytes = grid_.bytes() + quadrature_->bytes() + output_->bytes();
  return s;
}

template class ReducedSolver<float>;
template class ReducedSolver<double>;

}  // namespace graupel::rom
