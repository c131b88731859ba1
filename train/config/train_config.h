// Settings of a training run of a graph network. Defaults follow the HGN paper, section 3.3, but for the
// batch (the paper: one scene), the moving average and the grid jitter; runs begin with a preset
// (train/config/presets.h).
#pragma once

#include <cstdint>

#include "core/scene/fields.h"
#include "train/config/network_config.h"

namespace graupel::train {

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

constexpr auto enum_list(GridJitter) {
  return std::to_array<std::pair<const char*, GridJitter>>(
      {{"coarsest", GridJitter::coarsest}, {"finest", GridJitter::finest}, {"none", GridJitter::none}});
}
constexpr auto enum_list(RateSchedule) {
  return std::to_array<std::pair<const char*, RateSchedule>>(
      {{"exponential", RateSchedule::exponential}, {"cosine", RateSchedule::cosine}});
}

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
  int64_t decay_steps = 0;      ///< 0: a quarter of the steps, the paper's proportion
  double schedule_minutes = 0;  ///< 0: by the steps alone
  int64_t warm_up_steps = 0;
  double clip_norm = 10;
  double ema_decay = 0.999;
  double noise_std = 8.48528e-4;  ///< [m/frame]
  int64_t push_steps = 0;
  double push_share = 0.5;
  double push_recovery = 0.2;
  double push_velocity_recovery = 0.5;
  double teacher_share = 1;
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
  /// Learning rate of a step, counted from 0, when the schedule is at `share` of its course or, by the steps, beyond
  /// it.
  double rate_at(int64_t step, double share = 0) const;
  /// Decay of the moving average in a step, counted from 0: lower at first, so that it forgets the initial weights.
  double ema_decay_at(int64_t step) const;
  /// Width of the grid jitter [m].
  double jitter_width() const;

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = TrainConfig;
    visit(&C::architecture,
          FieldInfo{"architecture", "", "Which network: the command `train hgn` or `train gns` sets it"});
    visit(&C::hgn, FieldInfo{"hgn", "", "The network"}.only_in("hgn"));
    visit(&C::gns, FieldInfo{"gns", "", "The network"}.only_in("gns"));
    visit(&C::seed, FieldInfo{"seed", "", "Seed of the weights, the order of samples and the noise"});
    visit(&C::steps, FieldInfo{"steps", "", "Optimiser steps", Range::between(1, 1e9)});
    visit(&C::batch_scenes,
          FieldInfo{"batch_scenes", "", "Scenes (one frame each) in a step", Range::between(1, 1024)});
    visit(&C::schedule, FieldInfo{"schedule", "", "Course of the learning rate"});
    visit(&C::learning_rate, FieldInfo{"learning_rate", "", "First learning rate of Adam", Range::positive()});
    visit(&C::final_learning_rate,
          FieldInfo{"final_learning_rate", "", "Learning rate that the schedule tends to", Range::not_negative()});
    visit(&C::decay_steps,
          FieldInfo{"decay_steps", "", "Steps in which the rate falls to a tenth; 0 for a quarter of `steps`",
                    Range::between(0, 1e9)}
              .only_in("exponential"));
    visit(&C::schedule_minutes,
          FieldInfo{"schedule_minutes", "min",
                    "Wall time in which the schedule comes to its end and the run with it, where `steps` take longer; "
                    "0: by the steps alone",
                    Range::not_negative()});
    visit(&C::warm_up_steps,
          FieldInfo{"warm_up_steps", "", "Steps of linear increase before the schedule's rate is reached",
                    Range::between(0, 1e9)});
    visit(&C::clip_norm,
          FieldInfo{"clip_norm", "", "Largest norm of the gradient; 0 for no limit", Range::not_negative()});
    visit(&C::ema_decay, FieldInfo{"ema_decay",
                                   "",
                                   "Decay per step of the moving average of the weights",
                                   {.low = 0, .high = 1, .high_open = true}});
    visit(&C::noise_std, FieldInfo{"noise_std", "m/frame",
                                   "Standard deviation of the random-walk noise on the newest velocity, per axis",
                                   Range::not_negative()});
    visit(&C::push_steps, FieldInfo{"push_steps", "",
                                    "Most predictions, each of the network's `bundle` of frames, that the network "
                                    "makes itself before a sample's target",
                                    Range::between(0, 64)}
                              .only_in("hgn"));
    visit(&C::push_share,
          FieldInfo{"push_share", "", "Share of the batches whose targets come after frames of the network's",
                    Range::between(0, 1)}
              .only_in("hgn"));
    visit(&C::push_recovery, FieldInfo{"push_recovery", "",
                                       "Share of the way back to the true position that the target takes in its first "
                                       "frame; further frames of a bundle have the accelerations of the data",
                                       Range::between(0, 1)}
                                 .only_in("hgn"));
    visit(
        &C::push_velocity_recovery,
        FieldInfo{"push_velocity_recovery", "", "The same of the true velocity", Range::between(0, 1)}.only_in("hgn"));
    visit(&C::teacher_share, FieldInfo{"teacher_share", "",
                                       "Share of the teacher's accelerations in the targets (--teacher), beside those "
                                       "of the data",
                                       Range::between(0, 1)});
    visit(&C::wave_share,
          FieldInfo{"wave_share", "", "Share of the samples that waves of density are added to", Range::between(0, 1)});
    visit(&C::wave_strain,
          FieldInfo{"wave_strain", "", "Largest strain of a wave's displacement", Range::between(0, 1)});
    visit(&C::wave_rate,
          FieldInfo{"wave_rate", "1/frame", "Largest strain rate of a wave's drift", Range::between(0, 1)});
    visit(&C::wave_recovery,
          FieldInfo{"wave_recovery", "", "Share of a wave's displacement that the target takes back in its first frame",
                    Range::between(0, 1)});
    visit(&C::wave_shortest, FieldInfo{"wave_shortest", "m", "Shortest wavelength", Range::positive()});
    visit(&C::wave_longest, FieldInfo{"wave_longest", "m", "Longest wavelength", Range::positive()});
    visit(&C::jitter, FieldInfo{"jitter", "", "Random shift of the grid's origin"}.only_in("hgn"));
    visit(&C::symmetries,
          FieldInfo{"symmetries", "",
                    "Turn and mirror each sample by a random symmetry of the axes that leaves gravity alone"});
    visit(&C::tf32, FieldInfo{"tf32", "", "TF32 matrix products on a GPU"});
    visit(&C::checkpoint_layers, FieldInfo{"checkpoint_layers", "",
                                           "Keep the latents of every so many steps and evaluate those between again "
                                           "on the way back: less memory, a third more time; 0 keeps all",
                                           Range::between(0, 64)}
                                     .only_in("gns"));
    visit(&C::mixed_precision,
          FieldInfo{"mixed_precision", "",
                    "Training steps on a GPU with products in bf16, sums and weights in f32 (latent width 128)"});
    visit(&C::log_interval,
          FieldInfo{"log_interval", "steps", "Steps between lines of the metrics", Range::between(1, 1e9)});
    visit(&C::checkpoint_interval,
          FieldInfo{"checkpoint_interval", "steps", "Steps between checkpoints", Range::between(1, 1e9)});
    visit(&C::validation_interval,
          FieldInfo{"validation_interval", "steps", "Steps between validations", Range::between(1, 1e9)});
    visit(&C::validation_samples,
          FieldInfo{"validation_samples", "", "Frames of the validation split, spread evenly over it",
                    Range::between(1, 1e6)});
    visit(&C::rollout_scenes, FieldInfo{"rollout_scenes", "", "Validation scenes that are rolled out; 0 for none",
                                        Range::between(0, 1000)});
    visit(&C::rollout_frames,
          FieldInfo{"rollout_frames", "frames", "Length of these rollouts", Range::between(1, 1e6)});
    visit(&C::memory_limit,
          FieldInfo{"memory_limit", "GB", "Positions kept in memory; 0 for half of what the machine has",
                    Range::not_negative()});
  }
};

}  // namespace graupel::train
