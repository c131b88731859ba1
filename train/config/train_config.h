// Settings of a training run of a graph network. Defaults follow the HGN paper, section 3.3, but for the
// batch (the paper: one scene), the moving average and the grid jitter; runs begin with a preset
// (train/config/presets.h).
#pragma once

#include <cstdint>

#include "core/scene/fields.h"
#include "train/config/network_config.h"

namespace graupel {
namespace train {

/// How far the grid's origin is moved at random, towards negative coordinates.
enum class GridJitter {
  coarsest,  ///< one cell of the coarsest level, so that every level's phase varies
  finest,    ///< one cell of the finest level (the paper)
  none
};

enum class RateSchedule {
  exponential,  ///< final + (first - final) 0.1^(step / decay_steps): GNS and the paper
  cosine        ///< half a cosine from first to final over all steps
};

}  // namespace train

template <>
struct EnumWords<train::GridJitter> {
  static constexpr std::pair<const char*, train::GridJitter> words[] = {{"coarsest", train::GridJitter::coarsest},
                                                                        {"finest", train::GridJitter::finest},
                                                                        {"none", train::GridJitter::none}};
};
template <>
struct EnumWords<train::RateSchedule> {
  static constexpr std::pair<const char*, train::RateSchedule> words[] = {
      {"exponential", train::RateSchedule::exponential}, {"cosine", train::RateSchedule::cosine}};
};

namespace train {

struct TrainConfig {
  Architecture architecture = Architecture::hgn;
  graph::HgnConfig hgn;
  graph::GnsConfig gns;
  uint64_t seed = 0;
  int64_t steps = 25000;
  int64_t batch_scenes = 16;
  RateSchedule schedule = RateSchedule::exponential;
  double learning_rate = 1e-4;
  double final_learning_rate = 1e-6;
  int64_t decay_steps = 0;  ///< 0: a quarter of the steps, the paper's proportion
  int64_t warm_up_steps = 0;
  double clip_norm = 10;
  double ema_decay = 0.999;
  double noise_std = 8.48528e-4;  ///< [m/frame]
  int64_t push_steps = 0;
  double push_share = 0.5;
  double push_recovery = 0.2;
  double push_velocity_recovery = 0.5;
  double wave_share = 0;
  double wave_strain = 0.2;
  double wave_rate = 0.03;
  double wave_recovery = 0.2;
  double wave_shortest = 0.05, wave_longest = 0.2;  ///< [m]
  GridJitter jitter = GridJitter::coarsest;
  bool symmetries = false;
  bool tf32 = true;
  int64_t checkpoint_layers = 0;
  bool mixed_precision = true;
  int64_t log_interval = 50;
  int64_t checkpoint_interval = 1000;
  int64_t validation_interval = 1000;
  int64_t validation_samples = 40;
  int64_t rollout_scenes = 2;
  int64_t rollout_frames = 60;
  double memory_limit = 0;  ///< [GB]

  /// The network that is trained.
  NetworkConfig network() const;
  const graph::FeatureConfig& features() const;
  /// Learning rate of a step, counted from 0.
  double rate_at(int64_t step) const;
  /// Decay of the moving average in a step, counted from 0: lower at first, so that it forgets the initial weights.
  double ema_decay_at(int64_t step) const;
  /// Width of the grid jitter [m].
  double jitter_width() const;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = TrainConfig;
    visit(&C::architecture, FieldInfo{.name = "architecture",
                                      .unit = "",
                                      .meaning = "Which network: the command `train hgn` or `train gns` sets it"});
    visit(&C::hgn, FieldInfo{.name = "hgn", .unit = "", .meaning = "The network", .only_for = "hgn"});
    visit(&C::gns, FieldInfo{.name = "gns", .unit = "", .meaning = "The network", .only_for = "gns"});
    visit(&C::seed,
          FieldInfo{.name = "seed", .unit = "", .meaning = "Seed of the weights, the order of samples and the noise"});
    visit(&C::steps,
          FieldInfo{.name = "steps", .unit = "", .meaning = "Optimiser steps", .range = Range::between(1, 1e9)});
    visit(&C::batch_scenes, FieldInfo{.name = "batch_scenes",
                                      .unit = "",
                                      .meaning = "Scenes (one frame each) in a step",
                                      .range = Range::between(1, 1024)});
    visit(&C::schedule, FieldInfo{.name = "schedule", .unit = "", .meaning = "Course of the learning rate"});
    visit(
        &C::learning_rate,
        FieldInfo{
            .name = "learning_rate", .unit = "", .meaning = "First learning rate of Adam", .range = Range::positive()});
    visit(&C::final_learning_rate, FieldInfo{.name = "final_learning_rate",
                                             .unit = "",
                                             .meaning = "Learning rate that the schedule tends to",
                                             .range = Range::not_negative()});
    visit(&C::decay_steps, FieldInfo{.name = "decay_steps",
                                     .unit = "",
                                     .meaning = "Steps in which the rate falls to a tenth; 0 for a quarter of `steps`",
                                     .range = Range::between(0, 1e9),
                                     .only_for = "exponential"});
    visit(&C::warm_up_steps, FieldInfo{.name = "warm_up_steps",
                                       .unit = "",
                                       .meaning = "Steps of linear increase before the schedule's rate is reached",
                                       .range = Range::between(0, 1e9)});
    visit(&C::clip_norm, FieldInfo{.name = "clip_norm",
                                   .unit = "",
                                   .meaning = "Largest norm of the gradient; 0 for no limit",
                                   .range = Range::not_negative()});
    visit(&C::ema_decay, FieldInfo{.name = "ema_decay",
                                   .unit = "",
                                   .meaning = "Decay per step of the moving average of the weights",
                                   .range = {.low = 0, .high = 1, .high_open = true}});
    visit(&C::noise_std,
          FieldInfo{.name = "noise_std",
                    .unit = "m/frame",
                    .meaning = "Standard deviation of the random-walk noise on the newest velocity, per axis",
                    .range = Range::not_negative()});
    visit(&C::push_steps, FieldInfo{.name = "push_steps",
                                    .unit = "",
                                    .meaning = "Most predictions, each of the network's `bundle` of frames, that the "
                                               "network makes itself before a sample's target",
                                    .range = Range::between(0, 64),
                                    .only_for = "hgn"});
    visit(&C::push_share, FieldInfo{.name = "push_share",
                                    .unit = "",
                                    .meaning = "Share of the batches whose targets come after frames of the network's",
                                    .range = Range::between(0, 1),
                                    .only_for = "hgn"});
    visit(&C::push_recovery,
          FieldInfo{.name = "push_recovery",
                    .unit = "",
                    .meaning = "Share of the way back to the true position that the target takes in its first frame; "
                               "further frames of a bundle have the accelerations of the data",
                    .range = Range::between(0, 1),
                    .only_for = "hgn"});
    visit(&C::push_velocity_recovery, FieldInfo{.name = "push_velocity_recovery",
                                                .unit = "",
                                                .meaning = "The same of the true velocity",
                                                .range = Range::between(0, 1),
                                                .only_for = "hgn"});
    visit(&C::wave_share, FieldInfo{.name = "wave_share",
                                    .unit = "",
                                    .meaning = "Share of the samples that waves of density are added to",
                                    .range = Range::between(0, 1)});
    visit(&C::wave_strain, FieldInfo{.name = "wave_strain",
                                     .unit = "",
                                     .meaning = "Largest strain of a wave's displacement",
                                     .range = Range::between(0, 1)});
    visit(&C::wave_rate, FieldInfo{.name = "wave_rate",
                                   .unit = "1/frame",
                                   .meaning = "Largest strain rate of a wave's drift",
                                   .range = Range::between(0, 1)});
    visit(&C::wave_recovery,
          FieldInfo{.name = "wave_recovery",
                    .unit = "",
                    .meaning = "Share of a wave's displacement that the target takes back in its first frame",
                    .range = Range::between(0, 1)});
    visit(
        &C::wave_shortest,
        FieldInfo{.name = "wave_shortest", .unit = "m", .meaning = "Shortest wavelength", .range = Range::positive()});
    visit(&C::wave_longest,
          FieldInfo{.name = "wave_longest", .unit = "m", .meaning = "Longest wavelength", .range = Range::positive()});
    visit(&C::jitter,
          FieldInfo{.name = "jitter", .unit = "", .meaning = "Random shift of the grid's origin", .only_for = "hgn"});
    visit(
        &C::symmetries,
        FieldInfo{.name = "symmetries",
                  .unit = "",
                  .meaning = "Turn and mirror each sample by a random symmetry of the axes that leaves gravity alone"});
    visit(&C::tf32, FieldInfo{.name = "tf32", .unit = "", .meaning = "TF32 matrix products on a GPU"});
    visit(&C::checkpoint_layers,
          FieldInfo{.name = "checkpoint_layers",
                    .unit = "",
                    .meaning = "Keep the latents of every so many steps and evaluate those between again on the way "
                               "back: less memory, a third more time; 0 keeps all",
                    .range = Range::between(0, 64),
                    .only_for = "gns"});
    visit(&C::mixed_precision,
          FieldInfo{
              .name = "mixed_precision",
              .unit = "",
              .meaning = "Training steps on a GPU with products in bf16, sums and weights in f32 (latent width 128)"});
    visit(&C::log_interval, FieldInfo{.name = "log_interval",
                                      .unit = "steps",
                                      .meaning = "Steps between lines of the metrics",
                                      .range = Range::between(1, 1e9)});
    visit(&C::checkpoint_interval, FieldInfo{.name = "checkpoint_interval",
                                             .unit = "steps",
                                             .meaning = "Steps between checkpoints",
                                             .range = Range::between(1, 1e9)});
    visit(&C::validation_interval, FieldInfo{.name = "validation_interval",
                                             .unit = "steps",
                                             .meaning = "Steps between validations",
                                             .range = Range::between(1, 1e9)});
    visit(&C::validation_samples, FieldInfo{.name = "validation_samples",
                                            .unit = "",
                                            .meaning = "Frames of the validation split, spread evenly over it",
                                            .range = Range::between(1, 1e6)});
    visit(&C::rollout_scenes, FieldInfo{.name = "rollout_scenes",
                                        .unit = "",
                                        .meaning = "Validation scenes that are rolled out; 0 for none",
                                        .range = Range::between(0, 1000)});
    visit(&C::rollout_frames, FieldInfo{.name = "rollout_frames",
                                        .unit = "frames",
                                        .meaning = "Length of these rollouts",
                                        .range = Range::between(1, 1e6)});
    visit(&C::memory_limit, FieldInfo{.name = "memory_limit",
                                      .unit = "GB",
                                      .meaning = "Positions kept in memory; 0 for half of what the machine has",
                                      .range = Range::not_negative()});
  }
};

}  // namespace train
}  // namespace graupel
