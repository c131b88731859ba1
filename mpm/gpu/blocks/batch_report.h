// From what single particles report to the end of a scene's substep: particle, block of threads, scene.
#pragma once

#include "mpm/gpu/blocks/batch_owner_blocks.h"
#include "mpm/gpu/blocks/step_control.h"

namespace graupel::mpm::batch {

/// Momentum in units of momentum_unit, whose sum does not depend on the order.
struct FixedMomentum {
  long long units = 0;
  GRAUPEL_HD void operator+=(double momentum) { units += static_cast<long long>(momentum / momentum_unit); }
};

/// What one particle reports: the members of StepStatistics that concern it.
struct ParticleFindings {
  float largest_speed2 = 0, largest_sound_speed = 0;
  int32_t over_courant = 0, bad_slot = -1, pushed_out = 0;
  FixedMomentum pushed_momentum[3];
};

GRAUPEL_HD inline uint32_t bits_of(float non_negative) {
  union {
    float number;
    uint32_t bits;
  } u = {non_negative};
  return u.bits;
}
GRAUPEL_HD inline float number_of(uint32_t bits) {
  union {
    uint32_t bits;
    float number;
  } u = {bits};
  return u.number;
}

/// Adds what a particle reports beside its speeds to the report of its block.
template <typename Block>
GRAUPEL_HD void report_rare(const Block& block, const ParticleFindings& found, bool inside, StepReport& report) {
  if (!inside) block.add(&report.left_halo, 1);
  if (found.over_courant > 0) block.add(&report.over_courant, found.over_courant);
  if (found.bad_slot >= 0) block.min(&report.bad_particle, found.bad_slot);
  if (found.pushed_out == 0) return;
  block.add(&report.pushed_out, static_cast<unsigned long long>(found.pushed_out));
  for (int d = 0; d < 3; ++d)
    block.add(&report.pushed_momentum[d], static_cast<unsigned long long>(found.pushed_momentum[d].units));
}

/// Adds a block's report of `substeps` substeps to its scene's; the last block of a scene ends them. `view` is a
/// BatchView or has its scenes, controls and reports.
template <typename Block, typename View>
GRAUPEL_HD void report_block(const Block& block, const View& view, int32_t scene, const StepReport& mine,
                             int32_t substeps) {
  StepReport& all = view.reports[scene];
  SceneProgress& control = view.controls[scene];
  block.max(&all.speed2, mine.speed2);
  block.max(&all.sound_speed, mine.sound_speed);
  if (substeps > 1) {
    block.max(&all.before_speed2, mine.before_speed2);
    block.max(&all.before_sound_speed, mine.before_sound_speed);
    block.max(&all.peak_sound_speed, mine.peak_sound_speed);
  }
  if (mine.left_halo) block.add(&all.left_halo, mine.left_halo);
  if (mine.over_courant) block.add(&all.over_courant, mine.over_courant);
  if (mine.bad_particle != no_bad_particle) block.min(&all.bad_particle, mine.bad_particle);
  if (mine.pushed_out) {
    block.add(&all.pushed_out, mine.pushed_out);
    for (int d = 0; d < 3; ++d) block.add(&all.pushed_momentum[d], mine.pushed_momentum[d]);
  }
  for (int d = 0; d < 3; ++d)
    if (mine.scripted_momentum[d]) block.add(&all.scripted_momentum[d], mine.scripted_momentum[d]);
  block.fence();
  if (block.add(&all.blocks_done, 1) != control.blocks - 1) return;
  block.fence();
  StepReport found;
  found.speed2 = block.exchange(&all.speed2, 0u);
  found.sound_speed = block.exchange(&all.sound_speed, 0u);
  found.before_speed2 = block.exchange(&all.before_speed2, 0u);
  found.before_sound_speed = block.exchange(&all.before_sound_speed, 0u);
  found.peak_sound_speed = block.exchange(&all.peak_sound_speed, 0u);
  found.left_halo = block.exchange(&all.left_halo, 0);
  found.over_courant = block.exchange(&all.over_courant, 0);
  found.bad_particle = block.exchange(&all.bad_particle, no_bad_particle);
  found.pushed_out = block.exchange(&all.pushed_out, 0ull);
  for (int d = 0; d < 3; ++d) {
    found.pushed_momentum[d] = block.exchange(&all.pushed_momentum[d], 0ull);
    found.scripted_momentum[d] = block.exchange(&all.scripted_momentum[d], 0ull);
  }
  block.exchange(&all.blocks_done, 0);
  if (substeps > 1)
    count_earlier_substeps(view.scenes[scene], substeps - 1, number_of(found.before_speed2),
                           number_of(found.before_sound_speed), number_of(found.peak_sound_speed), control);
  finish_substep(view.scenes[scene], found, number_of(found.speed2), number_of(found.sound_speed), control);
}

}  // namespace graupel::mpm::batch
