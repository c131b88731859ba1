// One network of the paper's reduced-order fields (rom/networks/mlp.h) in training on a device, for the deformation
// with the paper's encoder (rom/networks/conv_encoder.h), or that of a factored field's branch (rom/fields/mlp_map.h):
// weights, Adam's moments, and the snapshots that it is trained on. No torch type appears here.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/parallel/device.h"
#include "nn/weights.h"
#include "train/loop/captured_step.h"
#include "train/networks/network_module.h"

namespace graupel::train {

/// Streams of a network with tangents: value, three tangents along X, one along the latent's rate.
inline constexpr int tangent_streams = 5;

struct MlpShape {
  int latents = 0, parameters = 0;  ///< inputs beside X: q, and mu where the field follows it
  int width = 0, outputs = 0;
  int64_t encoder_particles = 0;  ///< of the convolutional encoder, which then gives q; 0: none
  int coordinates = 3;            ///< of X; 0: a function of the state alone, whose only point has no place
  int rates = 0;  ///< targets [outputs / rates] are the outputs, as a matrix, times so many rates; 0: none
  /// Targets [tangent_streams, outputs] are the outputs y, dy/dX along each axis and dy/dq q'
  /// (train/reduced/mlp/tangent_layers.h).
  bool tangents = false;
  int inputs() const { return coordinates + latents + parameters; }
  int targets() const { return tangents ? tangent_streams * outputs : rates > 0 ? outputs / rates : outputs; }
  int state_rates() const { return tangents ? latents : rates; }
};

/// Rows of a batch: every chosen point of every chosen snapshot.
struct MlpBatch {
  std::vector<int64_t> snapshots, points;
};

/// The arrays that make up a training state.
enum class MlpArray { weights, adam_m, adam_v };
inline constexpr MlpArray all_mlp_arrays[] = {MlpArray::weights, MlpArray::adam_m, MlpArray::adam_v};
/// File name of an array in a checkpoint.
const char* name_of(MlpArray array);

class MlpModule {
 public:
  /// Xavier-uniform weights from `seed`, biases 0. Throws ConfigError for Device::cuda where libtorch has no CUDA.
  /// `launch`: of steps on a GPU.
  MlpModule(const MlpShape& shape, Device device, uint64_t seed, NumberType number = NumberType::f32,
            StepLaunch launch = StepLaunch::graph);
  ~MlpModule();
  MlpModule(MlpModule&&) noexcept;

  /// The training's data, standardised. X [points, 3], not of a function of the state alone; (q, mu) [snapshots,
  /// latents + parameters], not with an encoder; rates [snapshots, rates], of a function of the state alone, or q'
  /// [snapshots, latents]; y [snapshots, points, targets], on the device when it takes no more than `limit` bytes;
  /// positions of all particles for the encoder [snapshots, 3, particles].
  void set_points(const std::vector<float>& points);
  void set_states(const std::vector<float>& states);
  void set_rates(const std::vector<float>& rates);
  void set_targets(const std::vector<float>& targets, double limit);
  void set_encoder_positions(const std::vector<float>& positions);
  /// Factors of the squared errors in the loss [targets]; 1 without them.
  void set_loss_weights(const std::vector<float>& weights);

  /// Forward, backward, Adam. `step` counts from 1. Returns at once on a GPU, where steps with batches of one size and
  /// the same data are recorded once and replayed.
  void train_step(const MlpBatch& batch, double learning_rate, int64_t step);
  /// Steps that were replayed.
  int64_t replayed_steps() const;
  /// Mean over the steps since it was last taken, of the weighted mean of squares over rows and targets.
  double take_loss();
  /// Sums of (prediction - target)^2 and target^2.
  struct Squares {
    double error = 0, target = 0;
  };
  Squares squares(const MlpBatch& batch) const;
  /// y [snapshots, points, targets].
  std::vector<double> predict(const MlpBatch& batch) const;
  /// q of snapshots, [snapshots, latents], by the encoder.
  std::vector<double> encode(const std::vector<int64_t>& snapshots) const;

  /// Weighted mean of squares and its gradient by name.
  double loss_and_gradient(const MlpBatch& batch, nn::Weights* gradient);

  nn::Weights state(MlpArray array) const;
  /// Throws InputError when a tensor is missing or of another shape.
  void set_state(MlpArray array, const nn::Weights& weights);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::train
