// graupel bench rom: a reduced-order model on the test runs of its data set: error, trust, speed, and what needs no
// model.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "experiments/process/common_options.h"
#include "bench/reduced/rom_gpu_steps.h"
#include "bench/reduced/rom_measurement.h"
#include "bench/reduced/rom_plots.h"
#include "apps/verbs.h"
#include "core/system/atomic_file.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "bench/reduced/naive_answers.h"

namespace graupel::bench {

using namespace experiments;

namespace {

using Json = nlohmann::ordered_json;

struct BenchRomOptions {
  CommonOptions common;
  std::string model, data, split = "test", plot;
  std::vector<std::string> from, against;
  std::vector<double> step_factors;
  std::vector<int64_t> samples = {0};
  int64_t cluster = 0;
  std::string rule = "spread";
  std::vector<double> box;
  std::optional<int> iterations;
  std::optional<double> manifold_pull;
  double outlier_factor = 0;  ///< removed; 0 alone is allowed
  bool f64 = false, other_scene = false, keep_steps = false;
  int64_t instances = 1;
};

void take_clusters(rom::ReducedModel& model, int size) {
  std::vector<Vec3f> reference;
  for (std::size_t i = 0; i < model.reference.size(); i += 3)
    reference.push_back({model.reference[i], model.reference[i + 1], model.reference[i + 2]});
  model.take_clusters(rom::make_clusters(reference, particle_kinds(model), size));
}

Json json_of(const NaiveErrors& errors) {
  return {{"delta", errors.delta}, {"displacement_relative_error", errors.displacement_relative}};
}

Json json_of(const NaiveAnswers& naive) {
  Json json = {{"nothing_moves", json_of(naive.nothing_moves)}, {"nearest_run", json_of(naive.nearest)}};
  json["between_runs"] = naive.linear ? json_of(*naive.linear) : Json();
  return json;
}

Json json_of(const SpeedComparison& speed) {
  return {{"against", speed.against},
          {"diverged", speed.diverged},
          {"mpm_seconds_per_frame", speed.mpm_frame},
          {"rom_seconds_per_frame", speed.rom_frame},
          {"speedup", speed.rom_frame > 0 ? speed.mpm_frame / speed.rom_frame : 0},
          {"mpm_substeps_per_frame", speed.substeps},
          {"search_seconds", speed.search_seconds}};
}

Json cost_json(const RomMeasurement& m) {
  const rom::StepTiming& t = m.statistics.timing;
  const auto steps = static_cast<double>(std::max<int64_t>(1, t.steps));
  return {{"integration_mean", m.statistics.mean_integration},
          {"integration_max", m.statistics.most_integration},
          {"steps", t.steps},
          {"reduced_steps", m.statistics.reduced_steps},
          {"seconds", m.seconds},
          {"seconds_per_step",
           {{"decode", t.decode / steps},
            {"grid", t.grid / steps},
            {"inversion", t.inversion / steps},
            {"search", t.search / steps},
            {"gpu", t.device / steps},
            {"all", t.total() / steps}}},
          {"iterations", m.statistics.mean_iterations},
          {"condition", m.statistics.largest_condition},
          {"accounted_bytes", m.statistics.bytes},
          {"process_added_bytes", m.added_bytes}};
}

Json trust_json(const RomMeasurement& m) {
  rom::TrustIndicator worst;
  Json frames = Json::object();
  for (const rom::TrustIndicator& frame : m.trust) {
    worst.residual = std::max(worst.residual, frame.residual);
    worst.down_weighted = std::max(worst.down_weighted, frame.down_weighted);
    worst.latent_distance = std::max(worst.latent_distance, frame.latent_distance);
    frames["residual"].push_back(frame.residual);
    frames["down_weighted"].push_back(frame.down_weighted);
    frames["latent_distance"].push_back(frame.latent_distance);
  }
  frames["number"] = m.trust_numbers;
  return {{"number", m.trust_number},
          {"verdict", rom::verdict_text(m.verdict)},
          {"residual", worst.residual},
          {"down_weighted", worst.down_weighted},
          {"latent_distance", worst.latent_distance},
          {"frames", frames}};
}

Json json_of(const RomMeasurement& m, double factor) {
  Json json = {{"parameters", m.parameters}, {"step_factor", factor}, {"diverged", m.diverged}};
  if (m.diverged) {
    json["trouble"] = m.trouble;
  } else {
    json["delta"] = m.delta;
    json["displacement_relative_error"] = m.displacement_relative;
    json["error_cells"] = m.error_cells;
    if (m.stress) json["stress_error"] = {{"particles", m.stress->particles}, {"clusters", m.stress->clusters}};
  }
  json["samples"] = m.statistics.samples;
  json.update(cost_json(m));
  json["trust"] = trust_json(m);
  json["frame_displacement_relative_error"] = m.frame_error;
  return json;
}

Json json_of(const GpuSteps& steps, double factor) {
  return {{"instances", steps.instances},
          {"step_factor", factor},
          {"us_per_step", steps.median},
          {"us_per_step_low", steps.low},
          {"us_per_step_high", steps.high},
          {"steps_per_frame", steps.steps_per_frame},
          {"integration_mean", steps.statistics.mean_integration},
          {"kernel_seconds", steps.kernels},
          {"bytes", steps.statistics.bytes},
          {"diverged", steps.diverged}};
}

void print_gpu_steps(const GpuSteps& s) {
  std::printf(
      "on the GPU, %lld instances: %.2f us a step of all (median of %lld frames of %lld steps; %.2f to %.2f), %.3f us "
      "an "
      "instance; %lld samples, %.0f integration points, %.2f GB; %lld diverged\n"
      "each kernel alone: branch %.1f us, decode %.1f, gather %.1f, fit %.1f\n",
      static_cast<long long>(s.instances), s.median, static_cast<long long>(s.frames),
      static_cast<long long>(s.steps_per_frame), s.low, s.high, s.median / static_cast<double>(s.instances),
      static_cast<long long>(s.statistics.samples), s.statistics.mean_integration,
      1e-9 * static_cast<double>(s.statistics.bytes), static_cast<long long>(s.diverged), 1e6 * s.kernels[0],
      1e6 * s.kernels[1], 1e6 * s.kernels[2], 1e6 * s.kernels[3]);
}

std::string parameters_text(const RomMeasurement& m) {
  std::string text;
  for (const double value : m.parameters) text += fmt::format("{:g} ", value);
  return text;
}

void print_header() {
  std::printf("%12s %6s %5s %8s %8s %7s %8s | %7s %7s %7s | %6s %-12s | %7s %7s %7s %7s %7s %7s %7s %7s\n",
              "parameters", "factor", "|S|", "delta %", "displ. %", "cells", "stress %", "still %", "near %", "line %",
              "trust", "verdict", "|N|", "most", "us/step", "decode", "grid", "invert", "search", "MiB");
}

void print_row(const RomMeasurement& m, double factor, const std::optional<NaiveAnswers>& naive) {
  const rom::StepTiming& t = m.statistics.timing;
  const double per_step = 1e6 / static_cast<double>(std::max<int64_t>(1, t.steps));
  std::printf("%12s %6.2f %5lld ", parameters_text(m).c_str(), factor, static_cast<long long>(m.statistics.samples));
  if (m.diverged) {
    std::printf("diverged after %lld steps: %s\n", static_cast<long long>(t.steps), m.trouble.c_str());
    return;
  }
  const auto percent = [](double share) { return fmt::format("{:.2f}", 100 * share); };
  const std::string stress = m.stress ? percent(m.stress->clusters) : "-";
  const std::string still = naive ? percent(naive->nothing_moves.displacement_relative) : "-",
                    near = naive ? percent(naive->nearest.displacement_relative) : "-",
                    line = naive && naive->linear ? percent(naive->linear->displacement_relative) : "-";
  std::printf("%8.4f %8.3f %7.3f %8s | %7s %7s %7s | %6.2f %-12s | ", 100 * m.delta, 100 * m.displacement_relative,
              m.error_cells, stress.c_str(), still.c_str(), near.c_str(), line.c_str(), m.trust_number,
              rom::verdict_text(m.verdict));
  std::printf("%7.0f %7lld %7.0f %7.0f %7.0f %7.0f %7.0f %7.1f\n", m.statistics.mean_integration,
              static_cast<long long>(m.statistics.most_integration), per_step * t.total(), per_step * t.decode,
              per_step * t.grid, per_step * t.inversion, per_step * t.search, m.added_bytes / (1 << 20));
}

void print_speed(const SpeedComparison& speed) {
  std::printf("%12s %s: %.3g ms a frame in %.1f steps, the reduced model %.3g ms: %.2f times as fast%s\n", "",
              speed.against.c_str(), 1e3 * speed.mpm_frame, speed.substeps, 1e3 * speed.rom_frame,
              speed.rom_frame > 0 ? speed.mpm_frame / speed.rom_frame : 0, speed.diverged ? " (one diverged)" : "");
}

/// Every run of the split with every number of samples and step factor.
class RomBench {
 public:
  RomBench(const BenchRomOptions& options, const LoadedModel& model)
      : options_(options), model_(model), file_(options.data + "/" + options.split + ".h5"), reader_(file_) {
    const std::string train = options.data + "/train.h5";
    if (std::filesystem::exists(train) && !options.other_scene) train_.emplace(train);
  }

  Json run() {
    print_header();
    for (const int64_t samples : options_.samples)
      for (const double factor : factors())
        for (int i = 0; i < reader_.count(); ++i) measure(i, samples, factor);
    return rows_;
  }

  /// Steps on a GPU alone, of as many instances as were asked for.
  Json time_gpu_steps() {
    Json rows = Json::array();
    const StoredRun first(reader_, 0, file_);
    for (const double factor : factors()) {
      const GpuSteps steps =
          time_gpu_steps_of(model_, first, run_options(options_.samples.front(), factor), options_.instances);
      print_gpu_steps(steps);
      rows.push_back(json_of(steps, factor));
    }
    return rows;
  }

 private:
  rom::SampleRule sample_rule() const {
    rom::SampleRule rule = rom::SampleRule::random;
    for (const auto& [word, value] : EnumWords<rom::SampleRule>::words)
      if (options_.rule == word) rule = value;
    return rule;
  }

  std::vector<double> factors() const {
    return options_.step_factors.empty() ? std::vector<double>{model_.model.step_factor} : options_.step_factors;
  }

  RomRunOptions run_options(int64_t samples, double factor) const {
    return {.step_factor = factor,
            .long_steps = options_.keep_steps ? rom::LongSteps::kept : rom::LongSteps::shortened,
            .samples = samples,
            .rule = sample_rule(),
            .box = options_.box,
            .iterations = options_.iterations,
            .manifold_pull = options_.manifold_pull,
            .arithmetic = options_.f64 ? Arithmetic::f64 : Arithmetic::f32,
            .foreign = options_.other_scene ? ForeignScene::run : ForeignScene::refuse,
            .device = device_of_reduced_models(options_.common.device)};
  }

  void measure(int i, int64_t samples, double factor) {
    const StoredRun truth(reader_, i, file_);
    const RomRunOptions run = run_options(samples, factor);
    const RomMeasurement m = measure_rom(model_, truth, run);
    Json row = json_of(m, factor);
    const auto at = static_cast<std::size_t>(i);
    if (train_ && naive_.size() == at) naive_.push_back(naive_answers(*train_, reader_, i));
    const auto naive = train_ ? std::optional(naive_[at]) : std::nullopt;
    if (naive) row["naive"] = json_of(*naive);
    print_row(m, factor, naive);
    for (const std::string& against : options_.against) {
      const SpeedComparison speed = compare_speed(model_, truth, run, against);
      print_speed(speed);
      row["speed"].push_back(json_of(speed));
    }
    std::fflush(stdout);
    rows_.push_back(std::move(row));
  }

  const BenchRomOptions& options_;
  const LoadedModel& model_;
  std::string file_;
  io::TrajectoryReader reader_;
  std::optional<io::TrajectoryReader> train_;
  std::vector<NaiveAnswers> naive_;  ///< of the runs so far
  Json rows_ = Json::array();
};

Json measured(const BenchRomOptions& options) {
  LoadedModel loaded(options.model);
  if (options.cluster > 1) take_clusters(loaded.model, static_cast<int>(options.cluster));
  RomBench bench(options, loaded);
  Json rows = bench.run();
  const auto config = loaded.model.provenance.find("config");
  Json result = {{"model", options.model}, {"data", options.data}, {"split", options.split}};
  result["settings"] = config == loaded.model.provenance.end() ? Json::object() : Json::parse(config->second);
  result["threads"] = num_threads();
  result["usual_error"] = loaded.model.usual_error;
  result["singular_values"] = Json::object();
  for (const auto& [field, values] : loaded.model.singular_values) result["singular_values"][field] = values;
  result["rows"] = std::move(rows);
  if (device_of_reduced_models(options.common.device) == Device::cuda) result["gpu_steps"] = bench.time_gpu_steps();
  return result;
}

void bench_rom(BenchRomOptions& options) {
  options.common.apply();
  if (options.from.empty() == options.data.empty())
    throw ConfigError("bench rom needs a model and its data set, or --from with earlier results (not both)");
  if (!options.from.empty() && options.plot.empty())
    throw ConfigError("--from has no use without --plot. Name the folder of the plots");
  if (options.instances > 1 && device_of_reduced_models(options.common.device) != Device::cuda)
    throw ConfigError(
        "--instances is of the GPU (on the CPU one run follows the other; allowed there: 1). Add --device cuda");
  std::vector<Json> results;
  for (const std::string& file : options.from) {
    try {
      results.push_back(Json::parse(read_file(file)));
    } catch (const Json::exception& error) {
      throw InputError("'" + file + "' is no JSON (" + error.what() + "). Make it with 'graupel bench rom --json'");
    }
  }
  if (options.from.empty()) {
    results.push_back(measured(options));
    options.common.write_json(results.back());
  }
  if (options.plot.empty()) return;
  for (const std::string& file : write_rom_plots(results, options.plot)) std::fprintf(stderr, "%s\n", file.c_str());
}

void add_run_flags(CLI::App& verb, BenchRomOptions& options) {
  verb.add_option("--step-factor", options.step_factors,
                  "Steps over those of the training, instead of the model's: 1,1.5,2,4")
      ->delimiter(',')
      ->check(real_number(LowerBound::above_zero));
  verb.add_option("--samples", options.samples, "So many samples instead of the model's: 50,100,300")
      ->delimiter(',')
      ->check(whole_number(1))
      ->default_str("the model's");
  verb.add_option("--sample-box", options.box, "With --samples: within this box of the reference body: low, high [m]")
      ->expected(6);
  verb.add_option("--sample-rule", options.rule, "With --samples: random, spread or patches")
      ->check(CLI::IsMember({"random", "spread", "patches"}))
      ->capture_default_str();
  verb.add_option("--cluster", options.cluster, "So many particles as one integration point")->check(whole_number(1));
  verb.add_option("--outlier-factor", options.outlier_factor,
                  "Removed: samples that count less gained nothing beside --manifold-pull; 0 alone is allowed")
      ->check(CLI::Range(0.0, 0.0));
  verb.add_option("--manifold-pull", options.manifold_pull,
                  "Share of the way back to the states of the training that a step takes, instead of the model's")
      ->check(CLI::Range(0.0, 1.0));
  verb.add_option("--iterations", options.iterations, "Gauss-Newton iterations at most (by default 1)")
      ->check(whole_number(1));
  verb.add_flag("--keep-steps", options.keep_steps, "Repeat no step at half the length where it leaves too much");
  verb.add_flag("--f64", options.f64, "Double precision");
  verb.add_option("--instances", options.instances, "With --device cuda: so many runs at once while steps are timed")
      ->check(whole_number(1))
      ->capture_default_str();
  verb.add_flag(
      "--other-scene", options.other_scene,
      "Run the model even where a scene differs in more than its parameters (the particles must be the same)");
}

}  // namespace

void add_bench_rom(CLI::App& bench) {
  auto options = std::make_shared<BenchRomOptions>();
  CLI::App* verb = bench.add_subcommand("rom", "A reduced-order model on the test runs of its data set");
  CLI::Option* model = verb->add_option("model", options->model, "Weights file (.safetensors)");
  verb->add_option("data", options->data, "Folder of the data set")->needs(model);
  verb->add_option("--split", options->split, "test, valid or train")
      ->check(CLI::IsMember({"train", "valid", "test"}))
      ->capture_default_str();
  add_run_flags(*verb, *options);
  verb->add_option("--against", options->against, "The full-order solver, frame by frame in turn: mpm,mpm:fast")
      ->delimiter(',')
      ->check(CLI::IsMember({"mpm", "mpm:fast"}));
  verb->add_option("--plot", options->plot, "Folder for plots as SVG: trust, decay of the modes, errors over settings");
  verb->add_option("--from", options->from, "Plot these earlier --json files instead of a run");
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel bench rom models/nsf-sand.safetensors data/nsf_sand_column --against mpm,mpm:fast\n"
      "  graupel bench rom sand.safetensors data/nsf_sand --step-factor 1,1.5,2,4 --json sand.json\n"
      "  graupel bench rom --from r2.json r4.json r6.json --plot plots");
  verb->callback([options] { bench_rom(*options); });
}

}  // namespace graupel::bench
