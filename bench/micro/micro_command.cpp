// graupel-bench micro: speed of the solver and of the network on this machine, in two short tables.
#include <memory>
#include <nlohmann/json.hpp>

#include "bench/commands.h"
#include "bench/micro/micro.h"
#include "core/system/atomic_file.h"
#include "core/system/installed_folder.h"
#include "io/trajectory/input_files.h"

namespace graupel::bench {

namespace {

struct MicroOptions {
  std::string device = "cpu", weights = "models/hgn.safetensors", scene = "scenes/shared/mixed_blocks.json", json;
  std::vector<int64_t> cells = {8, 17, 23};
  int threads = 0;
  bool no_hgn = false, no_mpm = false;
};

void run_micro(MicroOptions options) {
  options.weights = or_installed(options.weights);
  options.scene = or_installed(options.scene);
  check_output_file(options.json);
  io::check_inputs_kept({{"the weights", options.weights}, {"the scene", options.scene}}, {{"--json", options.json}});
  set_num_threads(options.threads);
  nlohmann::ordered_json result = {{"device", cuda_device_name()}};
  if (!options.no_mpm) result["mpm"] = run_mpm(parse_device(options.device), options.cells);
  if (!options.no_hgn) result["hgn"] = run_hgn(options.weights, options.scene);
  if (!options.json.empty()) write_file_atomically(options.json, result.dump(2) + "\n");
}

}  // namespace

void add_micro(const Command& program) {
  auto options = std::make_shared<MicroOptions>();
  const Command verb = program.command("micro", "Substeps of MPM and a frame of a network, by part: two short tables");
  verb.option("--device", options->device, "cpu or cuda").suggest({"cpu", "cuda"}).show_default();
  verb.option("--threads", options->threads, "CPU threads (0: all)").show_default();
  verb.option("--cells", options->cells, "Edges of the falling cube in cells; 8 particles a cell").show_default();
  verb.option("--weights", options->weights, "Network").names_file({".safetensors"}).show_default();
  verb.option("--scene", options->scene, "Scene for the network").names_file({".json"}).show_default();
  verb.flag("--no-hgn", options->no_hgn, "MPM only");
  verb.flag("--no-mpm", options->no_mpm, "Network only");
  verb.option("--json", options->json, "Write the figures to this file").names_file({".json"});
  verb.footer("Examples:\n  graupel bench micro\n  graupel bench micro --no-hgn --cells 17 --threads 1");
  verb.callback([options] { run_micro(*options); });
}

}  // namespace graupel::bench
