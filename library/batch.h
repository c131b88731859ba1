// Many scenes that the solver advances together: the public face of mpm::SceneBatch.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/particle_quantity.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "core/system/error.h"

namespace graupel {

struct BatchSettings {
  Device device = Device::cpu;
  bool f64 = false;                  ///< double precision, on the CPU alone
  std::vector<uint64_t> seeds = {};  ///< [scenes] of the particle sampling; empty: each scene's own
};

/// Runs of any scenes, each with the bytes of its single run (Simulation). On the CPU every thread advances scenes of
/// its own; on a GPU one launch advances all scenes of one grid.
class Batch {
 public:
  /// Samples the sources and builds the obstacles, on all threads. Errors name the scene, as "scene 3 ('column'): ...";
  /// throws as Simulation().
  explicit Batch(const std::vector<Scene>& scenes, const BatchSettings& settings = {});
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;
  ~Batch();

  std::size_t size() const;
  /// This and what follows throw ConfigError for a scene that the batch does not have.
  const Scene& scene(std::size_t i) const;
  std::span<const int32_t> particle_type(std::size_t i) const;

  /// One frame of each scene, of its own frame_time. A scene that blows up stays behind, the others go on.
  void advance_frame();
  /// The same, until `stop` is true: then false. It is asked between substeps, on several threads; the next call ends
  /// the frame.
  bool advance_frame(const std::function<bool()>& stop);
  int64_t frames_done() const;  ///< whole ones

  /// Why a scene has blown up, in the words of Simulation's DivergedError after "scene 3 ('column'): "; nothing while
  /// it has not. Its state is then of no use.
  std::optional<std::string> divergence(std::size_t i) const;
  /// State of a scene now with the `wanted` fields; it never changes and may be kept.
  std::shared_ptr<const ParticleFrame> frame(std::size_t i, FieldSet wanted = {}) const;
  /// As Simulation::on_device().
  std::shared_ptr<const float> on_device(std::size_t i, ParticleQuantity what) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel
