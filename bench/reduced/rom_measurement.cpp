#include "bench/reduced/rom_measurement.h"
#include "core/system/stopwatch.h"
#include "experiments/models/timed_run.h"
#include "experiments/process/process.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "compare/metrics/displacement_error.h"
#include "core/system/error.h"
#include "experiments/models/memory_meter.h"
#include "experiments/process/common_options.h"
#include "io/scene/scene_reader.h"
#include "mpm/fast_step.h"
#include "mpm/particles/particles.h"
#include "rom/fields/factored_fields.h"

namespace graupel::bench {

using namespace experiments;

namespace {

ReducedRun start_run(const LoadedModel& model, const StoredRun& truth, const RomRunOptions& options,
                     OutsideRange outside) {
  return {model,
          truth.scene,
          truth.seed,
          reduced_options(options, model.model),
          {.arithmetic = options.arithmetic, .outside = outside, .foreign = options.foreign, .device = options.device}};
}

/// Sums of the differences of decoded and recorded stress.
class StressSums {
 public:
  explicit StressSums(const rom::ReducedModel& model)
      : clusters_(model.clusters),
        points_(clusters_.representatives()),
        fields_(model.fields->bind_f32(points_)),
        decoded_(Device::cpu, static_cast<int64_t>(points_.size())),
        members_(points_.size(), 0) {
    for (const int32_t c : clusters_.of_particle) members_[static_cast<std::size_t>(c)] += 1;
    tiles_.resize(static_cast<std::size_t>(mpm::padded_to_tile(static_cast<int64_t>(points_.size())) / mpm::tile));
    std::iota(tiles_.begin(), tiles_.end(), 0);
  }

  /// `recorded` xx, xy, xz, yy, yz, zz, particle by particle.
  void add(const rom::LatentState& state, const std::vector<float>& recorded) {
    const mpm::ParticleView<float> decoded = decoded_.view();
    fields_->decode(state, tiles_, decoded);
    constexpr int order[6] = {0, 3, 4, 1, 5, 2};      // in mpm's xx, yy, zz, xy, xz, yz
    constexpr double weight[6] = {1, 2, 2, 1, 2, 1};  // both halves of the tensor
    std::vector<double> mean(6 * points_.size(), 0);
    for (std::size_t p = 0; p < clusters_.of_particle.size(); ++p) {
      const auto c = static_cast<std::size_t>(clusters_.of_particle[p]);
      const Vec<float, 6> h = decoded.stress.vec(static_cast<int64_t>(c));
      for (std::size_t k = 0; k < 6; ++k) {
        const auto tau = static_cast<double>(recorded[6 * p + k]);
        mean[6 * c + k] += tau / members_[c];
        error2_ += weight[k] * std::pow(static_cast<double>(h[order[k]]) - tau, 2);
        size2_ += weight[k] * tau * tau;
      }
    }
    for (std::size_t c = 0; c < points_.size(); ++c) {
      const Vec<float, 6> h = decoded.stress.vec(static_cast<int64_t>(c));
      for (std::size_t k = 0; k < 6; ++k) {
        const double tau = mean[6 * c + k];
        mean_error2_ += members_[c] * weight[k] * std::pow(static_cast<double>(h[order[k]]) - tau, 2);
        mean_size2_ += members_[c] * weight[k] * tau * tau;
      }
    }
  }

  StressErrors errors() const {
    return {size2_ > 0 ? std::sqrt(error2_ / size2_) : 0, mean_size2_ > 0 ? std::sqrt(mean_error2_ / mean_size2_) : 0};
  }

 private:
  const rom::Clusters& clusters_;
  std::vector<int32_t> points_;
  std::unique_ptr<rom::PointFields<float>> fields_;
  mpm::Particles<float> decoded_;
  std::vector<double> members_;
  std::vector<int32_t> tiles_;  ///< all of them
  double error2_ = 0, size2_ = 0, mean_error2_ = 0, mean_size2_ = 0;
};

/// The scene with the step that `against` means, and what finding it took.
mpm::FastStep full_order(const StoredRun& truth, const mpm::SimulationOptions& options, const std::string& against) {
  if (against == "mpm:fast")
    return mpm::find_fast_step(truth.scene, options, truth.frames - 1, [] { stop_if_interrupted(); });
  if (against != "mpm")
    throw ConfigError("unknown model '" + against + "' (allowed: mpm, mpm:fast). Correct --against");
  mpm::FastStep own;
  own.scene = truth.scene;
  return own;
}

}  // namespace

rom::ReducedOptions reduced_options(const RomRunOptions& options, const rom::ReducedModel& model) {
  rom::ReducedOptions reduced;
  reduced.step_factor = options.step_factor;
  reduced.long_steps = options.long_steps;
  reduced.iterations = options.iterations;
  reduced.manifold_pull = options.manifold_pull;
  reduced.projection = options.projection;
  reduced.quadrature = options.quadrature;
  if (options.samples == 0) return reduced;
  std::vector<int32_t> candidates = model.clusters.representatives();
  const std::vector<double>& box = options.box;
  if (!box.empty())
    candidates = rom::points_within(candidates, model.reference, {box[0], box[1], box[2]}, {box[3], box[4], box[5]});
  if (candidates.empty()) throw ConfigError("no integration point lies in the box of '--sample-box'. Widen it");
  reduced.samples = rom::choose_samples(options.rule, candidates, options.samples, 0);
  return reduced;
}

StoredRun::StoredRun(const io::TrajectoryReader& from, int number, const std::string& file)
    : reader(from), run(number) {
  const Trajectory header = reader.header(run);
  scene = io::parse_stored_scene(header.scene_json, file, file);
  seed = header.seed;
  frames = static_cast<int64_t>(header.frame_count());
}

RomMeasurement measure_rom(const LoadedModel& model, const StoredRun& truth, const RomRunOptions& options) {
  const MemoryMeter memory;
  ReducedRun run = start_run(model, truth, options, OutsideRange::warn);
  RomMeasurement result;
  result.parameters = run.parameters();
  const std::vector<Vec3f> reference = truth.reader.frames(truth.run, 0, 1).front().position;
  compare::DisplacementError error(reference);
  std::optional<StressSums> stress;
  if (truth.reader.fields(truth.run).contains(ParticleField::stress) &&
      !model.model.fields->stress_follows_deformation())
    stress.emplace(model.model);
  try {
    for (int64_t f = 1; f < truth.frames; ++f) {
      stop_if_interrupted();
      const Stopwatch watch;
      run.advance_frame();
      result.seconds += watch.seconds();
      const ParticleFrame frame = truth.reader.frames(truth.run, f, 1, {ParticleField::stress}).front();
      const std::vector<Vec3f> position = run.frame().position;
      error.add(frame.position, position);
      compare::DisplacementError now(reference);
      now.add(frame.position, position);
      if (stress) stress->add(run.state(), frame.fields[ParticleField::stress]);
      result.frame_error.push_back(now.displacement_relative());
      result.trust.push_back(run.trust());
      result.trust_numbers.push_back(run.trust_number());
    }
  } catch (const DivergedError& stop) {
    result.diverged = true;
    result.trouble = stop.what();
  }
  result.delta = error.delta();
  result.displacement_relative = error.displacement_relative();
  result.error_cells = error.root_mean_square() / truth.scene.domain.dx;
  if (stress) result.stress = stress->errors();
  result.trust_number = run.trust_record().number();
  result.error_bound = run.trust_record().bound();
  result.verdict = run.trust_record().verdict();
  result.statistics = run.statistics();
  result.added_bytes = memory.added();
  return result;
}

SpeedComparison compare_speed(const LoadedModel& model, const StoredRun& truth, const RomRunOptions& options,
                              const std::string& against) {
  const mpm::SimulationOptions full{
      .device = options.device,
      .precision = options.arithmetic == Arithmetic::f64 ? mpm::Precision::f64 : mpm::Precision::f32,
      .seed = truth.seed};
  SpeedComparison result;
  result.against = against;
  std::vector<double> full_times, reduced_times;
  try {
    const mpm::FastStep step = full_order(truth, full, against);
    result.search_seconds = step.seconds;
    const auto simulation = mpm::Simulation::create(step.scene, full);
    ReducedRun run = start_run(model, truth, options, OutsideRange::be_quiet);
    for (int64_t f = 1; f < truth.frames; ++f) {
      stop_if_interrupted();
      Stopwatch watch;
      simulation->advance_frame();
      full_times.push_back(watch.seconds());
      watch = {};
      run.advance_frame();
      reduced_times.push_back(watch.seconds());
      result.substeps = static_cast<double>(simulation->statistics().substeps) / static_cast<double>(f);
    }
  } catch (const DivergedError&) {
    result.diverged = true;
  }
  result.mpm_frame = median(full_times);
  result.rom_frame = median(reduced_times);
  return result;
}

}  // namespace graupel::bench
