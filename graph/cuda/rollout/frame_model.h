// What a rollout on a GPU (cuda_simulator.h) asks of an architecture: the making of its graph and the accelerations.
// All launches may be recorded; numbers that change from frame to frame are read on the GPU, as far as there is room.
#pragma once

#include <memory>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/config/feature_config.h"
#include "graph/cuda/launch/launch_hooks.h"
#include "graph/features/features.h"
#include "nn/weights.h"

namespace graupel::graph {

class FrameModel {
 public:
  virtual ~FrameModel() = default;

  virtual const FeatureConfig& feature_config() const = 0;
  /// As Network::spacing.
  virtual double spacing() const = 0;

  /// Where the particles of a scene may be.
  struct Range {
    Vec3d origin;                    ///< of a grid [m]
    Vec3d low, high;                 ///< [m] box that holds the particles, give or take what the graph's cells allow
    const Environment* environment;  ///< of obstacle particles; null: there are none but among the particles
    int64_t particles;
  };
  /// Makes ready for particles of these rows of the embedding table, in one scene or, where takes_scenes(), in several
  /// with the same origin that follow each other. The ranges' environments must live as long as frames are launched.
  /// Launches in `stream`.
  virtual void start(const std::vector<Range>& scenes, const std::vector<int32_t>& type_row, void* stream) = 0;
  /// Whether it predicts several scenes at once, each with the bits that it has alone.
  virtual bool takes_scenes() const { return false; }
  /// The scenes with a particle at position() outside of what the graph can hold. Waits.
  virtual std::vector<std::size_t> scenes_outside() { return {}; }
  /// What a frame begins with, to be written by the caller: features [particles, width] before launch(), positions
  /// [particles] before launch_graph().
  float* features() { return features_.data(); }
  Vec3f* position() { return position_.data(); }

  /// Makes the graph of position(), beside what follows in the stream or in launch(). `with_counts`: at once, with what
  /// ensure_capacity() needs.
  virtual void launch_graph(void* stream, bool with_counts) = 0;
  enum class CapacityStatus {
    sufficient,   ///< for the graph made last
    reallocated,  ///< there, at new places: what was recorded is of no use
    exceeded      ///< a particle lies outside what the graph can hold
  };
  /// Waits for the graph made last.
  virtual CapacityStatus ensure_capacity() = 0;
  /// Normalised accelerations from features() and the graph made last.
  virtual void launch(void* stream, const LaunchHooks& moments) = 0;
  virtual const float* output() const = 0;  ///< [particles, output_width()]
  /// Not 0 where the graph made last exceeded the capacity: the output is of no use.
  virtual const int32_t* fault() const = 0;
  /// The memory of the launches so far may be used again.
  virtual void reuse_memory() = 0;

 protected:
  Buffer<Vec3f> position_{Device::cuda, 0};
  Buffer<int32_t> type_row_{Device::cuda, 0};
  Buffer<float> features_{Device::cuda, 0};
};

/// The network of a weights file. Throws InputError for damaged weights, ConfigError where there is no GPU or no
/// kernels for such a network.
std::unique_ptr<FrameModel> make_frame_model(const nn::Weights& weights);

}  // namespace graupel::graph
