// Keeps the momentum of predicted matter in free flight. Where a group of particles touches no wall, obstacle or other
// group, all forces but gravity are its own: its momentum grows by gravity alone, and its angular momentum stays
// (Newton's laws; the frame step v' = v + a, x' = x + v' keeps sum m x x v when sum m x x a = 0). A network that errs a
// little lets blobs drift or turn as they fall. So the accelerations of each such group are moved to the nearest ones,
// in the mean weighted by mass, that obey:
//   a_i <- a_i - (mean of a - g) - w x (x_i - centre),   inertia w = sum m (x_i - centre) x a_i.
//
// Groups: particles less than two cells of the scene's grid apart along each axis, now or after a frame of ballistic
// flight, belong together. That is counted in quarters of that distance, at most four apart: none that are 2.5 cells
// apart.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/math/vec.h"
#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "graph/features/features.h"

namespace graupel::graph {

namespace flight {
struct Groups;
}

/// Sums are of integers about places of the grid: a particle's result depends neither on the device or the number of
/// threads nor on the order of the particles.
class FreeFlight {
 public:
  /// `particle_type` [n] tells a particle's mass, by its material's density. The environment must live as long.
  FreeFlight(Device device, const Scene& scene, const Environment& environment,
             const std::vector<int32_t>& particle_type);
  ~FreeFlight();
  /// As a new one of another scene, in the memory that there is as far as it suffices. In `stream`.
  void start(const Scene& scene, const Environment& environment, const std::vector<int32_t>& particle_type,
             void* stream = nullptr);
  /// Other particles, of these types [n].
  void set_particles(const Scene& scene, const std::vector<int32_t>& particle_type);
  /// The environment's obstacles are where `obstacles`, a view for the device, has them when groups are found.
  void place(const sparsegrid::ObstacleSetView& obstacles);

  /// Groups of the particles at `current`, and which of them fly: nothing is within contact distance (two cells of
  /// the scene's grid) in the frame to come. All positions [n] [m] lie in the device's memory. Allocates nothing; takes
  /// its place in `stream` (cudaStream_t; null: the default one).
  void find_groups(const Vec3f* before, const Vec3f* current, void* stream = nullptr);
  /// Corrects `next` = 2 current - before + a, of the frame that find_groups() saw, once.
  void correct(const Vec3f* before, const Vec3f* current, Vec3f* next, void* stream = nullptr);

  /// The positions of one of several scenes, in a GPU's memory.
  struct Frame {
    FreeFlight* flight;
    const Vec3f *before, *current;
    Vec3f* next;  ///< read by correct_all() alone

   private:
    friend class FreeFlight;
    const flight::Groups& groups() const;
  };
  /// find_groups() and correct() of several scenes on a GPU, in as many launches as one takes or a few times that.
  static void find_groups_of_all(const std::vector<Frame>& scenes, void* stream);
  static void correct_all(const std::vector<Frame>& scenes, void* stream);

  /// A number of particle i's group where it flies, -1 where it touches something, of the frame that find_groups() saw
  /// [n]. Numbers may be others the next time.
  std::vector<int32_t> groups() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::graph
