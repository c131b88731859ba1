// graupel_bench: speed of the solver and of the network on this machine.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "bench/micro/micro.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"

int main(int argc, char** argv) {
  using namespace graupel;
  CLI::App app{"Speed of Graupel's solver and network on this machine"};
  std::string device = "cpu", weights = "models/hgn.safetensors", scene = "scenes/shared/mixed_blocks.json", json;
  std::vector<int64_t> cells = {8, 17, 23};
  int threads = 0;
  bool no_hgn = false, no_mpm = false;
  app.add_option("--device", device, "cpu or cuda")->capture_default_str();
  app.add_option("--threads", threads, "CPU threads (0: all)")->capture_default_str();
  app.add_option("--cells", cells, "Edges of the falling cube in cells; 8 particles a cell")->capture_default_str();
  app.add_option("--weights", weights, "Network")->capture_default_str();
  app.add_option("--scene", scene, "Scene for the network")->capture_default_str();
  app.add_flag("--no-hgn", no_hgn, "MPM only");
  app.add_flag("--no-mpm", no_mpm, "Network only");
  app.add_option("--json", json, "Write the figures to this file");
  CLI11_PARSE(app, argc, argv);
  try {
    set_num_threads(threads);
    nlohmann::ordered_json result = {{"device", cuda_device_name()}};
    if (!no_mpm) result["mpm"] = bench::run_mpm(parse_device(device), cells);
    if (!no_hgn) result["hgn"] = bench::run_hgn(weights, scene);
    if (!json.empty()) write_file_atomically(json, result.dump(2) + "\n");
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "graupel_bench: %s\n", error.what());
    return 1;
  }
}
