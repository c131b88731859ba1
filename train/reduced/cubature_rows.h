// What the integration points of a reduced-order model leave at grid nodes, beside what all particles leave there, in
// some snapshots:
//   m_i = sum_p w_ip m_p,   f_i = -(4 / dx^2) sum_p w_ip V_p tau_p (x_i - x_p)     (mpm/physics/transfer.h)
// Points that make the two alike, by least squares over nodes and snapshots.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "rom/cubature/quadrature.h"

namespace graupel::train {

/// Particles and the grid that they are transferred to.
struct QuadratureBody {
  const rom::Clusters& clusters;
  const std::vector<double>& mass;    ///< [particles] [kg]
  const std::vector<double>& volume;  ///< [particles], of the reference body [m^3]
  Vec3d origin;                       ///< of the grid [m]
  double dx = 0;                      ///< [m]
};

/// All particles in a snapshot.
struct QuadratureSnapshot {
  std::vector<float> position;  ///< [particles, 3] [m]
  std::vector<float> stress;    ///< Kirchhoff, xx, xy, xz, yy, yz, zz, [particles, 6] [Pa]
};

/// Root mean squares over the nodes of how far the points' sums are off; nodes count by their mass.
struct QuadratureError {
  double mass = 0;   ///< of the node's mass, over that mass
  double force = 0;  ///< of the acceleration by the stress, over the root mean square of that acceleration
};

class NodalSums {
 public:
  NodalSums(const QuadratureBody& body, const std::vector<QuadratureSnapshot>& snapshots);

  /// Particle of each cluster that its point is.
  const std::vector<int32_t>& points() const { return points_; }
  /// Moves each cluster's point to the one of its particles that lessens the error most, again and again. Mass and
  /// force count as their errors at the start.
  void choose_points();
  QuadratureError error() const;

 private:
  static constexpr int channels = 4;  ///< mass, force
  using Sums = std::array<double, channels>;
  /// Where a particle is among the nodes.
  struct Place {
    std::array<float, 3> above;    ///< the lowest node of its stencil [cells]
    std::array<int32_t, 9> first;  ///< node of each row of the stencil along the last axis
  };
  /// What it brings: mass [kg], 4 / dx V tau [N] in the order of snapshots.
  struct Load {
    float mass;
    std::array<float, 6> stress;
  };
  struct Snapshot {
    std::vector<Place> places;  ///< [particles]
    std::vector<Load> loads;    ///< [clusters]
    std::vector<Sums> targets;  ///< [nodes]
    std::vector<double> scale;  ///< 1 / root of the mass, [nodes]
  };
  class Descent;

  static Snapshot prepare(const QuadratureBody& body, const QuadratureSnapshot& state);
  static std::vector<Load> cluster_loads(const QuadratureBody& body, const QuadratureSnapshot& state);
  template <typename Use>
  static void at_nodes(const Place& place, const Load& load, const Use& use);
  /// Squared errors of mass and force over the nodes' masses, with a factor on what the points bring.
  std::array<double, 2> squares(double factor) const;

  std::vector<std::vector<int32_t>> members_;  ///< of each cluster
  std::vector<int32_t> points_;
  std::vector<Snapshot> snapshots_;
};

}  // namespace graupel::train
