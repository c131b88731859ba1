#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/models/reduced_model.h"
#include "experiments/models/refined_body.h"
#include "experiments/models/timed_run.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "experiments/rollout/reduced_rollout.h"
#include "experiments/rollout/rollout_input.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/scene/particle_materials.h"

namespace graupel::experiments {

namespace {

rom::ReducedOptions reduced_options(const RolloutOptions& options) {
  rom::ReducedOptions reduced;
  reduced.step_factor = options.step_factor;
  reduced.projection = rom::word_choice<rom::ProjectionKind>(options.projection);
  reduced.quadrature = rom::word_choice<rom::QuadratureKind>(options.quadrature);
  return reduced;
}

struct GivenLoad {
  TimedLoad load;
  std::string text;
};

/// "TIME:DURATION:X,Y,Z:RADIUS:FX,FY,FZ". Throws ConfigError.
GivenLoad parse_load(const std::string& text) {
  std::vector<double> numbers;
  std::string shape;  // its separators
  for (const char* at = text.c_str();;) {
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    if (end == at || *end == '\0') {
      if (end == at) shape += '?';
      break;
    }
    shape += *end;
    at = end + 1;
  }
  if (shape != "::,,::,,")
    throw ConfigError(
        fmt::format("--load '{}' is not TIME:DURATION:X,Y,Z:RADIUS:FX,FY,FZ, as in "
                    "0.5:0.1:0.5,0.4,0.5:0.05:2,0,0 (seconds, metres, newtons)",
                    text));
  if (!(numbers[0] >= 0))
    throw ConfigError(fmt::format("--load '{}' begins at {} s (allowed: 0 or later)", text, numbers[0]));
  const Load load = {
      {numbers[2], numbers[3], numbers[4]}, numbers[5], {numbers[6], numbers[7], numbers[8]}, numbers[1]};
  return {{load, numbers[0]}, text};
}

std::vector<GivenLoad> given_loads(const RolloutOptions& options, double end) {
  std::vector<GivenLoad> loads;
  for (const std::string& text : options.loads) {
    loads.push_back(parse_load(text));
    if (!(loads.back().load.start < end))
      throw ConfigError(fmt::format("--load '{}' begins at {} s, and the rollout ends at {:.4g} s. Give more --frames",
                                    text, loads.back().load.start, end));
  }
  return loads;
}

/// As many of each value as make `count` together.
void repeat_each(std::vector<int32_t>& values, std::size_t count) {
  std::vector<int32_t> repeated;
  for (const int32_t value : values) repeated.insert(repeated.end(), count / values.size(), value);
  values = std::move(repeated);
}

/// A run with its trajectory on the disk: a row of `trust` a frame, the largest of them, and the time.
class ReducedRollout {
 public:
  ReducedRollout(const LoadedModel& loaded, const RolloutOptions& options, const SceneAndSeed& task)
      : options_(options),
        scene_(task.scene),
        frames_(options.frames >= 0 ? options.frames : task.scene.frames),
        model_(loaded.model),
        run_(loaded, task.scene, task.seed, reduced_options(options),
             {.arithmetic = options.f64 ? Arithmetic::f64 : Arithmetic::f32,
              .device = device_of_reduced_models(options.common.device)}),
        refined_(options.refine ? std::make_unique<RefinedBody>(loaded, task.scene, task.seed, *options.refine)
                                : nullptr),
        loads_(given_loads(options, static_cast<double>(frames_) * scene_.frame_time)),
        writer_(options.output, header_of(task), {.velocity = !refined_}) {
    std::vector<io::NamedValue> values;
    for (std::size_t i = 0; i < run_.parameters().size(); ++i) {
      const rom::ModelParameter& p = loaded.model.parameters[i];
      values.push_back({p.name, p.unit, run_.parameters()[i], p.keys});
    }
    writer_.parameters(values);
  }

  /// Throws DivergedError once all is written.
  void run() {
    write_frame({});
    advance();
    writer_.table(
        {.name = "trust",
         .units = "",
         .description =
             "Largest residual, share of down-weighted samples, latent distance, trust number [frame, indicator]",
         .columns = 4,
         .values = trust_});
    writer_.finish(diverged_at_ < 0 ? -1 : written_);
    print_summary();
    options_.common.write_json(summary());
    if (diverged_at_ >= 0)
      throw DivergedError(fmt::format("the rollout diverged at frame {} ({}); the frames before it are in '{}'",
                                      diverged_at_, trouble_, options_.output));
  }

 private:
  Trajectory header_of(const SceneAndSeed& task) const {
    Trajectory header;
    header.particle_type = refined_ ? refined_->particle_type() : run_.particle_type();
    header.materials = mpm::kept_materials(task.scene, task.seed);
    if (refined_) repeat_each(header.materials.index, header.particle_type.size());
    header.frame_time = task.scene.frame_time * static_cast<double>(options_.stride);
    header.scene_json = task.scene.source;
    header.seed = task.seed;
    header.made_by = options_.weights;
    return header;
  }

  /// `trust`: the largest since the frame before.
  void write_frame(const rom::ErrorIndicator& trust) {
    if (refined_) {
      const Stopwatch watch;
      const ParticleFrame frame = refined_->frame(run_.state(), run_.time());
      refine_seconds_.push_back(watch.seconds());
      writer_.append(frame);
    } else {
      writer_.append(run_.frame());
    }
    ++written_;
    for (const double value : {trust.residual, trust.down_weighted, trust.latent_distance, run_.trust_number()})
      trust_.push_back(static_cast<float>(value));
    worst_ = larger(worst_, trust);
  }

  static rom::ErrorIndicator larger(const rom::ErrorIndicator& a, const rom::ErrorIndicator& b) {
    return {std::max(a.residual, b.residual), std::max(a.down_weighted, b.down_weighted),
            std::max(a.latent_distance, b.latent_distance)};
  }

  /// Those that begin in the frame to come, all at its start; says what the model makes of them.
  void apply_loads() {
    const double end = run_.time() + scene_.frame_time * (1 - 1e-9);
    for (const GivenLoad& given : loads_) {
      if (given.load.start < run_.time() - 1e-9 * scene_.frame_time || given.load.start >= end) continue;
      const rom::LoadResponse response = run_.apply(given.load);
      std::fprintf(stderr,
                   "load %s at %.4g s: %lld particles carry it, the model's motions take %.2g %% of its energy\n",
                   given.text.c_str(), run_.time(), static_cast<long long>(response.particles), 100 * response.share);
      if (!response.is_like_training())
        warn(fmt::format(
            "{}: load {} is outside the training: it drives the latents up to {:.3g} times as fast as there",
            scene_.name, given.text, response.speed));
    }
  }

  void advance() {
    Progress progress(fmt::format("rollout {} ({} particles)", scene_.name, run_.particle_type().size()), frames_);
    rom::ErrorIndicator since;
    for (int64_t f = 1; f <= frames_; ++f) {
      stop_if_interrupted(fmt::format("; 'graupel inspect --recover {}' keeps the frames so far", options_.output));
      apply_loads();
      const Stopwatch watch;
      try {
        run_.advance_frame();
      } catch (const DivergedError& error) {
        diverged_at_ = f;
        trouble_ = error.what();
        return;
      }
      seconds_.push_back(watch.seconds());
      since = larger(since, run_.trust());
      if (f % options_.stride == 0) write_frame(std::exchange(since, {}));
      progress.update(f, fmt::format("{:.0f} ms a frame, residual {:.2g}, latent distance {:.2g}",
                                     1e3 * seconds_.back(), run_.trust().residual, run_.trust().latent_distance));
    }
    progress.done();
  }

  double median_frame() const { return median(seconds_); }

  void print_summary() const {
    const rom::ReducedStatistics statistics = run_.statistics();
    const rom::StepTiming& t = statistics.timing;
    const double step = t.total() / static_cast<double>(std::max<int64_t>(1, t.steps)),
                 percent = 100 / std::max(t.total(), 1e-12);
    std::fprintf(stderr, "%s: %zu particles, %zu frames, %s a frame (median)\n", options_.output.c_str(),
                 run_.particle_type().size(), seconds_.size(), human_time(median_frame()).c_str());
    if (refined_)
      std::fprintf(stderr, "  refined to %zu points: %s a frame that was written (median of %lld)\n",
                   refined_->particle_type().size(), human_time(median(refine_seconds_)).c_str(),
                   static_cast<long long>(written_));
    if (t.steps == 0) return;
    if (t.device > 0)
      std::fprintf(stderr, "  %s a step, on the GPU\n", human_time(step).c_str());
    else
      std::fprintf(stderr, "  %s a step: decode %.0f %%, grid %.0f %%, inversion %.0f %%, search %.0f %%\n",
                   human_time(step).c_str(), percent * t.decode, percent * t.grid, percent * t.inversion,
                   percent * t.search);
    std::fprintf(stderr, "  %lld samples, %.0f integration particles in the mean, %lld at most\n",
                 static_cast<long long>(statistics.samples), statistics.mean_integration,
                 static_cast<long long>(statistics.most_integration));
    if (statistics.reduced_steps > 0)
      std::fprintf(stderr, "  %lld of %lld steps were taken back and repeated at half the length\n",
                   static_cast<long long>(statistics.reduced_steps), static_cast<long long>(t.steps));
    if (statistics.loads_without_carriers > 0)
      std::fprintf(
          stderr,
          "graupel: warning: %lld of %zu loads began where there was no matter that can move, and did nothing\n",
          static_cast<long long>(statistics.loads_without_carriers), scene_.loads.size());
    std::fprintf(stderr, "  %s\n", trust_line(model_, run_.trust_record()).c_str());
    std::fprintf(stderr, "  trust, largest: residual %.3g, down-weighted %.3g, latent distance %.3g%s\n",
                 worst_.residual, worst_.down_weighted, worst_.latent_distance,
                 worst_.latent_distance > 1 ? " (above 1: further from the training than its own runs are)" : "");
  }

  nlohmann::ordered_json summary() const {
    const rom::ReducedStatistics statistics = run_.statistics();
    const rom::StepTiming& t = statistics.timing;
    const auto steps = static_cast<double>(std::max<int64_t>(1, t.steps));
    const std::optional<double>& bound = run_.trust_record().bound();
    return {{"output", options_.output},
            {"particles", run_.particle_type().size()},
            {"frames", seconds_.size()},
            {"parameters", run_.parameters()},
            {"seconds_per_frame", median_frame()},
            {"steps", t.steps},
            {"reduced_steps", statistics.reduced_steps},
            {"seconds_per_step",
             {{"decode", t.decode / steps},
              {"grid", t.grid / steps},
              {"inversion", t.inversion / steps},
              {"search", t.search / steps},
              {"all", t.total() / steps}}},
            {"samples", statistics.samples},
            {"integration_mean", statistics.mean_integration},
            {"integration_max", statistics.most_integration},
            {"trust",
             {{"residual", worst_.residual},
              {"down_weighted", worst_.down_weighted},
              {"latent_distance", worst_.latent_distance},
              {"number", run_.trust_record().number()},
              {"error_bound", bound ? nlohmann::ordered_json(*bound) : nlohmann::ordered_json()},
              {"verdict", rom::verdict_text(run_.trust_record().verdict())}}},
            {"points", refined_ ? refined_->particle_type().size() : 0},
            {"frames_written", written_},
            {"seconds_to_refine", median(refine_seconds_)},
            {"diverged_at_frame", diverged_at_}};
  }

  const RolloutOptions& options_;
  const Scene& scene_;
  int64_t frames_;
  const rom::ReducedModel& model_;
  ReducedRun run_;
  std::unique_ptr<RefinedBody> refined_;  ///< where it was asked for
  std::vector<GivenLoad> loads_;
  io::TrajectoryWriter writer_;  ///< last: what is refused before leaves no file
  int64_t written_ = 0;          ///< frames
  std::vector<float> trust_;     ///< [frames, 4]
  rom::ErrorIndicator worst_;
  std::vector<double> seconds_;         ///< of each frame
  std::vector<double> refine_seconds_;  ///< of each frame that was written
  int64_t diverged_at_ = -1;
  std::string trouble_;
};

}  // namespace

void rollout_reduced(const RolloutOptions& options) {
  const LoadedModel loaded(options.weights);
  const SceneAndSeed task = scene_and_seed(options);
  ReducedRollout(loaded, options, task).run();
}

}  // namespace graupel::experiments
