#include "bench/reduced/rom_bench.h"

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "bench/reduced/rom_rows.h"

namespace graupel::bench {

using namespace experiments;

namespace {

using Json = nlohmann::ordered_json;

void take_clusters(rom::ReducedModel& model, int size) {
  std::vector<Vec3f> reference;
  for (std::size_t i = 0; i < model.reference.size(); i += 3)
    reference.push_back({model.reference[i], model.reference[i + 1], model.reference[i + 2]});
  model.take_clusters(rom::make_clusters(reference, particle_kinds(model), size));
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
    std::vector<StoredRun> runs;
    for (int i = 0; i < reader_.count() && i < options_.instances; ++i) runs.emplace_back(reader_, i, file_);
    for (const double factor : factors()) {
      const GpuSteps steps =
          time_gpu_steps_of(model_, runs, run_options(options_.samples.front(), factor), options_.instances);
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
            .projection = rom::word_choice<rom::ProjectionKind>(options_.projection),
            .quadrature = rom::word_choice<rom::QuadratureKind>(options_.quadrature),
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
    if (train_ && baselines_.size() == at) baselines_.push_back(baselines_of_run(*train_, reader_, i));
    const auto naive = train_ ? std::optional(baselines_[at]) : std::nullopt;
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
  std::optional<TrainingRuns> train_;
  std::vector<Baselines> baselines_;  ///< of the runs so far
  Json rows_ = Json::array();
};

}  // namespace

nlohmann::ordered_json run_rom_bench(const BenchRomOptions& options) {
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

}  // namespace graupel::bench
