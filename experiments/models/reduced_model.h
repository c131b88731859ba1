// Reduced-order models on scenes: which scenes a model is for, and runs that are measured.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "rom/cuda/reduced_cuda.h"
#include "rom/interpolation_bound.h"
#include "rom/reduced_solver.h"
#include "rom/solver/error_indicator.h"

namespace graupel::experiments {

/// A weights file, read once.
struct LoadedModel {
  explicit LoadedModel(const std::string& file);
  explicit LoadedModel(const nn::Weights& weights);
  std::string file;
  rom::ReducedModel model;
};

/// [particles]: equal for particles of one material and script.
std::vector<int32_t> particle_kinds(const mpm::SampledParticles& particles);
/// Of the model's scene.
std::vector<int32_t> particle_kinds(const rom::ReducedModel& model);

/// What becomes of a scene that differs from that of the training in more than its parameters, frames and names.
enum class ForeignScene {
  refuse,
  run  ///< all the same, for tests of the trust verdict; the particles must be the model's
};

/// The model's parameters as this scene has them. Throws ConfigError for a scene that lacks one, and, naming the first
/// key that differs, for a foreign scene that is to be refused.
std::vector<double> parameters_of(const LoadedModel& model, const Scene& scene,
                                  ForeignScene foreign = ForeignScene::refuse);
/// A line for every parameter outside of the training's range: "friction_angle = 55 degrees, trained on 21 to 38.5".
std::vector<std::string> outside_range(const rom::ReducedModel& model, const std::vector<double>& parameters);

/// What in the scene the model was not trained on, a line each: parameters outside of the range, other loads.
std::vector<std::string> unlike_training(const LoadedModel& model, const Scene& scene);

class PointFrames;

enum class Arithmetic { f32, f64 };
/// What is said about parameters outside of the training's range.
enum class OutsideRange { warn, be_quiet };

/// Where reduced models run for a --device: on the GPU where it is asked for by name, else on the CPU. Throws
/// ConfigError as parse_device.
Device device_of_reduced_models(const std::string& word);

struct ReducedRunOptions {
  Arithmetic arithmetic = Arithmetic::f32;
  OutsideRange outside = OutsideRange::warn;
  ForeignScene foreign = ForeignScene::refuse;
  Device device = Device::cpu;
};

/// "trust 0.93, ok; training runs rolled out with errors up to 1.2 % of the displacement".
std::string trust_line(const rom::ReducedModel& model, const rom::ErrorIndicatorRecord& record);

/// A reduced run of either precision, or on a GPU. A model of the deformation alone also runs in a scene that has its
/// body with other particles: its own then carry mass and stress on the scene's grid, and frames are of the scene's.
class ReducedRun {
 public:
  /// Throws ConfigError as parameters_of, rom::ReducedSolver and rom::ReducedDeviceSolver, and for f64 on a GPU.
  ReducedRun(const LoadedModel& model, const Scene& scene, uint64_t seed, const rom::ReducedOptions& options,
             const ReducedRunOptions& how = {});
  ReducedRun(ReducedRun&&) noexcept;
  ~ReducedRun();
  /// A force on the body from now on (rom::ReducedSolver::apply). Throws ConfigError on a GPU.
  rom::LoadResponse apply(const Load& load);
  /// Throws DivergedError, which the record on trust then knows.
  void advance_frame();
  double time() const { return gpu_ ? gpu_->time() : single_ ? single_->time() : exact_->time(); }
  rom::LatentState state() const { return gpu_ ? gpu_->state(0) : single_ ? single_->state() : exact_->state(); }
  ParticleFrame frame() const;
  rom::ErrorIndicator trust() const { return gpu_ ? gpu_->trust(0) : single_ ? single_->trust() : exact_->trust(); }
  /// Number of the last frame, and the verdict on the run so far.
  double trust_number() const { return trust_number_; }
  const rom::ErrorIndicatorRecord& trust_record() const { return *record_; }
  rom::ReducedStatistics statistics() const {
    return gpu_ ? gpu_->statistics(0) : single_ ? single_->statistics() : exact_->statistics();
  }
  const std::vector<int32_t>& particle_type() const { return particle_type_; }
  const std::vector<double>& parameters() const { return parameters_; }

 private:
  std::vector<double> parameters_;
  std::vector<int32_t> particle_type_;
  std::optional<rom::ErrorIndicatorRecord> record_;
  std::optional<rom::InterpolationBound> bound_;  ///< in the scene of the training, with any parameter
  double trust_number_ = 0;
  std::unique_ptr<rom::ReducedSolver<float>> single_;
  std::unique_ptr<rom::ReducedSolver<double>> exact_;
  std::unique_ptr<rom::ReducedDeviceSolver> gpu_;
  std::unique_ptr<PointFrames> points_;  ///< where the scene's particles are not the model's
};

}  // namespace graupel::experiments
