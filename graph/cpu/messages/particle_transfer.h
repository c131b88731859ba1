// Steps 0, 1, 11 and 12 of the HGN paper (section 3.2): particle features -> latents -> level-0 cells, and back from
// the cells to accelerations.
#pragma once

#include <vector>

#include "graph/cpu/messages/particle_codec.h"
#include "graph/cpu/workspace.h"
#include "nn/fcn.h"

namespace graupel::graph {

class ParticleTransfer {
 public:
  ParticleTransfer(const nn::Weights& weights, const LayerPlan& plan);

  /// f_p = FCN([features, embedding]) for all particles, and the particles' parts of both transfers' first layers.
  void encode(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
              const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const;
  /// f_c = p2g_scale sum over pairs of w FCN([f_p, (centre - x)/R]).
  void particle_to_grid(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace) const;
  /// Decoder(f_p + sum over pairs of w FCN([f_c, f_p, (x - centre)/R])), normalised accelerations [n, output_width()].
  void grid_to_particle(const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                        std::vector<float>& acceleration) const;

 private:
  void encode_tile(int32_t begin, int32_t end, const std::vector<float>& features,
                   const std::vector<int32_t>& particle_type, const sparsegrid::Hierarchy<3>& hierarchy,
                   Workspace& workspace, TileScratch& scratch) const;
  void gather_tile(int32_t begin, int32_t end, const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                   TileScratch& scratch) const;
  void decode_tile(int32_t begin, int32_t end, const sparsegrid::Hierarchy<3>& hierarchy, Workspace& workspace,
                   TileScratch& scratch, std::vector<float>& acceleration) const;

  int width_;
  float p2g_scale_;
  ParticleEncoder encoder_;
  nn::StackedLinear particle_part_;         ///< of f_p: P2G, G2P
  nn::InputTable p2g_corner_, g2p_corner_;  ///< per corner, the part of its integer offset
  nn::InputTable p2g_axis_, g2p_axis_;      ///< per axis, the part of a unit offset
  nn::NormalizedLayer p2g_second_, g2p_second_;
  nn::Linear g2p_cell_part_;
  ParticleDecoder decoder_;
};

}  // namespace graupel::graph
