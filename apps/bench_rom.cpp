// graupel bench rom: a reduced-order model on the test runs of its data set: error, speed and trust.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/common_options.h"
#include "apps/reduced_runs.h"
#include "apps/verbs.h"
#include "compare/displacement_error.h"
#include "core/command_line.h"
#include "core/error.h"
#include "io/scene_reader.h"
#include "io/trajectory_file.h"
#include "rom/factored_fields.h"
#include "rom/sample_rules.h"

namespace graupel::apps {

namespace {

using Json = nlohmann::ordered_json;

struct BenchRomOptions {
  CommonOptions common;
  std::string model, data, split = "test";
  std::vector<double> step_factors;
  int64_t samples = 0, cluster = 0;
  std::string rule = "spread";
  std::vector<double> box;
  int iterations = rom::ReducedOptions().iterations;
  double outlier_factor = 0;
  std::optional<double> manifold_pull;
  CLI::Option* outlier_option = nullptr;
  bool f64 = false, keep_steps = false;
  int64_t instances = 1;
};

/// One run of the reduced model against a stored truth.
struct Measured {
  std::vector<double> parameters;
  bool stopped = false;
  std::string trouble;
  double delta = 0, displacement_relative = 0, error_cells = 0;
  double seconds = 0;
  rom::ReducedStatistics statistics;
  rom::TrustIndicator worst;
  std::vector<double> frame_error;  ///< relative to the displacement in that frame
  std::vector<rom::TrustIndicator> trust;
};

rom::ReducedOptions reduced_options(const BenchRomOptions& options, const rom::ReducedModel& model, double factor) {
  rom::ReducedOptions reduced;
  reduced.step_factor = factor;
  reduced.iterations = options.iterations;
  reduced.manifold_pull = options.manifold_pull;
  if (options.outlier_option->count() > 0) reduced.outlier_factor = options.outlier_factor;
  rom::SampleRule rule = rom::SampleRule::random;
  for (const auto& [word, value] : EnumWords<rom::SampleRule>::words)
    if (options.rule == word) rule = value;
  std::vector<int32_t> candidates = model.clusters.representatives();
  if (!options.box.empty())
    candidates = rom::points_within(candidates, model.reference, {options.box[0], options.box[1], options.box[2]},
                                    {options.box[3], options.box[4], options.box[5]});
  if (candidates.empty()) throw ConfigError("no integration point lies in the box of '--sample-box'. Widen it");
  if (options.keep_steps) reduced.long_steps = rom::LongSteps::kept;
  if (options.samples == 0) return reduced;
  const auto* factored = dynamic_cast<const rom::FactoredFields*>(model.fields.get());
  if (!factored && rule == rom::SampleRule::optimal)
    throw ConfigError("networks have no modes, by which the rule 'optimal' chooses. Use random or spread");
  reduced.samples =
      rom::choose_samples(rule, factored ? factored->deformation() : rom::ModeTable(), candidates, options.samples, 0);
  return reduced;
}

void take_clusters(rom::ReducedModel& model, int size) {
  std::vector<Vec3f> reference;
  for (std::size_t i = 0; i < model.reference.size(); i += 3)
    reference.push_back({model.reference[i], model.reference[i + 1], model.reference[i + 2]});
  model.take_clusters(rom::make_clusters(reference, particle_kinds(model), size));
}

Measured measure(const BenchRomOptions& options, const LoadedModel& loaded, const io::TrajectoryReader& reader, int i,
                 double factor) {
  const Trajectory header = reader.header(i);
  const std::string file = options.data + "/" + options.split + ".h5";
  const Scene scene = io::parse_stored_scene(header.scene_json, file, file);
  ReducedRun run(loaded, scene, header.seed, reduced_options(options, loaded.model, factor),
                 options.f64 ? Arithmetic::f64 : Arithmetic::f32, OutsideRange::warn,
                 device_of_reduced_models(options.common.device));
  Measured result;
  result.parameters = run.parameters();
  const std::vector<Vec3f> reference = reader.frames(i, 0, 1).front().position;
  compare::DisplacementError error(reference);
  const auto frames = static_cast<int64_t>(header.frame_count());
  try {
    for (int64_t f = 1; f < frames; ++f) {
      stop_if_interrupted();
      const auto begin = std::chrono::steady_clock::now();
      run.advance_frame();
      result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      const std::vector<Vec3f> truth = reader.frames(i, f, 1).front().position, position = run.frame().position;
      error.add(truth, position);
      compare::DisplacementError now(reference);
      now.add(truth, position);
      result.frame_error.push_back(now.displacement_relative());
      result.trust.push_back(run.trust());
      result.worst.residual = std::max(result.worst.residual, run.trust().residual);
      result.worst.down_weighted = std::max(result.worst.down_weighted, run.trust().down_weighted);
      result.worst.latent_distance = std::max(result.worst.latent_distance, run.trust().latent_distance);
    }
  } catch (const DivergedError& stop) {
    result.stopped = true;
    result.trouble = stop.what();
  }
  result.delta = error.delta();
  result.displacement_relative = error.displacement_relative();
  result.error_cells = error.root_mean_square() / scene.domain.dx;
  result.statistics = run.statistics();
  return result;
}

Json json_of(const Measured& m, double factor) {
  const rom::StepTiming& t = m.statistics.timing;
  const auto steps = static_cast<double>(std::max<int64_t>(1, t.steps));
  Json json = {{"parameters", m.parameters}, {"step_factor", factor}, {"stopped", m.stopped}};
  if (m.stopped) {
    json["trouble"] = m.trouble;
  } else {
    json["delta"] = m.delta;
    json["displacement_relative_error"] = m.displacement_relative;
    json["error_cells"] = m.error_cells;
  }
  json["samples"] = m.statistics.samples;
  json["integration_mean"] = m.statistics.mean_integration;
  json["integration_max"] = m.statistics.most_integration;
  json["steps"] = t.steps;
  json["reduced_steps"] = m.statistics.reduced_steps;
  json["seconds"] = m.seconds;
  json["seconds_per_step"] = {{"decode", t.decode / steps},
                              {"grid", t.grid / steps},
                              {"inversion", t.inversion / steps},
                              {"search", t.search / steps},
                              {"all", t.total() / steps}};
  json["iterations"] = m.statistics.mean_iterations;
  json["condition"] = m.statistics.largest_condition;
  json["bytes"] = m.statistics.bytes;
  json["trust"] = {{"residual", m.worst.residual},
                   {"down_weighted", m.worst.down_weighted},
                   {"latent_distance", m.worst.latent_distance}};
  json["frame_displacement_relative_error"] = m.frame_error;
  for (const rom::TrustIndicator& trust : m.trust) {
    json["frame_trust"]["residual"].push_back(trust.residual);
    json["frame_trust"]["down_weighted"].push_back(trust.down_weighted);
    json["frame_trust"]["latent_distance"].push_back(trust.latent_distance);
  }
  return json;
}

void print_row(const Measured& m, double factor) {
  std::string parameters;
  for (const double value : m.parameters) parameters += fmt::format("{:g} ", value);
  const rom::StepTiming& t = m.statistics.timing;
  const double per_step = 1e6 / static_cast<double>(std::max<int64_t>(1, t.steps));
  if (m.stopped)
    std::printf("%12s %6.2f  stopped after %lld steps: %s\n", parameters.c_str(), factor,
                static_cast<long long>(t.steps), m.trouble.c_str());
  else
    std::printf("%12s %6.2f %9.4f %9.3f %7.3f %8.0f %8.0f %8.0f %8.0f %8.0f %8.0f %8.3f %6.3f %6.2f %7lld %7.3f\n",
                parameters.c_str(), factor, 100 * m.delta, 100 * m.displacement_relative, m.error_cells,
                m.statistics.mean_integration, per_step * t.total(), per_step * t.decode, per_step * t.grid,
                per_step * t.inversion, per_step * t.search, m.worst.residual, m.worst.down_weighted,
                m.worst.latent_distance, static_cast<long long>(m.statistics.reduced_steps), m.seconds);
  std::fflush(stdout);
}

/// Steps on a GPU alone: the first run of the split, `instances` times, with parameters spread around its own.
Json time_on_gpu(const BenchRomOptions& options, const LoadedModel& loaded, const io::TrajectoryReader& reader,
                 double factor) {
  constexpr int warm_up = 3, measured = 20;  // frames; the run starts anew when its scene ends
  const Trajectory header = reader.header(0);
  const std::string file = options.data + "/" + options.split + ".h5";
  const Scene scene = io::parse_stored_scene(header.scene_json, file, file);
  const rom::ReducedInstance one{mpm::PreparedScene(scene, {.device = Device::cpu, .seed = header.seed}),
                                 parameters_of(loaded, scene)};
  std::vector<rom::ReducedInstance> instances(static_cast<std::size_t>(options.instances), one);
  for (std::size_t i = 0; i < instances.size(); ++i)
    for (std::size_t p = 0; p < one.parameters.size(); ++p) {
      const rom::ModelParameter& known = loaded.model.parameters[p];
      const double place = (static_cast<double>(i) + 0.5) / static_cast<double>(instances.size());
      if (instances.size() > 1) instances[i].parameters[p] = known.low + place * (known.high - known.low);
    }
  rom::ReducedDeviceSolver solver(loaded.model, std::move(instances), reduced_options(options, loaded.model, factor));
  std::vector<double> step;
  for (int64_t f = 0; f < std::min<int64_t>(warm_up + measured, scene.frames); ++f) {
    const double seconds = solver.timed_frame() / static_cast<double>(solver.steps_per_frame());
    if (f >= warm_up) step.push_back(seconds);
  }
  if (step.empty())
    throw ConfigError(fmt::format("the scene has {} frames, too few to time steps (allowed: {} and more). Use another",
                                  scene.frames, warm_up + 1));
  std::sort(step.begin(), step.end());
  const double median = 1e6 * step[step.size() / 2], low = 1e6 * step.front(), high = 1e6 * step.back();
  int64_t diverged = 0;
  for (int i = 0; i < solver.count(); ++i) diverged += solver.divergence(i) ? 1 : 0;
  const rom::ReducedStatistics statistics = solver.statistics(0);
  std::printf(
      "on the GPU, %lld instances: %.2f us a step of all (median of %zu frames of %lld steps; %.2f to %.2f), %.3f us "
      "an "
      "instance; %lld samples, %.0f integration points, %.1f iterations, %.2f GB; %lld diverged\n",
      static_cast<long long>(options.instances), median, step.size(), static_cast<long long>(solver.steps_per_frame()),
      low, high, median / static_cast<double>(options.instances), static_cast<long long>(statistics.samples),
      statistics.mean_integration, statistics.mean_iterations, 1e-9 * static_cast<double>(statistics.bytes),
      static_cast<long long>(diverged));
  return {{"instances", options.instances},
          {"step_factor", factor},
          {"us_per_step", median},
          {"us_per_step_low", low},
          {"us_per_step_high", high},
          {"steps_per_frame", solver.steps_per_frame()},
          {"integration_mean", statistics.mean_integration},
          {"iterations", statistics.mean_iterations},
          {"bytes", statistics.bytes},
          {"diverged", diverged}};
}

void bench_rom(BenchRomOptions& options) {
  options.common.apply();
  const Device device = device_of_reduced_models(options.common.device);
  if (options.instances > 1 && device != Device::cuda)
    throw ConfigError(
        "--instances is of the GPU (on the CPU one run follows the other; allowed there: 1). Add --device "
        "cuda");
  LoadedModel loaded(options.model);
  if (options.cluster > 1) take_clusters(loaded.model, static_cast<int>(options.cluster));
  const io::TrajectoryReader reader(options.data + "/" + options.split + ".h5");
  Json rows = Json::array(), steps = Json::array();
  std::printf("%12s %6s %9s %9s %7s %8s %8s %8s %8s %8s %8s %8s %6s %6s %7s %7s\n", "parameters", "factor", "delta %",
              "displ. %", "cells", "|N|", "us/step", "decode", "grid", "invert", "search", "residual", "down", "latent",
              "reduced", "s");
  if (options.step_factors.empty()) options.step_factors = {loaded.model.step_factor};
  for (const double factor : options.step_factors)
    for (int i = 0; i < reader.count(); ++i) {
      const Measured m = measure(options, loaded, reader, i, factor);
      print_row(m, factor);
      rows.push_back(json_of(m, factor));
    }
  if (device == Device::cuda)
    for (const double factor : options.step_factors) steps.push_back(time_on_gpu(options, loaded, reader, factor));
  options.common.write_json({{"model", options.model},
                             {"data", options.data},
                             {"split", options.split},
                             {"rows", rows},
                             {"gpu_steps", steps}});
}

}  // namespace

void add_bench_rom(CLI::App& bench) {
  auto options = std::make_shared<BenchRomOptions>();
  CLI::App* verb = bench.add_subcommand("rom", "A reduced-order model on the test runs of its data set");
  verb->add_option("model", options->model, "Weights file (.safetensors)")->required();
  verb->add_option("data", options->data, "Folder of the data set")->required();
  verb->add_option("--split", options->split, "test, valid or train")
      ->check(CLI::IsMember({"train", "valid", "test"}))
      ->capture_default_str();
  verb->add_option("--step-factor", options->step_factors,
                   "Steps over those of the training, instead of the model's (repeatable)")
      ->check(real_number(LowerBound::above_zero));
  verb->add_option("--samples", options->samples, "So many samples instead of the model's")->check(whole_number(1));
  verb->add_option("--sample-box", options->box, "With --samples: within this box of the reference body: low, high [m]")
      ->expected(6);
  verb->add_option("--sample-rule", options->rule, "With --samples: random, spread or optimal")
      ->check(CLI::IsMember({"random", "spread", "optimal"}))
      ->capture_default_str();
  verb->add_option("--cluster", options->cluster, "So many particles as one integration point")->check(whole_number(1));
  options->outlier_option = verb->add_option("--outlier-factor", options->outlier_factor,
                                             "Samples count less beyond this multiple of the median distance (0: plain "
                                             "least squares) instead of the model's")
                                ->check(real_number(LowerBound::zero));
  verb->add_option("--manifold-pull", options->manifold_pull,
                   "Share of the way back to the states of the training that a step takes, instead of the model's")
      ->check(CLI::Range(0.0, 1.0));
  verb->add_option("--iterations", options->iterations, "Gauss-Newton iterations at most (1: first order)")
      ->check(whole_number(1))
      ->capture_default_str();
  verb->add_flag("--keep-steps", options->keep_steps, "Repeat no step at half the length where it leaves too much");
  verb->add_flag("--f64", options->f64, "Double precision");
  verb->add_option("--instances", options->instances, "With --device cuda: so many runs at once while steps are timed")
      ->check(whole_number(1))
      ->capture_default_str();
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel bench rom models/nsf-sand.safetensors data/nsf_sand_column\n"
      "  graupel bench rom sand.safetensors data/nsf_sand --step-factor 1 1.5 2 4 --json sand.json");
  verb->callback([options] { bench_rom(*options); });
}

}  // namespace graupel::apps
