// One step of the full model's grid for some of its particles: their state goes
// to the active nodes, the nodes move, and the sample particles read their new
// positions. mpm's own transfers, contact and scripts, on compact arrays; no
// return mapping (NSF section 5.2), unless the points have deformation gradients
// as a state: then mpm's own update of the material, too.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "mpm/simulation.h"
#include "mpm/solver/scene_grid.h"

namespace graupel::rom {

/// Which particles take part, and how much of the body each stands for.
struct GridParticles {
  std::vector<int32_t> particles;  ///< numbers in the scene; the samples first
  std::vector<double> weight;      ///< mass and volume over the particle's own; 0: it
                                   ///< only reads the grid
  int64_t samples = 0;
};

/// What the stress of a step comes from.
enum class GradientKind {
  map,        ///< the model's fields: F = dg/dX and an elastic law (CROM), or a stress field (NSF)
  integrated  ///< the material's law: F and the plastic state are states of every point, F <- (1 + dt grad v) F with
              ///< the grid's velocity and return mapping, as in the full order; the affine velocity is the grid's, too
};

constexpr auto enum_list(GradientKind) {
  return std::to_array<std::pair<const char*, GradientKind>>(
      {{"map", GradientKind::map}, {"integrated", GradientKind::integrated}});
}

template <typename T>
class ParticleGrid {
 public:
  ParticleGrid(const mpm::PreparedScene& prepared);

  /// From now on these take part, all of them.
  void choose(const GridParticles& chosen);
  /// From now on these tiles of 16 of the chosen ones take part; ascending,
  /// those of the samples among them.
  void select(const std::vector<int32_t>& tiles);
  /// Room for so many points after the samples, which were all that was chosen;
  /// their volume, material and source index are to be written, too.
  void resize_points(int64_t count);
  /// Slot i of tile j is particle 16 tiles[j] + i of the chosen ones: position,
  /// velocity, affine velocity and stress are to be written before a step, the
  /// first two alone where gradients are integrated.
  mpm::ParticleView<T> particles();
  /// Gives the points the Kirchhoff stress that their material's law has at
  /// their F, for elastic solids.
  void take_stress_of_deformation();
  /// Advances the grid by dt from `time` [s] on; the samples' positions and velocities are then those after the step.
  /// `weight` [samples]: 0 where a sample is not finite or would move over one cell, as beside a node with hardly any
  /// mass (it stays); else 1 + (contact_weight - 1) h, where h is the share of the sample's B-spline on nodes that
  /// moving obstacles hold, if it does not go away from these. `gradient` integrated: F, plastic state, stress and
  /// affine velocity of all points are advanced, too.
  void step(double time, double dt, GradientKind gradient, double contact_weight, std::vector<double>& weight);
  int64_t active_nodes() const;
  int64_t bytes() const;

 private:
  void copy_chosen(const std::vector<int32_t>& tiles);
  void gather_and_deform(const mpm::SolverView<T>& v, T dt, Vec3d& scripted);
  void weigh_contact(const mpm::SolverView<T>& v, double contact_weight, std::vector<double>& weight) const;
  void move_samples(const mpm::SolverView<T>& v, T dt, std::vector<double>& weight);

  mpm::PreparedScene const& prepared_;
  mpm::SceneGrid<T> grid_;
  mpm::Particles<T> particles_, chosen_;  ///< that take part; all there are
  int64_t samples_ = 0, count_ = 0;
};

extern template class ParticleGrid<float>;
extern template class ParticleGrid<double>;

}  // namespace graupel::rom
