// The first and the last network of every graph network: particle features -> latents, latents -> accelerations.
#pragma once

#include <vector>

#include "graph/plan/layer_plan.h"
#include "graph/topology/tiles.h"
#include "nn/fcn.h"

namespace graupel::graph {

/// f_p = FCN([features, embedding]).
class ParticleEncoder {
 public:
  ParticleEncoder(const nn::Weights& weights, const LayerPlan& plan);

  /// Activated rows in front of the last layer, in scratch; the other arguments as below.
  const float* hidden(const int32_t* order, int rows, const std::vector<float>& features,
                      const std::vector<int32_t>& particle_type, TileScratch& scratch) const;
  const nn::NormalizedLayer& last() const { return last_; }
  /// Latents of particles order[0] to order[rows - 1], rows <= tile_rows, into rows of `latent`.
  void apply(const int32_t* order, int rows, const std::vector<float>& features,
             const std::vector<int32_t>& particle_type, TileScratch& scratch, float* latent) const;

 private:
  int width_, features_;
  float slope_;
  nn::Linear first_;
  nn::InputTable embedding_;  ///< per type, its part of the first layer
  nn::MiddleLayers middle_;
  nn::NormalizedLayer last_;
};

/// Normalised accelerations of the frames to come, an FCN without norm.
class ParticleDecoder {
 public:
  ParticleDecoder(const nn::Weights& weights, const LayerPlan& plan);

  const nn::Linear& first() const { return first_; }
  /// Row order[r] of `acceleration` from what first() made of row r, in row r of scratch.hidden.
  void after_first(const int32_t* order, int rows, TileScratch& scratch, std::vector<float>& acceleration) const;
  /// Row order[r] of `acceleration` from row r of `latent`, rows <= tile_rows. Overwrites scratch.hidden and .output.
  void apply(const float* latent, const int32_t* order, int rows, TileScratch& scratch,
             std::vector<float>& acceleration) const;

 private:
  int width_, outputs_;
  float slope_;
  nn::Linear first_, last_;
  nn::MiddleLayers middle_;
};

}  // namespace graupel::graph
