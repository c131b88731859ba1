// Runs a scene with the material point method, frame by frame: the public face of mpm/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/contact_force.h"
#include "core/scene/particle_quantity.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "core/system/error.h"
#include "library/particle_state.h"
#include "mpm/materials/user_material.h"

namespace graupel {

struct SimulationSettings {
  Device device = Device::cpu;
  bool f64 = false;                   ///< double precision, on the CPU alone
  std::optional<uint64_t> seed = {};  ///< of the particle sampling; else the scene's
  UserMaterials materials = {};       ///< laws in place of those of the scene's materials, on the CPU alone
  bool contact_forces = false;        ///< keep count of Simulation::contact_forces()
};

/// Sums over all particles, in f64.
struct Balance {
  double mass = 0;                                     ///< [kg]
  Vec3d momentum = {0, 0, 0};                          ///< [kg m/s]
  double kinetic = 0, elastic = 0, gravitational = 0;  ///< energies [J]
};

/// Not to be used from several threads at once; the solver takes all threads itself (set_num_threads()).
class Simulation {
 public:
  /// Samples the sources and builds the obstacles. Throws ConfigError for a scene that cannot run, InputError for
  /// geometry that cannot be used.
  explicit Simulation(const Scene& scene, const SimulationSettings& settings = {});
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;
  ~Simulation();

  /// One frame of scene().frame_time, in as many substeps as the scene's time step asks for. Throws DivergedError.
  void advance_frame();
  /// One substep of the frame; true once the frame is done. Frames made of these have the bytes of advance_frame().
  /// Inside of a frame all else may be called but save_state(). On a GPU a call may take the whole frame.
  bool advance_substep();
  double time() const;       ///< [s]
  int64_t substeps() const;  ///< so far
  const Scene& scene() const;

  std::size_t particle_count() const;
  /// Shape [particles], in the order of the sources, which never changes. Ids as in particle_type_of().
  std::span<const int32_t> particle_type() const;
  /// State now, shape [particles]; [m], [m/s]. Valid until the next frame, load_state() or the end of this object.
  std::span<const Vec3f> position() const;
  std::span<const Vec3f> velocity() const;
  /// 0 for particles that are not in the run (yet, any more); empty where all always are.
  std::span<const uint8_t> active() const;
  /// Reference volume of each particle, shape [particles]; [m^3]. Its mass is this times the density of its material.
  std::span<const double> volume() const;
  /// A field now, shape [particles, info_of(field).components]; valid as long as position().
  std::span<const float> field(ParticleField field) const;
  /// What the spans above look at, for callers that keep it beyond the next frame; it never changes.
  std::shared_ptr<const ParticleFrame> shared_frame() const;
  std::shared_ptr<const std::vector<float>> shared_field(ParticleField field) const;
  /// The same numbers, [particles, components_of(what)], in the memory of the run's device: of the GPU where it runs on
  /// one. Gathered once a frame; they never change and may be kept.
  std::shared_ptr<const float> on_device(ParticleQuantity what) const;
  Balance balance() const;
  /// What the matter did to each obstacle and wall in the frame before, in the order of contact_names(scene()); inside
  /// of a frame since its start, or since load_state(). Empty unless SimulationSettings::contact_forces.
  std::vector<ContactForce> contact_forces() const;

  /// A copy of the state now with the `wanted` fields, for io::TrajectoryWriter::append().
  ParticleFrame frame(FieldSet wanted = {}) const;
  /// A trajectory of this run without frames, with the scene as it runs, for io::TrajectoryWriter.
  Trajectory header() const;

  /// Whole state between two frames, bit for bit: a restored run goes on exactly as if it had not stopped.
  std::vector<std::byte> save_state() const;
  /// Throws InputError when the state belongs to another scene, seed, precision or device, or is damaged.
  void load_state(const std::vector<std::byte>& state);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel
