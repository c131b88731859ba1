// G2P of one owner block: velocity, deformation, stress and motion of its particles from the 8^3 nodes around it.
// Equals grid_to_particle, update_deformation and move_particles of mpm/phases/; gain: mpm/gpu/blocks/batch_kernels.h.
#pragma once

#include "core/parallel/thread_block.h"
#include "mpm/gpu/blocks/batch_owner_blocks.h"
#include "mpm/gpu/blocks/batch_report.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm::batch {

/// Velocity and affine velocity of a particle from the nodes around it (mpm/physics/transfer.h).
GRAUPEL_HD inline void gather(const NodeSum* node, const Stencil<float, 3>& stencil, float inverse_dx, Vec<float, 3>& v,
                              Mat<float, 3>& C) {
  AxisWeights<float> w[3];
  for (int d = 0; d < 3; ++d) w[d] = bspline_weights(stencil.fx[d]);
  float sum[3] = {}, along[3][3] = {};  // along[d]: sum of w v (x_i - x_p) along axis d
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      float row[3] = {};
      const float w_row = w[0].w[i] * w[1].w[j];
      for (int k = 0; k < 3; ++k) {
        const NodeSum n = node[halo_index(stencil.base[0] + i, stencil.base[1] + j, stencil.base[2] + k)];
        const float weight = w_row * w[2].w[k], dz = static_cast<float>(k) - stencil.fx[2];
        for (int c = 0; c < 3; ++c) {
          const float part = weight * n.v[c];
          row[c] += part;
          along[2][c] += dz * part;
        }
      }
      const float dx = static_cast<float>(i) - stencil.fx[0], dy = static_cast<float>(j) - stencil.fx[1];
      for (int c = 0; c < 3; ++c) {
        sum[c] += row[c];
        along[0][c] += dx * row[c];
        along[1][c] += dy * row[c];
      }
    }
  for (int c = 0; c < 3; ++c) {
    v[c] = sum[c];
    for (int d = 0; d < 3; ++d) C(c, d) = 4.0f * inverse_dx * along[d][c];
  }
}

/// One particle: from the nodes to its new state. Returns whether it still lies in its block's arena.
GRAUPEL_HD inline bool advance_particle(const ParticleView<float>& p, const SceneView<float>& scene,
                                        const Vec<int, 3>& block, const NodeSum* node, int64_t slot, float dt,
                                        ParticleFindings& found) {
  const MaterialParameters<float>& m = scene.materials[p.material.get(slot)];
  const int32_t place = p.source_index.get(slot);
  Vec<float, 3> x = p.position.vec(slot), v;
  float internal = p.internal.get(slot);
  Mat<float, 3> F = Mat<float, 3>::identity();
  if (m.model == MaterialModel::stationary) {  // keeps place and velocity whatever the grid does
    state_statistics(scene.grid.dx, m, place, p.velocity.vec(slot), F, internal, dt, found);
    return true;
  }
  Mat<float, 3> C;
  gather(node, halo_stencil(scene.grid, block, x), scene.grid.inverse_dx, v, C);
  store_matrix<float, 3>(p.affine_velocity, slot, C);
  if (keeps_deformation(m.model)) {
    F = load_matrix<float, 3>(p.deformation_gradient, slot);
    trial_deformation(m, dt, C, F, internal);
    store_symmetric(p.stress, slot, map_and_stress_of_solid(m, dt, F, internal));
    store_matrix<float, 3>(p.deformation_gradient, slot, F);
  } else {
    trial_deformation(m, dt, C, F, internal);
    store_symmetric(p.stress, slot, fluid_stress(m, C, internal));
  }
  p.internal.set(slot, internal);
  if (!deformation_statistics(scene.grid.dx, m, F, internal, dt, found)) mark_bad(place, found);
  // Obstacles last: their search needs the registers that a deformation fills.
  move_point<false, 3>(scene, {}, false, place, m.density * p.volume.get(slot), dt, x, v, found);
  p.position.set_vec(slot, x);
  p.velocity.set_vec(slot, v);
  if (!velocity_statistics(v, found)) mark_bad(place, found);
  return is_in_halo(scene.grid, block, x);
}

/// All particles of a owner block, from its nodes in shared memory; `report` lies in shared memory too.
template <typename Block>
GRAUPEL_HD void advance_block(const Block& block, const ParticleView<float>& p, const SceneView<float>& scene,
                              const OwnerBlock& owner, float dt, const NodeSum* node, StepReport& report) {
  float speed2 = 0, sound_speed = 0;
  for (int32_t slot = owner.begin + block.thread(); slot < owner.end; slot += block.threads()) {
    ParticleFindings found;
    const bool inside = advance_particle(p, scene, owner.at, node, slot, dt, found);
    speed2 = found.largest_speed2 > speed2 ? found.largest_speed2 : speed2;
    sound_speed = found.largest_sound_speed > sound_speed ? found.largest_sound_speed : sound_speed;
    if (!inside || found.over_courant || found.bad_slot >= 0 || found.pushed_out)
      report_rare(block, found, inside, report);
  }
  block.max(&report.speed2, bits_of(speed2));
  block.max(&report.sound_speed, bits_of(sound_speed));
}

}  // namespace graupel::mpm::batch
