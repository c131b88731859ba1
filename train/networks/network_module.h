// A graph network with its training state on a device: weights, their moving average, Adam's moments.
// The only way into libtorch for the rest of train/: no torch type appears here.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/system/error.h"
#include "graph/plan/layer_plan.h"
#include "nn/weights.h"
#include "train/config/network_config.h"
#include "train/data/batch.h"
#include "train/data/device_samples.h"
#include "train/parallel/comm.h"

namespace graupel::train {

/// Number type of the weights and of all tensors; f64 is for checks of the gradient. `mixed` is f32 with matrix
/// products in bf16 (sums in f32), in kernels of their own, where those exist (a GPU, latent width 128); elsewhere it
/// is f32.
enum class NumberType { f32, f64, mixed };

/// The four flat arrays that make up a training state.
enum class StateArray { weights, ema, adam_m, adam_v };
inline constexpr StateArray all_state_arrays[] = {StateArray::weights, StateArray::ema, StateArray::adam_m,
                                                  StateArray::adam_v};
/// File name of an array in a checkpoint, "weights" ...
const char* name_of(StateArray array);

/// Settings of one optimiser step.
struct StepSettings {
  double learning_rate = 1e-4;
  double beta1 = 0.9, beta2 = 0.999, epsilon = 1e-8;
  double clip_norm = 0;  ///< 0: no clipping
  double ema_decay = 0;
  int64_t step = 1;  ///< counts from 1: Adam's bias correction
};

/// Means since they were last taken.
struct StepMeans {
  double loss = 0;  ///< squared error of the normalised acceleration, summed over axes, mean over particles and the
                    ///< frames of a bundle
  double gradient_norm = 0;  ///< before clipping
  int64_t steps = 0;
};

struct TimedPrediction {
  std::vector<float> accelerations;  ///< normalised [particles, 3 k], of the last run
  std::vector<double> seconds;       ///< of every run
};

/// A step that needs more memory than the GPU has (exit 1). Weights and moments are those before it.
struct GpuMemoryError : Error {
  explicit GpuMemoryError(const std::string& message) : Error(ExitCode::failed, message) {}
};

/// Threads and number formats of libtorch, for the whole process. `tf32` allows TF32 in matrix products on a GPU.
void configure_torch(int threads, bool tf32);
/// libtorch's version, e.g. "1.13.1".
std::string torch_version();
/// Whether this libtorch can use a GPU.
bool torch_has_cuda();

class NetworkModule {
 public:
  /// Fresh weights from `seed`. Throws ConfigError for Device::cuda where libtorch has no CUDA.
  /// `checkpoint_layers`: see TorchEngine.
  NetworkModule(const NetworkConfig& config, Device device, uint64_t seed, NumberType number = NumberType::f32,
                int64_t checkpoint_layers = 0);
  ~NetworkModule();
  NetworkModule(NetworkModule&&) noexcept;

  const NetworkConfig& config() const;
  int64_t parameter_count() const;
  /// Whether training steps take the kernels in mixed precision.
  bool is_mixed() const;

  /// Normalised accelerations [particles, 3 k] of the next k frames, row-major, with the weights or their moving
  /// average.
  std::vector<float> predict(const Batch& batch, StateArray which) const;

  /// Predictions in inference mode with their times, `runs` of them after `warm_ups` more. The batch is uploaded before
  /// and results stay on the device; a GPU is waited for. FirstLayers::split is predict()'s.
  TimedPrediction time_prediction(const Batch& batch, StateArray which, graph::FirstLayers first_layers,
                                  int64_t warm_ups, int64_t runs) const;

  /// Forward, backward and optimiser step. Returns at once on a GPU; the loss is kept there until take_means(). With
  /// several ranks `batch` is this rank's shard: loss and gradient are those of all shards as one batch.
  void train_step(const Batch& batch, const StepSettings& settings, Comm& comm = single_process());
  /// The same with a batch of HGN that lies in the module's device.
  void train_step(const SampleArrays& batch, const StepSettings& settings, Comm& comm = single_process());
  /// Normalised accelerations [particles, 3 k] of a batch of HGN that lies in the module's device, there too, with the
  /// weights; valid until the next call.
  const float* predict(const SampleArrays& batch);
  StepMeans take_means();

  /// Loss and its gradient, flat (ParameterLayout), without a step.
  double loss_and_gradient(const Batch& batch, std::vector<double>* gradient);
  double loss(const Batch& batch) const;
  /// Adds `change` to weight number `index` of the flat array.
  void nudge(int64_t index, double change);

  nn::Weights state(StateArray array) const;
  /// Throws InputError when a tensor is missing or of another shape.
  void set_state(StateArray array, const nn::Weights& weights);
  /// Rank 0's state arrays, on every rank.
  void share_state(Comm& comm);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::train
