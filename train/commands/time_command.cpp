#include "train/commands/time_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/parallel/device.h"
#include "core/system/atomic_file.h"
#include "core/system/command_line.h"
#include "core/system/stop_signal.h"
#include "train/commands/network_timing.h"
#include "train/commands/run_log.h"
#include "train/commands/run_outputs.h"
#include "train/networks/network_module.h"
#include "train/parallel/blas_threads.h"
#include "train/parallel/rank_environment.h"

namespace graupel::train {

namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string weights, data, json, device = "auto", first_layers = "whole";
  NetworkTimingOptions timing;
};

void time_and_print(const Arguments& arguments, const std::string& command_line) {
  require_one_process("'graupel train time'");
  check_run_outputs({{"the weights", arguments.weights}, {"the trajectory", arguments.data}}, "", arguments.json);
  NetworkTimingOptions options = arguments.timing;
  set_num_threads(options.threads);
  options.threads = num_threads();
  options.device = device_for_torch(arguments.device);
  options.first_layers = arguments.first_layers == "whole" ? graph::FirstLayers::whole : graph::FirstLayers::split;
  const NetworkTime time = time_network(nn::read_safetensors(arguments.weights), arguments.data, options);
  const bool gpu = options.device == Device::cuda;
  const char* const number_type = gpu ? "tf32" : "f32";
  const double rate = 1e-9 * time.flop / time.median();
  const std::string blas = blas_description();
  const std::string line = fmt::format(
      "{} in libtorch {}, first layers {}: {:.3g} ms a frame of {} particles, {:.3g} GFLOP, {:.3g} GFLOP/s "
      "({}, {}; median of {}, fastest {:.3g} ms){}",
      arguments.weights, torch_version(), name_of(options.first_layers), 1e3 * time.median(), time.particles,
      1e-9 * time.flop, rate, number_type, gpu ? cuda_device_name() : fmt::format("{} CPU threads", options.threads),
      time.seconds.size(), 1e3 * time.seconds.front(), gpu || blas.empty() ? "" : "; " + blas);
  std::fprintf(stderr, "%s\n", line.c_str());
  const Json json = {{"version", "graupel-train " GRAUPEL_VERSION},
                     {"libtorch", torch_version()},
                     {"blas", blas},
                     {"command", command_line},
                     {"weights", arguments.weights},
                     {"architecture", word_of(time.architecture)},
                     {"device", gpu ? cuda_device_name() : name_of(options.device)},
                     {"threads", options.threads},
                     {"number_type", number_type},
                     {"first_layers", name_of(options.first_layers)},
                     {"particles", time.particles},
                     {"runs", time.seconds.size()},
                     {"seconds", time.median()},
                     {"fastest_seconds", time.seconds.front()},
                     {"flop", time.flop},
                     {"gflop_per_second", rate}};
  if (!arguments.json.empty()) write_file_atomically(arguments.json, json.dump(2) + "\n");
}

}  // namespace

void add_time_command(const Command& app, const std::string& command_line) {
  auto a = std::make_shared<Arguments>();
  a->timing.threads = 0;
  const Command verb = app.command("time", "Time of a graph network in libtorch, without features and graph");
  verb.option("weights", a->weights, "Weights file of an HGN or a GNS").names_file({".safetensors"}).required();
  verb.option("--data", a->data, "Trajectory (.h5); the network is timed at its end").names_file({".h5"}).required();
  verb.option("--runs", a->timing.runs, "Runs to time (median)").check(whole_number(1)).show_default();
  verb.option("--warm-ups", a->timing.warm_ups, "Runs before those").check(whole_number(0)).show_default();
  verb.option("--first-layers", a->first_layers, "Over whole inputs, or split into a part a node (see below)")
      .check(one_of({"whole", "split"}))
      .show_default();
  verb.option("--device", a->device, "auto, cpu or cuda").suggest({"auto", "cpu", "cuda"}).show_default();
  verb.option("--threads", a->timing.threads, "CPU threads (0: all)").check(whole_number(0, 4096)).show_default();
  verb.option("--json", a->json, "Write the result as JSON to this file (-: standard output)").names_file({".json"});
  verb.footer(
      "Inference in f32 on the CPU, with TF32 products on a GPU. First layers 'whole': over concatenated inputs, in\n"
      "libtorch's own operations, as the papers write the networks; 'split': as training and Graupel's engine "
      "evaluate\n"
      "them. 'graupel bench graph --libtorch' puts both beside that engine.\n\n"
      "Examples:\n  graupel train time models/hgn.safetensors --data steps.h5\n"
      "  graupel train time models/hgn.safetensors --data steps.h5 --threads 1 --json -");
  verb.callback([a, command_line] {
    catch_stop_signals(StopPolicy::at_once);
    time_and_print(*a, command_line);
  });
}

}  // namespace graupel::train
