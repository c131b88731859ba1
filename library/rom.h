// Reduced-order models (NSF, CROM): runs in the latent space of a trained model. The public face of rom/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "core/system/error.h"

namespace graupel {

/// A key of the scene that may differ from run to run.
struct ReducedParameter {
  std::string name, unit;
  std::vector<std::string> keys;  ///< of the scene that follow it, as dotted paths; the first has its value
  double low = 0, high = 0;       ///< of the training
};

/// The model of a weights file. Copies share it.
class ReducedModel {
 public:
  /// Throws InputError for a file that is missing, damaged or holds no reduced-order model.
  explicit ReducedModel(const std::string& weights_file);

  /// The scene of a training run: what every run of this model starts from, with parameters of its own.
  Scene scene() const;
  const std::vector<ReducedParameter>& parameters() const;
  /// What of a scene the model was not trained on, a line each. Throws ConfigError for a scene that it cannot run.
  std::vector<std::string> remarks(const Scene& scene) const;

 private:
  friend class ReducedSimulation;
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

struct ReducedSettings {
  Device device = Device::cpu;
  bool f64 = false;                        ///< double precision, on the CPU alone
  std::optional<uint64_t> seed = {};       ///< of the particle sampling; else the scene's
  std::optional<double> step_factor = {};  ///< steps over those of the training; else the model's
};

/// A run of a model. Not to be used from several threads at once.
class ReducedSimulation {
 public:
  /// Throws ConfigError when the scene differs from the training's in more than the parameters, or has other particles.
  ReducedSimulation(const ReducedModel& model, const Scene& scene, const ReducedSettings& settings = {});
  ReducedSimulation(ReducedSimulation&&) noexcept;
  ReducedSimulation& operator=(ReducedSimulation&&) noexcept;
  ~ReducedSimulation();

  /// One frame of the scene. Throws DivergedError.
  void advance_frame();
  double time() const;  ///< [s]
  std::size_t particle_count() const;
  /// Shape [particles], in the order of the sources.
  std::span<const int32_t> particle_type() const;
  /// State now, shape [particles]; [m], [m/s]. Valid until the next frame or the end of this object.
  std::span<const Vec3f> position() const;
  std::span<const Vec3f> velocity() const;
  ParticleFrame frame() const;
  /// What the spans above look at, for callers that keep it beyond the next frame; it never changes.
  std::shared_ptr<const ParticleFrame> shared_frame() const;
  /// A trajectory of this run without frames, for io::TrajectoryWriter.
  Trajectory header() const;
  /// Error indicator of the last frame: up to 1 as in the training's own runs.
  double trust_number() const;
  /// On the run so far: "ok", "doubtful", "do not trust" or "unknown".
  std::string verdict() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel
