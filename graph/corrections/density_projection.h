// Keeps the volume of predicted matter: particles are moved from where they are denser than at rest (implicit density
// projection, Kugelstadt, Longva, Thuerey and Bender 2019). A learned network that errs a little in every frame lets
// matter collapse over many.
//
// Particles are spread over a grid (trilinear weights). Where a cell's density exceeds its limit, displacements u [in
// cells] make up for it:
//   div u = excess, excess = density / largest density - share of the cell that is free,   u = -grad p,   p >= 0,
//   p = 0 where no matter is (free surface), nothing through the faces that walls and obstacles close,
// so that nothing is pulled together. Two-coloured projected successive over-relaxation, begun from the last frame's p.
// Done on two grids, half a cell apart along each axis: one alone would not see matter that gathers at its cells'
// corners, where it counts as an eighth in each of eight cells.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "core/math/vec.h"
#include "core/parallel/device.h"
#include "graph/features/features.h"

namespace graupel::graph {

namespace density {
struct Spread;
struct MoveParticle;
}  // namespace density

/// Cells beyond periodic walls, for images of the particles (graph/features/periodic_images.h), which the caller gives.
inline constexpr double image_cells = 4;

/// Densities are sums of integers and colours are swept one after the other: results do not depend on the number of
/// threads or the order of the particles; another device gives the same up to rounding.
class DensityProjection {
 public:
  /// `largest_density` [particles/m^3]; `spacing` of the cells [m], doubled until each grid has at most 2^26 of them.
  /// The environment is read here and in start() alone. Throws ConfigError when the cells, 25 bytes each,
  /// do not fit into the memory.
  DensityProjection(Device device, const Environment& environment, double largest_density, double spacing);
  ~DensityProjection();

  /// As a new one of another scene, in the memory that there is as far as it suffices. In `stream`, without waiting.
  void start(const Environment& environment, double largest_density, double spacing, void* stream = nullptr);
  /// Allocates what apply() of n particles needs, before it may be recorded. Pressures and positions stay.
  void reserve(int64_t n);

  /// Moves positions [n] in the device's memory, on each grid by at most half a cell along each axis, perhaps a little
  /// into obstacles: push them out afterwards. Particles farther than a cell outside the walls are left alone. Takes
  /// its place in `stream` (cudaStream_t; null: the default one) and, but for the first call with so many particles
  /// without reserve(), allocates nothing.
  void apply(Vec3f* position, int64_t n, void* stream = nullptr);

  /// apply() of several scenes on a GPU in parts, for callers that join its first and last step with their own:
  /// spreading() for all particles, between(), moving() for all.
  struct Frame {
    DensityProjection* density;
    Vec3f* position;
    int64_t n;
  };
  density::Spread spreading(const Vec3f* position, int64_t n);
  static void between(const std::vector<Frame>& scenes, void* stream);
  density::MoveParticle moving(Vec3f* position);

  /// The environment's obstacles are now where `obstacles`, a view for the device, has them. In `stream`.
  void place(const sparsegrid::ObstacleSetView& obstacles, void* stream = nullptr);

  /// What is launched from now on does nothing, and keeps the last frame's pressure, where `flag`, in the device's
  /// memory, is not 0. A GPU that solves in several launches (density_solver.h) drops the pressure instead.
  void skip_where(const int32_t* flag);

  /// Forgets the last frame's pressure, as before another rollout.
  void restart();

 private:
  class Lattice;
  Device device_;
  std::array<std::unique_ptr<Lattice>, 2> lattices_;
};

}  // namespace graupel::graph
