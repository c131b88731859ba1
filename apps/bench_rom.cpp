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

namespace graupel::apps {

namespace {

using Json = nlohmann::ordered_json;

struct BenchRomOptions {
  CommonOptions common;
  std::string model, data, split = "test";
  std::vector<double> step_factors = {1};
  int64_t samples = 0, cluster = 0;
  rom::FitOptions fit;
  bool f64 = false, other_scene = false;
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
  reduced.fit = options.fit;
  if (options.samples > 0) {
    const auto n = std::min<std::size_t>(static_cast<std::size_t>(options.samples), model.encoder.size());
    std::vector<int32_t> samples;  // spread over the encoder's, which are drawn at random
    for (std::size_t i = 0; i < n; ++i) samples.push_back(model.encoder[i * model.encoder.size() / n]);
    reduced.samples = samples;
  }
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
                 {.arithmetic = options.f64 ? Arithmetic::f64 : Arithmetic::f32,
                  .foreign = options.other_scene ? ForeignScene::run : ForeignScene::refuse});
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
    std::printf("%12s %6.2f %9.4f %9.3f %7.3f %8.0f %8.0f %8.0f %8.0f %8.0f %8.0f %8.3f %6.3f %6.2f %7.3f\n",
                parameters.c_str(), factor, 100 * m.delta, 100 * m.displacement_relative, m.error_cells,
                m.statistics.mean_integration, per_step * t.total(), per_step * t.decode, per_step * t.grid,
                per_step * t.inversion, per_step * t.search, m.worst.residual, m.worst.down_weighted,
                m.worst.latent_distance, m.seconds);
  std::fflush(stdout);
}

void bench_rom(BenchRomOptions& options) {
  options.common.apply();
  LoadedModel loaded(options.model);
  if (options.cluster > 1) take_clusters(loaded.model, static_cast<int>(options.cluster));
  const io::TrajectoryReader reader(options.data + "/" + options.split + ".h5");
  Json rows = Json::array();
  std::printf("%12s %6s %9s %9s %7s %8s %8s %8s %8s %8s %8s %8s %6s %6s %7s\n", "parameters", "factor", "delta %",
              "displ. %", "cells", "|N|", "us/step", "decode", "grid", "invert", "search", "residual", "down", "latent",
              "s");
  for (const double factor : options.step_factors)
    for (int i = 0; i < reader.count(); ++i) {
      const Measured m = measure(options, loaded, reader, i, factor);
      print_row(m, factor);
      rows.push_back(json_of(m, factor));
    }
  options.common.write_json(
      {{"model", options.model}, {"data", options.data}, {"split", options.split}, {"rows", rows}});
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
  verb->add_option("--step-factor", options->step_factors, "Steps over those of the training (repeatable)")
      ->check(real_number(LowerBound::above_zero))
      ->capture_default_str();
  verb->add_option("--samples", options->samples, "So many random samples instead of the model's")
      ->check(whole_number(1));
  verb->add_option("--cluster", options->cluster, "So many particles as one integration point")->check(whole_number(1));
  verb->add_option("--outlier-factor", options->fit.outlier_factor,
                   "Samples count less beyond this multiple of the median distance (0: plain least squares)")
      ->check(real_number(LowerBound::zero))
      ->capture_default_str();
  verb->add_option("--iterations", options->fit.iterations, "Gauss-Newton iterations at most (1: first order)")
      ->check(whole_number(1))
      ->capture_default_str();
  verb->add_flag("--f64", options->f64, "Double precision");
  verb->add_flag(
      "--other-scene", options->other_scene,
      "Run the model even where a scene differs in more than its parameters (the particles must be the same)");
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel bench rom models/nsf-sand.safetensors data/nsf_sand_column\n"
      "  graupel bench rom sand.safetensors data/nsf_sand --step-factor 1 1.5 2 4 --json sand.json");
  verb->callback([options] { bench_rom(*options); });
}

}  // namespace graupel::apps
