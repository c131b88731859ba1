#include "rom/cuda/reduced_cuda.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "rom/cuda/cuda_run.h"
#include "rom/cuda/device_run.h"

namespace graupel::rom {

namespace {

void check_device() {
  if (!cuda_available())
    throw ConfigError(
        "reduced models cannot run on the GPU (this machine has none that is usable, or this build has no CUDA). Use "
        "--device cpu");
}

/// The start of a run is the CPU's.
device::InstanceTable table_of(const ReducedModel& model, const ReducedInstance& instance) {
  device::check_scene(instance.prepared.scene);
  check_start(model, instance.prepared);
  return device::instance_table(model, instance.prepared,
                                start_of_run(model, instance.prepared.particles, instance.parameters));
}

/// Which all instances must have.
std::vector<int32_t> samples_of(const ReducedModel& model, const std::vector<ReducedInstance>& instances,
                                const ReducedOptions& options) {
  std::vector<int32_t> samples = samples_of_run(model, options.samples, instances.front().prepared.particles);
  for (const ReducedInstance& instance : instances)
    if (samples_of_run(model, options.samples, instance.prepared.particles) != samples)
      throw ConfigError(
          "runs of a reduced model that advance together need the same scripted particles (kinematic_regions), since "
          "samples are taken from these. Run them one by one");
  return samples;
}

}  // namespace

ReducedDeviceSolver::ReducedDeviceSolver(const ReducedModel& model, std::vector<ReducedInstance> instances,
                                         const ReducedOptions& options)
    : model_(model) {
  GRAUPEL_ASSERT(!instances.empty());
  check_device();
  device::check_options(model, options);
  const std::vector<int32_t> samples = samples_of(model, instances, options);
  const device::ModelTable table = device::model_table(model, samples);
  samples_ = static_cast<int64_t>(samples.size());
  const double frame_time = instances.front().prepared.scene.frame_time;
  std::vector<device::InstanceTable> tables;
  for (const ReducedInstance& instance : instances) {
    if (instance.prepared.scene.frame_time != frame_time)
      throw ConfigError("runs of a reduced model that advance together need one frame_time. Give them the same");
    tables.push_back(table_of(model, instance));
    parameters_.push_back(instance.parameters);
  }
  const double training_step = model.frame_time / static_cast<double>(model.substeps_per_frame);
  const double wanted = training_step * step_factor_of(model, options.step_factor);
  steps_ = std::max<int64_t>(1, static_cast<int64_t>(std::ceil(frame_time / wanted - 1e-6)));
  dt_ = frame_time / static_cast<double>(steps_);
  device::RunSettings settings;
  settings.steps_per_frame = steps_;
  settings.dt = dt_;
  settings.pull = options.manifold_pull.value_or(model.manifold_pull);
  settings.curve_step = dt_ / model.frame_time;
  settings.contact_weight = model.contact_weight;
  run_ = device::make_cuda_run(table, std::move(tables), settings);
}

ReducedDeviceSolver::~ReducedDeviceSolver() = default;

const device::InstanceState& ReducedDeviceSolver::report(int instance) const { return run_->state(instance); }

void ReducedDeviceSolver::advance_frame() {
  const Stopwatch watch;
  run_->advance_frame();
  seconds_ += watch.seconds();
  time_ += dt_ * static_cast<double>(steps_);
}

double ReducedDeviceSolver::timed_frame() {
  const double seconds = run_->timed_steps(steps_);
  seconds_ += seconds;
  time_ += dt_ * static_cast<double>(steps_);
  return seconds;
}

std::vector<std::pair<std::string, double>> ReducedDeviceSolver::kernel_seconds() {
  std::vector<std::pair<std::string, double>> all;
  for (const device::KernelTime& kernel : run_->kernel_times(32)) all.emplace_back(kernel.name, kernel.seconds);
  return all;
}

std::optional<std::string> ReducedDeviceSolver::divergence(int instance) const {
  switch (report(instance).status) {
    case device::RunStatus::samples_lost:
      return "more than half of the samples of the reduced model move over one cell in a step, or are not finite. Use "
             "a smaller time step factor, more samples, or parameters nearer to those of the training";
    case device::RunStatus::singular:
      return "the inversion of the deformation field failed (its normal equations are singular or not finite). Use "
             "more samples, a smaller time step factor, or parameters nearer to those of the training";
    case device::RunStatus::running:
      break;
  }
  return {};
}

LatentState ReducedDeviceSolver::state(int instance) const {
  const device::InstanceState& from = report(instance);
  const int r = model_.latents();
  LatentState state;
  state.latent.assign(from.latent, from.latent + r);
  state.velocity.assign(from.velocity, from.velocity + r);
  state.parameters = parameters_[static_cast<std::size_t>(instance)];
  if (model_.fields->stress_follows_deformation()) return state;
  state.last_step = from.steps > 0 ? dt_ : 0;
  if (from.steps > 0)
    for (int j = 0; j < r; ++j) state.previous.push_back(from.latent[j] - dt_ * from.velocity[j]);
  return state;
}

ParticleFrame ReducedDeviceSolver::frame(int instance) const {
  const std::vector<float> values = run_->frame(instance);
  ParticleFrame frame;
  frame.time = time_;
  for (std::size_t i = 0; i < values.size(); i += 6) {
    frame.position.push_back({values[i], values[i + 1], values[i + 2]});
    frame.velocity.push_back({values[i + 3], values[i + 4], values[i + 5]});
  }
  return frame;
}

ErrorIndicator ReducedDeviceSolver::trust(int instance) const {
  const device::InstanceState& from = report(instance);
  ErrorIndicator trust;
  trust.residual = from.residual;
  trust.down_weighted = from.step > 0 ? from.down_weighted / from.step : 0;
  trust.latent_distance = latent_distance(model_, state(instance).latent) / model_.latent_reach;
  return trust;
}

ReducedStatistics ReducedDeviceSolver::statistics(int instance) const {
  const device::InstanceState& from = report(instance);
  const auto steps = static_cast<double>(std::max<int64_t>(1, from.steps));
  ReducedStatistics s;
  s.timing.device = seconds_;
  s.timing.steps = from.steps;
  s.samples = samples_;
  s.mean_integration = static_cast<double>(from.points_sum) / steps;
  s.most_integration = from.most_points;
  s.mean_iterations = 1;
  s.largest_condition = from.condition;
  s.bytes = run_->bytes();
  return s;
}

}  // namespace graupel::rom
