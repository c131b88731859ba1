// graupel-train: trains and evaluates the learned simulators. Parses the command line, calls train/, prints.
#include <fmt/format.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <exception>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>

#include "core/parallel/instruction_set.h"
#include "core/system/atomic_file.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/last_resort.h"
#include "core/system/printable.h"
#include "core/system/standard_output.h"
#include "core/system/stop_signal.h"
#include "graph/features/normalization.h"
#include "io/config/command_json.h"
#include "train/commands/coarse_command.h"
#include "train/commands/crom_command.h"
#include "train/commands/nsf_command.h"
#include "train/commands/run_log.h"
#include "train/commands/slurm_script.h"
#include "train/commands/time_command.h"
#include "train/config/presets.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_loop.h"
#include "train/parallel/comm.h"
#include "train/parallel/rank_environment.h"

namespace graupel::train {
namespace {

using Json = nlohmann::ordered_json;

/// The words of the command line.
struct Arguments {
  Architecture architecture = Architecture::hgn;
  std::string data, out, config, from, teacher, resume, evaluate, split = "test", device = "auto",
                                                                  preset = "recommended", json;
  std::vector<std::string> set;
  int64_t steps = 0, stop_step = 0, stride = 1;
  double minutes = 0, rank_timeout = CommOptions().timeout;
  uint64_t seed = 0;
  int threads = 0, slurm_ranks = 0;
  bool print_defaults = false;
  bool seed_given = false, preset_given = false;
  std::string command_line;
};

std::string progress_line(const TrainingProgress& p) {
  return fmt::format("step {}/{}  loss {:.4g}  rate {:.2g}  {:.1f} it/s  {:.0f} scenes/s  {} left", p.step, p.steps,
                     p.loss_average, p.learning_rate, p.steps_per_second, p.scenes_per_second,
                     human_time(p.seconds_left));
}

Json json_of(const SquaredErrors& errors) {
  Json json = {{"particles", errors.particles}};
  for (const Predictor predictor : all_predictors) {
    json["raw_mse"][name_of(predictor)] = errors.raw_mse(predictor);
    json["normalized_mse"][name_of(predictor)] = errors.normalized_mse(predictor);
  }
  return json;
}

Json json_of(const OneStepErrors& errors) {
  Json json = {{"samples", errors.samples}, {"all", json_of(errors.all())}};
  for (const Region region : all_regions)
    json[name_of(region)] = json_of(errors.region[static_cast<std::size_t>(region)]);
  return json;
}

Json json_of(const TrainingResult& result, const Arguments& arguments) {
  Json json = {{"run", arguments.out},
               {"reason", name_of(result.reason)},
               {"steps", result.step},
               {"scene_samples", result.scene_samples},
               {"seconds", result.seconds},
               {"loss", result.loss_average},
               {"parameters", result.parameters},
               {"weights", result.weights_file},
               {"best_validation", result.best_validation},
               {"best_step", result.best_step}};
  if (result.validation) {
    json["validation"] = json_of(result.validation->one_step);
    json["validation"]["step"] = result.validation->step;
    json["validation"]["rollout_mse"] = result.validation->rollout_mse;  // null when not measured
  }
  return json;
}

void write_json(const std::string& file, const Json& json) {
  if (!file.empty()) write_file_atomically(file, json.dump(2) + "\n");
}

std::string utc_name(Architecture architecture) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof(text), "-%Y%m%dT%H%M%SZ", &utc);
  return std::string(word_of(architecture)) + text;
}

/// Settings of a new run: preset or file, then --set, then the flags of their own.
TrainConfig config_of(const Arguments& arguments) {
  std::vector<std::string> overrides = {std::string("architecture=") + word_of(arguments.architecture)};
  if (arguments.config.empty()) {
    const Preset preset = arguments.preset == "paper" ? Preset::paper : Preset::recommended;
    const std::vector<std::string> settings = preset_settings(arguments.architecture, preset);
    overrides.insert(overrides.end(), settings.begin(), settings.end());
  } else if (arguments.preset_given) {
    throw ConfigError("--preset and --config both say what a run begins with. Leave one of them out");
  }
  overrides.insert(overrides.end(), arguments.set.begin(), arguments.set.end());
  if (arguments.steps > 0) overrides.push_back("steps=" + std::to_string(arguments.steps));
  if (arguments.seed_given) overrides.push_back("seed=" + std::to_string(arguments.seed));
  if (arguments.config.empty()) return read_train_config("{}", "command line", overrides);
  return read_train_config(read_file(arguments.config), arguments.config, overrides);
}

bool says_how_to_train(const Arguments& arguments) {
  return !arguments.config.empty() || !arguments.set.empty() || arguments.steps > 0 || !arguments.from.empty() ||
         !arguments.teacher.empty() || arguments.seed_given || arguments.preset_given;
}

void prepare_resume(Arguments& arguments, TrainingOptions& options) {
  if (says_how_to_train(arguments))
    throw ConfigError(
        "a resumed run keeps its settings (--preset, --config, --set, --steps, --from, --teacher and --seed are for "
        "new runs). Leave them out");
  arguments.out =
      arguments.resume == "latest" ? latest_run(arguments.out.empty() ? "runs" : arguments.out) : arguments.resume;
  options.resume = true;
  options.config = read_run_config(arguments.out);
  if (options.config.architecture != arguments.architecture)
    throw ConfigError(fmt::format(
        "'{}' is a run of another network ({}). Go on with it by graupel train {} --resume {}", arguments.out,
        word_of(options.config.architecture), word_of(options.config.architecture), arguments.out));
  const RunFacts facts = read_run_facts(arguments.out);
  if (arguments.data.empty()) arguments.data = facts.data;
  arguments.teacher = facts.teacher;
}

/// Cores and GPU of this rank; before anything asks CUDA which GPUs there are.
void take_part_of_machine(const RankEnvironment& environment, const Arguments& arguments) {
  if (environment.alone()) return;
  if (arguments.threads == 0)
    set_num_threads(threads_of_rank(environment, num_threads(), static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN))));
  const char* const visible = std::getenv("CUDA_VISIBLE_DEVICES");
  const auto gpus = visible == nullptr ? std::nullopt : std::optional<std::string>(visible);
  if (arguments.device != "cpu") ::setenv("CUDA_VISIBLE_DEVICES", gpu_of_rank(environment, gpus).c_str(), 1);
}

/// The run that rank 0's command line names, as settings, data and folder; the same for every rank.
void settle_run(Arguments& arguments, TrainingOptions& options) {
  if (!arguments.resume.empty()) {
    prepare_resume(arguments, options);
  } else {
    if (arguments.data.empty())
      throw ConfigError("--data is missing. Name the folder of a data set ('graupel generate' makes one)");
    options.config = config_of(arguments);
    if (arguments.out.empty()) arguments.out = "runs/" + utc_name(arguments.architecture);
  }
  options.data = arguments.data;
  options.run = arguments.out;
  options.teacher = arguments.teacher;
}

void share_run(Comm& comm, Arguments& arguments, TrainingOptions& options) {
  Json run;
  std::exception_ptr refusal;
  try {
    if (comm.leads()) settle_run(arguments, options);
    run = {{"config", train_config_text(options.config)},
           {"data", options.data},
           {"run", options.run},
           {"teacher", options.teacher}};
  } catch (const Error& error) {
    refusal = std::current_exception();
    run = {{"refused", error.code()}};
  }
  run = Json::parse(broadcast_text(comm, run.dump()));
  if (refusal) std::rethrow_exception(refusal);
  if (comm.leads()) return;
  if (run.contains("refused"))
    throw Error(run.at("refused").get<ExitCode>(), "rank 0 refuses the run; its message says why");
  options.config = read_train_config(run.at("config"), "the settings of rank 0");
  options.data = run.at("data");
  options.run = run.at("run");
  options.teacher = run.at("teacher");
}

int run_training(Arguments& arguments) {
  const RankEnvironment environment = read_rank_environment();
  take_part_of_machine(environment, arguments);
  RunLog log;
  TrainingOptions options;
  options.device = device_for_torch(arguments.device);
  options.threads = num_threads();
  options.local_ranks = environment.local_size;
  std::unique_ptr<Comm> ranks;
  if (!environment.alone()) {
    ranks = join_ranks(environment, {options.device, arguments.rank_timeout, [&](const std::string& text) {
                                       if (environment.rank == 0) std::fprintf(stderr, "%s\n", text.c_str());
                                     }});
    options.comm = ranks.get();
  }
  share_run(*options.comm, arguments, options);
  options.minutes = arguments.minutes;
  options.stop_step = arguments.stop_step;
  options.from = arguments.from;
  options.command_line = arguments.command_line;
  options.version = GRAUPEL_VERSION;
  options.should_stop = [] { return stop_signal() != 0; };
  const auto print = [&](const std::string& text) {
    if (options.comm->leads()) log.line(text, arguments.out);
  };
  options.message = print;
  options.progress = [&](const TrainingProgress& progress) { print(progress_line(progress)); };
  if (!environment.alone())
    print(
        fmt::format("{} ranks ({}), CPU threads of each: {}", environment.size, environment.launcher, options.threads));

  const TrainingResult result = train_network(options);
  if (options.comm->leads()) write_json(arguments.json, json_of(result, arguments));
  print(fmt::format("{} at step {} after {}: {}", name_of(result.reason), result.step, human_time(result.seconds),
                    result.weights_file));
  if (result.reason == StopReason::finished) return 0;
  print(fmt::format("Go on with: graupel train {} --resume {}", word_of(arguments.architecture), arguments.out));
  return saved_exit_code();
}

/// Prints the batch script that trains so under Slurm.
int print_slurm_script(Arguments& a) {
  require_one_process("--emit-slurm");
  TrainingOptions options;
  settle_run(a, options);  // its errors, before anything is submitted
  std::vector<std::string> resume = {word_of(a.architecture),
                                     "--resume",
                                     a.out,
                                     "--data",
                                     a.data,
                                     "--device",
                                     a.device,
                                     "--threads",
                                     std::to_string(a.threads),
                                     "--rank-timeout",
                                     fmt::format("{}", a.rank_timeout)};
  if (a.minutes > 0) resume.insert(resume.end(), {"--minutes", fmt::format("{}", a.minutes)});
  if (a.stop_step > 0) resume.insert(resume.end(), {"--stop-step", std::to_string(a.stop_step)});
  if (!a.json.empty()) resume.insert(resume.end(), {"--json", a.json});
  fmt::print("{}", slurm_training_script(slurm_training(a.slurm_ranks, a.out, resume, a.resume.empty())));
  return 0;
}

int run_evaluation(const Arguments& arguments) {
  require_one_process("--evaluate");
  if (arguments.data.empty()) throw ConfigError("--data is missing. Name the folder of the data set");
  if (says_how_to_train(arguments) || !arguments.resume.empty() || !arguments.out.empty())
    throw ConfigError(
        "--evaluate trains nothing (--preset, --config, --set, --steps, --from, --teacher, --seed, --resume and --out "
        "are for training). Leave them out");
  const Device device = device_for_torch(arguments.device);
  configure_torch(num_threads(), /*tf32=*/true);
  const nn::Weights weights = nn::read_safetensors(arguments.evaluate);
  const NetworkConfig config = network_config_of(weights);
  if (architecture_of(config) != arguments.architecture)
    throw InputError(fmt::format("'{}' holds another network (architecture '{}', needed '{}'). Use graupel train {}",
                                 arguments.evaluate, word_of(architecture_of(config)), word_of(arguments.architecture),
                                 word_of(architecture_of(config))));
  const graph::Normalization normalization = graph::read_normalization(weights);
  NetworkModule module(config, device, 0);
  module.set_state(StateArray::weights, weights);

  DataSplitOptions split_options;
  split_options.threads = num_threads();
  split_options.materials = features_of(config).material_constants;
  split_options.check = [&](const DataSplit& opened) {
    opened.check_fits(config, arguments.evaluate);
    opened.check_samples(1, 0);
  };
  const DataSplit split(arguments.data + "/" + arguments.split + ".h5", split_options);
  const OneStepErrors errors =
      evaluate_one_step(module, normalization, split, strided_samples(split, arguments.stride),
                        {.which = StateArray::weights, .batch_scenes = 16, .threads = num_threads()});
  fmt::print("one-step error of the acceleration, normalised (raw [m^2/frame^4])\n{:14} {:>10} {:>22} {:>22} {:>22}\n",
             "region", "particles", "network", "zero", "ballistic");
  const auto row = [](const char* name, const SquaredErrors& e) {
    const auto cell = [&](Predictor p) { return fmt::format("{:.4g} ({:.3e})", e.normalized_mse(p), e.raw_mse(p)); };
    fmt::print("{:14} {:>10} {:>22} {:>22} {:>22}\n", name, e.particles, cell(Predictor::network),
               cell(Predictor::zero), cell(Predictor::ballistic));
  };
  row("all", errors.all());
  for (const Region region : all_regions) row(name_of(region), errors.region[static_cast<std::size_t>(region)]);
  Json json = json_of(errors);
  json["weights"] = arguments.evaluate;
  json["split"] = split.file();
  write_json(arguments.json, json);
  return 0;
}

void add_options(const Command& verb, Arguments& a) {
  const std::string word = word_of(a.architecture);
  verb.option("--data", a.data, "Folder of the data set: train.h5, valid.h5, test.h5").names_folder();
  verb.option("--out", a.out, fmt::format("Run folder (default: runs/{}-<time>)", word)).names_folder();
  verb.option("--preset", a.preset, "Settings to begin with: recommended (what won in our measurements) or paper")
      .check(one_of({"recommended", "paper"}))
      .show_default()
      .remember_in(a.preset_given);
  verb.option("--config", a.config, "Settings as JSON instead (see --print-defaults)").names_file({".json"});
  verb.option("--set", a.set, fmt::format("Override a setting: key=value, {}.latent=64", word)).take_all();
  verb.option("--steps", a.steps, "Optimiser steps").check(whole_number(1));
  verb.option("--minutes", a.minutes, "Stop after this wall time, with a checkpoint")
      .check(real_number(LowerBound::above_zero));
  verb.option("--stop-step", a.stop_step, "Stop after this step, with a checkpoint").check(whole_number(1));
  verb.option("--from", a.from, "Start from this weights file, with its normalisation, instead of fresh weights")
      .names_file({".safetensors"});
  verb.option("--teacher", a.teacher,
              "Learn from the predictions of this weights file (share: --set teacher_share=0.5)")
      .names_file({".safetensors"});
  verb.option("--resume", a.resume, "Go on with this run folder, or with the latest one below --out").names_folder();
  verb.option("--seed", a.seed, "Seed of all random numbers").remember_in(a.seed_given);
  verb.option("--device", a.device, "auto, cpu or cuda").suggest({"auto", "cpu", "cuda"}).show_default();
  verb.option("--threads", a.threads, "CPU threads of each process (0: all, divided among those of a machine)")
      .check(whole_number(0, 4096))
      .show_default();
  verb.option("--rank-timeout", a.rank_timeout, "Seconds until a process that does not answer is taken for gone")
      .check(real_number(LowerBound::above_zero))
      .show_default();
  verb.option("--json", a.json, "Write the result as JSON to this file (-: standard output)").names_file({".json"});
  verb.option("--emit-slurm", a.slurm_ranks,
              "Print a batch script for Slurm with so many processes instead; it goes on where a job's time is over")
      .check(whole_number(1, 1024));
  verb.flag("--print-defaults", a.print_defaults, "Print every setting that a run would have");
  verb.option("--evaluate", a.evaluate, "Instead of training: one-step errors of this weights file")
      .names_file({".safetensors"});
  verb.option("--split", a.split, "Split that --evaluate reads: train, valid or test")
      .check(one_of({"train", "valid", "test"}))
      .show_default();
  verb.option("--stride", a.stride, "--evaluate takes every n-th frame").check(whole_number(1)).show_default();
  verb.footer(
      fmt::format("Examples:\n  graupel train {0} --data data/hgn --out runs/{0} --minutes 15\n"
                  "  graupel train {0} --evaluate runs/{0}/weights.safetensors --data data/hgn --split test --json "
                  "errors.json",
                  word));
}

int train_or_evaluate(Arguments& arguments) {
  if (arguments.print_defaults) {
    fmt::print("{}\n", train_config_text(config_of(arguments)));
    return 0;
  }
  if (arguments.slurm_ranks > 0) return print_slurm_script(arguments);
  if (arguments.json == "-") reserve_standard_output();
  set_num_threads(arguments.threads);
  catch_stop_signals();
  return arguments.evaluate.empty() ? run_training(arguments) : run_evaluation(arguments);
}

int run(int argc, char** argv) {
  const CommandLine program("graupel-train: trains the learned simulators of Graupel.");
  program.version(std::string("graupel-train ") + GRAUPEL_VERSION + ", libtorch " + torch_version());
  program.require_command();
  std::string command_line;
  for (int i = 0; i < argc; ++i) command_line += (i > 0 ? " " : "") + std::string(argv[i]);
  int exit_code = 0;
  const auto add_network = [&](Arguments& arguments, const char* description) {
    arguments.command_line = command_line;
    const Command verb = program.command(word_of(arguments.architecture), description);
    add_options(verb, arguments);
    verb.callback([&arguments, &exit_code] { exit_code = train_or_evaluate(arguments); });
  };
  Arguments of_hgn, of_gns;
  of_gns.architecture = Architecture::gns;
  add_network(of_hgn, "The hierarchical graph network");
  add_network(of_gns, "The graph network simulator that it is compared with (GNS)");
  add_nsf_command(program, command_line, exit_code);
  add_crom_command(program, command_line, exit_code);
  add_coarse_command(program, command_line, exit_code);
  add_time_command(program, command_line);
  if (argc == 2 && std::string_view(argv[1]) == io::describe_word) {
    fmt::print("{}", io::command_json(program.description()));
    return 0;
  }
  instruction_set();              // its error, before any work
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond the limit of its size (ulimit -f) is an error of writing
  const int usage = program.run(argc, argv, "graupel-train");
  flush_standard_output();
  return usage != 0 ? usage : exit_code;
}

}  // namespace
}  // namespace graupel::train

int main(int argc, char** argv) {
  using graupel::ExitCode;
  constexpr const char* less_memory = "Set memory_limit lower, or take fewer scenes a batch";
  graupel::install_last_resort("graupel-train", less_memory);
  try {
    return graupel::train::run(argc, argv);
  } catch (const graupel::Error& error) {
    std::fprintf(stderr, "graupel-train: %s\n", graupel::printable(error.what()).c_str());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "graupel-train: out of memory. %s\n", less_memory);
  } catch (const std::system_error& error) {
    const bool no_thread = error.code() == std::errc::resource_unavailable_try_again;
    std::fprintf(stderr, "graupel-train: %s%s\n", error.what(),
                 no_thread ? ". The system starts no more threads. Use --threads 1, or allow more (ulimit -u)" : "");
  } catch (const std::exception& error) {
    // libtorch's own error, where it cannot have the memory of a tensor.
    const bool no_memory = std::strstr(error.what(), "not enough memory") != nullptr;
    std::fprintf(stderr, "graupel-train: %s%s\n", no_memory ? "out of memory. " : error.what(),
                 no_memory ? less_memory : "");
  }
  return static_cast<int>(ExitCode::failed);
}
