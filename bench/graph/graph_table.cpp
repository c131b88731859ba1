#include "bench/graph/graph_table.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "bench/graph/graph_speed.h"
#include "bench/machine/roofline.h"
#include "core/parallel/instruction_set.h"
#include "core/system/installed_folder.h"
#include "experiments/process/process.h"
#include "experiments/process/sibling_program.h"
#include "io/trajectory/input_files.h"
#include "nn/bf16_gemm.h"

namespace graupel::bench {

using namespace experiments;

namespace {

using Json = nlohmann::ordered_json;

/// Time of a frame of "mpm" at a row's size and state; 0 where it was not asked for.
double mpm_frame(const std::vector<GraphBenchRow>& rows, const GraphBenchRow& row) {
  for (const GraphBenchRow& other : rows)
    if (other.model == "mpm" && other.scenes == 1 && other.state == row.state && other.particles == row.particles)
      return other.cost.frame;
  return 0;
}

std::string ratio_text(double ratio) { return ratio > 0 ? fmt::format("{:.2f}", ratio) : ""; }

/// Features, grid, network, projection [ms].
std::string parts_text(const GraphBenchRow& row) {
  const compare::RunCost& c = row.cost;
  if (row.libtorch) return "network alone";
  if (c.network == 0) return "";
  return fmt::format("{:.3g}, {:.3g}, {:.3g}, {:.3g}", 1e3 * c.features, 1e3 * c.grid_build, 1e3 * c.network,
                     1e3 * c.projection);
}

/// Of each length of rollout [ms].
std::string whole_text(const GraphBenchRow& row) {
  std::string text;
  for (const auto& [frames, seconds] : row.whole)
    text += fmt::format("{}{:.3g} ({})", text.empty() ? "" : ", ", 1e3 * seconds, frames);
  return text;
}

constexpr const char* table_head =
    "| particles | state | model | frames or scenes at once | ms a frame | with starts and results (frames) | "
    "mpm's over it | time over the engine's "
    "frame | "
    "features, grid, network, projection [ms] | network's GFLOP/s | of the products' rate | GPU memory [MB] |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|\n";

/// `rate` is the device's of products [FLOP/s]; 0: unknown.
void print_row(const GraphBenchRow& row, double mpm, double rate) {
  const double reached = row.flop_per_second();
  const double at_once = row.cost.network > 0 ? row.cost.bundle : static_cast<double>(row.scenes);
  const auto text = [](bool known, double value, const char* unit) {
    return known ? fmt::format("{:.3g}{}", value, unit) : std::string();
  };
  std::printf("| %zu | %s | %s | %.0f | %.3g | %s | %s | %s | %s | %s | %s | %s |\n", row.particles, row.state.c_str(),
              row.model.c_str(), at_once, 1e3 * row.cost.frame, whole_text(row).c_str(),
              ratio_text(row.libtorch ? 0 : mpm / row.cost.frame).c_str(), ratio_text(row.over_engine).c_str(),
              parts_text(row).c_str(), text(reached > 0, 1e-9 * reached, "").c_str(),
              text(reached > 0 && rate > 0, 100 * reached / rate, " %").c_str(),
              text(row.cost.device_bytes > 0, 1e-6 * row.cost.device_bytes, "").c_str());
  std::fflush(stdout);
}

Json json_of_libtorch(const GraphBenchRow& row) {
  const LibtorchTime& time = *row.libtorch;
  return {{"particles", row.particles},
          {"state", row.state},
          {"model", row.model},
          {"bundle", row.cost.bundle},
          {"network", row.cost.network},
          {"over_engine_frame", row.over_engine},
          {"flop", row.flop},
          {"gflop_per_second", 1e-9 * row.flop_per_second()},
          {"first_layers", name_of(time.first_layers)},
          {"libtorch", time.version},
          {"blas", time.blas},
          {"device", time.device},
          {"threads", time.threads},
          {"number_type", time.number_type}};
}

Json json_of(const GraphBenchRow& row, double mpm) {
  if (row.libtorch) return json_of_libtorch(row);
  const compare::RunCost& c = row.cost;
  Json json = {
      {"particles", row.particles}, {"state", row.state}, {"model", row.model}, {"seconds_per_frame", c.frame}};
  if (row.scenes > 1) json["scenes"] = row.scenes;
  if (mpm > 0) json["speed_against_mpm"] = mpm / c.frame;
  if (c.network > 0) {
    json["features"] = c.features;
    json["grid"] = c.grid_build;
    json["network"] = c.network;
    json["projection"] = c.projection;
    json["bundle"] = c.bundle;
    json["flop"] = row.flop;
    json["gflop_per_second"] = 1e-9 * row.flop_per_second();
  } else if (c.substeps > 0) {
    json["substeps_per_frame"] = c.substeps;
    json["search"] = c.search;
  }
  if (c.device_bytes > 0) json["device_bytes"] = c.device_bytes;
  if (c.output > 0 || row.scenes == 1) json["output"] = c.output;
  for (const auto& [frames, seconds] : row.whole)
    json["whole"].push_back({{"frames", frames}, {"seconds_per_frame", seconds}});
  if (row.scenes > 1) return json;
  json["peak_bytes"] = c.peak_bytes;
  return json;
}

}  // namespace

void print_graph_table(BenchGraphOptions& options) {
  options.recipe = or_installed(options.recipe);
  for (std::string& model : options.models)
    if (model.ends_with(".safetensors")) model = or_installed(model);  // "mpm" is a folder of the sources, too
  const Device device = options.common.device == "auto" ? Device::cpu : parse_device(options.common.device);
  options.common.apply();
  std::vector<NamedFile> inputs = {{"the recipe", options.recipe}};
  for (const std::string& model : options.models) inputs.push_back({"the weights", model});
  io::check_inputs_kept(inputs, {{"--json", options.common.json}});
  if (options.libtorch) path_of(training_program);  // refuses before the work
  GraphBench bench(options, device);
  const double rate = product_rate(device);
  const std::string arithmetic = device == Device::cuda
                                     ? "bf16 products"
                                     : fmt::format("{}, {}", name_of(instruction_set()), nn::gemm_precision_name());
  std::printf("%s, %s: %.4g GFLOP/s\n%s",
              device == Device::cuda ? cuda_device_name().c_str() : fmt::format("{} threads", num_threads()).c_str(),
              arithmetic.c_str(), 1e-9 * rate, table_head);
  Json results = Json::array();
  for (const int64_t particles : options.particles) {
    const std::vector<GraphBenchRow> rows = bench.measure(particles);
    for (const GraphBenchRow& row : rows) {
      print_row(row, mpm_frame(rows, row), rate);
      results.push_back(json_of(row, mpm_frame(rows, row)));
    }
  }
  options.common.write_json({{"version", version_text()},
                             {"command", command_line()},
                             {"device", device == Device::cuda ? cuda_device_name() : name_of(device)},
                             {"threads", num_threads()},
                             {"frames", options.frames},
                             {"arithmetic", arithmetic},
                             {"product_gflop_per_second", 1e-9 * rate},
                             {"rows", results}});
}

}  // namespace graupel::bench
