#include "train/reduced/mlp/stage_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "core/system/error.h"
#include "core/system/human_time.h"
#include "core/system/stop_signal.h"
#include "train/loop/run_folder.h"

namespace graupel::train {

StageRun::StageRun(const StageRunOptions& options, std::string config_text, uint64_t seed,
                   std::vector<std::string> names, const std::string& data_hash)
    : options_(options), names_(std::move(names)), lock_(lock_run(options_.run)) {
  if (!options_.resume) {
    RunFacts facts = {std::filesystem::absolute(options_.data).lexically_normal(), name_of(options_.device),
                      torch_version(), options_.version, options_.threads};
    facts.time_limit = options_.time_limit;
    facts.data_hash = data_hash;
    create_run(options_.run, config_text + "\n", facts, options_.command_line);
  } else if (began_with_other_data(read_run_facts(options_.run), data_hash)) {
    throw ConfigError("'" + options_.run + "' began with other runs than those of '" + options_.data +
                      "', whose latents mean something else. Name its data by --data, or start a new run");
  }
  state_.seed = seed;
  state_.config_hash = config_hash(config_text);
  if (options_.resume) restore();
  metrics_.emplace(
      options_.run,
      std::vector<std::string>{"stage", "stage_step", "seconds", "loss", "learning_rate", "steps_per_second"},
      state_.step);
}

void StageRun::say(const std::string& text) const {
  if (options_.message) options_.message(text);
}

void StageRun::restore() {
  const auto checkpoint = checkpoint_to_resume(checkpoint_folder(options_.run), state_.config_hash,
                                               [this](const std::string& text) { say(text); });
  if (!checkpoint) return;
  state_ = checkpoint->state;
  restored_ = checkpoint->arrays;
  const auto& facts = restored_.at("stage").metadata;
  restored_stage_ = std::stoi(facts.at("stage"));
  say(fmt::format("resumed at step {} ({}, step {})", state_.step, names_[static_cast<std::size_t>(restored_stage_)],
                  facts.at("step")));
}

/// The module as far as it was trained already.
void StageRun::restore(MlpModule& module) {
  progress_ = {};
  if (restored_stage_ > stage_) module.set_state(MlpArray::weights, restored_.at(name()));
  if (restored_stage_ != stage_) return;
  for (const MlpArray array : all_mlp_arrays) module.set_state(array, restored_.at(name_of(array)));
  const auto& facts = restored_.at("stage").metadata;
  progress_.step = std::stoll(facts.at("step"));
  progress_.seconds = std::stod(facts.at("seconds"));
}

std::optional<StageProgress> StageRun::train(int stage, MlpModule& module, MlpBatches& batches, const StagePlan& plan) {
  stage_ = stage;
  restore(module);
  if (restored_stage_ <= stage_) {
    const StopPolicyScope saves_first(StopPolicy::finish);
    const bool finished = go_on(module, batches, plan);
    save(module);
    if (!finished) return std::nullopt;
  }
  finished_[name()] = module.state(MlpArray::weights);
  return progress_;
}

/// Whether the stage came to its end.
bool StageRun::go_on(MlpModule& module, MlpBatches& batches, const StagePlan& plan) {
  const double before = progress_.seconds;
  const Stopwatch watch;
  logged_ = progress_;
  while (progress_.step < plan.steps) {
    progress_.seconds = before + watch.seconds();
    double share = static_cast<double>(progress_.step) / static_cast<double>(plan.steps);
    if (plan.seconds > 0) share = std::max(share, progress_.seconds / plan.seconds);
    if (share >= 1) break;
    module.train_step(batches.batch(progress_.step), plan.rate_at(share), progress_.step + 1);
    ++progress_.step;
    ++state_.step;
    if (progress_.step % plan.log_interval == 0 || progress_.step == plan.steps) log(module, plan, share);
    if (progress_.step % plan.checkpoint_interval == 0) save(module);
    if (stop_asked()) return false;
  }
  if (progress_.step > logged_.step) log(module, plan, 1);
  return true;
}

bool StageRun::stop_asked() {
  if (options_.should_stop && options_.should_stop())
    reason_ = StopReason::stopped;
  else if (options_.stop_step > 0 && state_.step >= options_.stop_step)
    reason_ = StopReason::reached_stop_step;
  else
    return false;
  return true;
}

void StageRun::log(MlpModule& module, const StagePlan& plan, double share) {
  progress_.loss = module.take_loss();
  if (!std::isfinite(progress_.loss))
    throw DivergedError(fmt::format(
        "training diverged (the loss of the {} is no longer a number by its step {}). Lower {} and start a new run; "
        "checkpoints of this one remain",
        name(), progress_.step, plan.rate_key));
  const double rate = plan.rate_at(share), lap = std::max(progress_.seconds - logged_.seconds, 1e-9),
               speed = static_cast<double>(progress_.step - logged_.step) / lap;
  metrics_->write(state_.step, {{"stage", stage_},
                                {"stage_step", static_cast<double>(progress_.step)},
                                {"seconds", seconds()},
                                {"loss", progress_.loss},
                                {"learning_rate", rate},
                                {"steps_per_second", speed}});
  double left = static_cast<double>(plan.steps - progress_.step) / speed;
  if (plan.seconds > 0) left = std::min(left, plan.seconds - progress_.seconds);
  say(fmt::format("{} {}/{}  loss {:.4g}  rate {:.2g}  {:.1f} it/s  {} left", name(), progress_.step, plan.steps,
                  progress_.loss, rate, speed, human_time(std::max(left, 0.0))));
  logged_ = progress_;
}

/// The current stage's arrays, and the weights of those before.
void StageRun::save(const MlpModule& module) {
  Checkpoint checkpoint{state_, finished_};
  checkpoint.state.seconds = seconds();
  for (const MlpArray array : all_mlp_arrays) checkpoint.arrays[name_of(array)] = module.state(array);
  nn::Weights facts;
  facts.metadata = {{"stage", std::to_string(stage_)},
                    {"step", std::to_string(progress_.step)},
                    {"seconds", fmt::format("{}", progress_.seconds)}};
  checkpoint.arrays["stage"] = facts;
  write_checkpoint(checkpoint_folder(options_.run), checkpoint);
  prune_checkpoints(checkpoint_folder(options_.run), -1);
}

}  // namespace graupel::train
