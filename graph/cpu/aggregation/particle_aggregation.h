// The first and the last steps of a network that sums activations: particle features -> latents -> level-0 cells, and
// back from the cells to accelerations (docs/decisions/0011-sums-of-activations.md), a(x) = leaky_relu(x):
// f_p being those of the encoder;
//   f_c = FCN(p2g_scale sum over pairs of w a(W [f_p, (centre - x)/R] + b))
//   f_p <- f_p + FCN([sum over corners of w a(W [f_c, f_p, (x - centre)/R] + b), f_p])
#pragma once

#include <vector>

#include "graph/cpu/aggregation/aggregation_workspace.h"
#include "graph/cpu/aggregation/receiver_network.h"
#include "graph/cpu/messages/particle_codec.h"

namespace graupel::graph {

class ParticleAggregation {
 public:
  ParticleAggregation(const nn::Weights& weights, const LayerPlan& plan);

  /// f_p of all particles, and what the grid gathers of them.
  void encode(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
              const sparsegrid::Hierarchy<3>& hierarchy, AggregationWorkspace& workspace) const;
  /// Ends with what the `next` step gathers of the cells.
  void particle_to_grid(const sparsegrid::Hierarchy<3>& hierarchy, const nn::Linear& next_layer,
                        AggregationWorkspace& workspace) const;
  /// What grid_to_particle gathers of cells, [H].
  const nn::Linear& gathered() const { return g2p_cell_part_; }
  /// Normalised accelerations [n, output_width()].
  void grid_to_particle(const sparsegrid::Hierarchy<3>& hierarchy, AggregationWorkspace& workspace,
                        std::vector<float>& acceleration) const;

 private:
  void encode_tile(int32_t begin, int32_t end, const std::vector<float>& features,
                   const std::vector<int32_t>& particle_type, const sparsegrid::Hierarchy<3>& hierarchy,
                   AggregationWorkspace& workspace, TileScratch& scratch) const;
  /// Where p2g_part_ of a tile's latents goes; `spare` where it is packed after.
  NextLayerRows grid_rows(int32_t begin, float* spare, AggregationWorkspace& workspace) const;
  /// The rest of what the grid gathers.
  void leave_for_grid(int32_t begin, int32_t end, const NextLayerRows& part, const sparsegrid::Hierarchy<3>& hierarchy,
                      AggregationWorkspace& workspace) const;
  /// Word as in GatheredRows.
  template <typename Word>
  void gather_to_cell(const sparsegrid::HierarchyLevel<3>& cells, int32_t cell, const AggregationWorkspace& workspace,
                      float* sum) const;
  template <typename Word>
  void gather_to_particle(std::size_t particle, const sparsegrid::Hierarchy<3>& hierarchy,
                          const AggregationWorkspace& workspace, const float* own, float* sum) const;
  void decode_tile(int32_t begin, int32_t end, const sparsegrid::Hierarchy<3>& hierarchy,
                   AggregationWorkspace& workspace, TileScratch& scratch, std::vector<float>& acceleration) const;
  /// part += sum over axes of offset * axis row.
  void add_offset(const Vec3f& offset, const nn::InputTable& axis, float* part) const;

  int width_;
  float p2g_scale_;
  ParticleEncoder encoder_;
  nn::Linear p2g_part_, g2p_part_, g2p_cell_part_;  ///< of f_p, of f_p, of f_c
  nn::InputTable p2g_corner_, g2p_corner_;          ///< per corner, the part of its integer offset
  nn::InputTable p2g_axis_, g2p_axis_;              ///< per axis, the part of a unit offset
  ReceiverNetwork cell_network_, particle_network_;
  ParticleDecoder decoder_;
};

}  // namespace graupel::graph
