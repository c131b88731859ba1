#include "train/commands/network_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/shell_words.h"
#include "core/system/standard_output.h"
#include "core/system/stop_signal.h"
#include "train/commands/run_log.h"
#include "train/commands/run_outputs.h"
#include "train/commands/slurm_script.h"
#include "train/config/presets.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_loop.h"
#include "train/parallel/rank_environment.h"

namespace graupel::train {

using Json = nlohmann::ordered_json;

namespace {

std::string progress_line(const TrainingProgress& p) {
  return fmt::format("step {}/{}  loss {:.4g}  rate {:.2g}  {:.1f} it/s  {:.0f} scenes/s  {} left", p.step, p.steps,
                     p.loss_average, p.learning_rate, p.steps_per_second, p.scenes_per_second,
                     human_time(p.seconds_left));
}

Json json_of(const TrainingResult& result, const NetworkArguments& arguments) {
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

std::string utc_name(Architecture architecture) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof(text), "-%Y%m%dT%H%M%SZ", &utc);
  return std::string(word_of(architecture)) + text;
}

/// Settings of a new run: preset or file, then --set, then the flags of their own.
TrainConfig config_of(const NetworkArguments& arguments) {
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

void prepare_resume(NetworkArguments& arguments, TrainingOptions& options) {
  if (says_how_to_train(arguments))
    throw ConfigError(
        "a resumed run keeps its settings (--preset, --config, --set, --steps, --from, --teacher and --seed are for "
        "new runs). Leave them out");
  if (arguments.resume != "latest" && !arguments.out.empty())
    throw ConfigError(
        "--out is for new runs (a resumed one stays in its folder), or says where --resume latest looks. Leave it out");
  arguments.out = arguments.resume == "latest"
                      ? latest_run(arguments.out.empty() ? "runs" : arguments.out, arguments.architecture)
                      : arguments.resume;
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
void take_part_of_machine(const RankEnvironment& environment, const NetworkArguments& arguments) {
  if (environment.alone()) return;
  if (arguments.threads == 0)
    set_num_threads(threads_of_rank(environment, num_threads(), static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN))));
  const char* const visible = std::getenv("CUDA_VISIBLE_DEVICES");
  const auto gpus = visible == nullptr ? std::nullopt : std::optional<std::string>(visible);
  if (arguments.device != "cpu") ::setenv("CUDA_VISIBLE_DEVICES", gpu_of_rank(environment, gpus).c_str(), 1);
}

/// The run that rank 0's command line names, as settings, data and folder; the same for every rank.
void settle_run(NetworkArguments& arguments, TrainingOptions& options) {
  if (!arguments.resume.empty()) {
    prepare_resume(arguments, options);
  } else {
    if (arguments.data.empty())
      throw ConfigError("--data is missing. Name the folder of a data set ('graupel generate' makes one)");
    options.config = config_of(arguments);
    if (arguments.out.empty()) arguments.out = "runs/" + utc_name(arguments.architecture);
  }
  check_data_folder(arguments.data);
  options.data = arguments.data;
  options.run = arguments.out;
  options.teacher = arguments.teacher;
  check_run_outputs({{"the data", arguments.data},
                     {"the settings", arguments.config},
                     {"the weights", arguments.from},
                     {"the teacher", arguments.teacher}},
                    arguments.out, arguments.json);
}

void share_run(Comm& comm, NetworkArguments& arguments, TrainingOptions& options) {
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

int run_training(NetworkArguments& arguments) {
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
  if (options.comm->leads() && !arguments.json.empty())
    write_file_atomically(arguments.json, json_of(result, arguments).dump(2) + "\n");
  print(fmt::format("{} at step {} after {}: {}", name_of(result.reason), result.step, human_time(result.seconds),
                    result.weights_file));
  if (result.reason == StopReason::finished) return 0;
  print(fmt::format("Go on with: graupel train {} --resume {}", word_of(arguments.architecture),
                    shell_word(arguments.out)));
  return saved_exit_code();
}

/// Prints the batch script that trains so under Slurm.
int print_slurm_script(NetworkArguments& a) {
  require_one_process("--emit-slurm");
  if (!a.evaluate.empty())
    throw ConfigError("--emit-slurm is for training, and --evaluate trains nothing. Leave one of them out");
  TrainingOptions options;
  settle_run(a, options);  // its errors, before anything is submitted
  check_rank_count(a.slurm_ranks, options.config);
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

void add_options(const Command& verb, NetworkArguments& a) {
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
      .show_default()
      .remember_in(a.split_given);
  verb.option("--stride", a.stride, "--evaluate takes every n-th frame")
      .check(whole_number(1))
      .show_default()
      .remember_in(a.stride_given);
  verb.footer(
      fmt::format("Examples:\n  graupel train {0} --data data/hgn --out runs/{0} --minutes 15\n"
                  "  graupel train {0} --evaluate runs/{0}/weights.safetensors --data data/hgn --split test --json "
                  "errors.json",
                  word));
}

int train_or_evaluate(NetworkArguments& arguments) {
  if (arguments.print_defaults) {
    TrainingOptions options;
    if (arguments.resume.empty())
      options.config = config_of(arguments);
    else
      prepare_resume(arguments, options);
    fmt::print("{}\n", train_config_text(options.config));
    return 0;
  }
  if (arguments.evaluate.empty() && (arguments.split_given || arguments.stride_given))
    throw ConfigError("--split and --stride are for --evaluate. Leave them out, or name weights: --evaluate FILE");
  if (arguments.slurm_ranks > 0) return print_slurm_script(arguments);
  if (arguments.json == "-") reserve_standard_output();
  set_num_threads(arguments.threads);
  // A training saves what it has; what comes before its first step is no loss.
  catch_stop_signals(arguments.evaluate.empty() ? StopPolicy::within_a_second : StopPolicy::at_once);
  if (arguments.evaluate.empty()) return run_training(arguments);
  evaluate_network(arguments);
  return 0;
}

}  // namespace

bool says_how_to_train(const NetworkArguments& arguments) {
  return !arguments.config.empty() || !arguments.set.empty() || arguments.steps > 0 || !arguments.from.empty() ||
         !arguments.teacher.empty() || arguments.seed_given || arguments.preset_given;
}

void add_network_commands(const Command& app, const std::string& command_line, int& exit_code) {
  const auto add = [&](Architecture architecture, const char* description) {
    auto a = std::make_shared<NetworkArguments>();
    a->architecture = architecture;
    a->command_line = command_line;
    const Command verb = app.command(word_of(architecture), description);
    add_options(verb, *a);
    verb.callback([a, &exit_code] { exit_code = train_or_evaluate(*a); });
  };
  add(Architecture::hgn, "The hierarchical graph network");
  add(Architecture::gns, "The graph network simulator that it is compared with (GNS)");
}

}  // namespace graupel::train
