#include "graph/cpu/messages/particle_codec.h"

#include <algorithm>
#include <cstring>

#include "graph/cpu/layer_weights.h"
#include "graph/features/features.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

namespace {

std::vector<std::vector<float>> embedding_rows_of(const nn::Weights& weights, int width) {
  const std::vector<float> table = weights.get("embedding.weight", {embedding_rows, width});
  std::vector<std::vector<float>> rows;
  rows.reserve(embedding_rows);
  for (int r = 0; r < embedding_rows; ++r)
    rows.emplace_back(table.begin() + r * width, table.begin() + (r + 1) * width);
  return rows;
}

}  // namespace

ParticleEncoder::ParticleEncoder(const nn::Weights& weights, const LayerPlan& plan)
    : width_(width_of(plan)),
      features_(static_cast<int>(plan.values.front().width)),
      slope_(static_cast<float>(plan.layers.front().slope)) {
  const FcnWeights fcn = load(weights, plan.layers.front());
  first_ = fcn.first_layer_part(0, features_, Bias::with);
  embedding_ = nn::InputTable(fcn, features_, embedding_rows_of(weights, static_cast<int>(plan.embedding)));
  middle_ = nn::MiddleLayers(fcn, slope_);
  last_ = nn::NormalizedLayer(fcn);
}

const float* ParticleEncoder::hidden(const int32_t* order, int rows, const std::vector<float>& features,
                                     const std::vector<int32_t>& particle_type, TileScratch& scratch) const {
  for (int r = 0; r < rows; ++r)
    std::memcpy(scratch.input.data() + r * features_, features.data() + static_cast<int64_t>(order[r]) * features_,
                sizeof(float) * static_cast<std::size_t>(features_));
  first_.apply(scratch.input.data(), features_, rows, scratch.hidden.data(), width_);
  for (int r = 0; r < rows; ++r) {
    float* hidden = scratch.hidden.data() + r * width_;
    const int type = embedding_row(particle_type[static_cast<std::size_t>(order[r])]);
    nn::activate_sum(hidden, hidden, embedding_.row(type), width_, slope_);
  }
  return middle_.apply(scratch.hidden.data(), scratch.output.data(), rows);
}

void ParticleEncoder::apply(const int32_t* order, int rows, const std::vector<float>& features,
                            const std::vector<int32_t>& particle_type, TileScratch& scratch, float* latent) const {
  last_.apply(hidden(order, rows, features, particle_type, scratch), rows, latent);
  for (int r = 0; r < rows; ++r) last_.finish(latent + r * width_);
}

ParticleDecoder::ParticleDecoder(const nn::Weights& weights, const LayerPlan& plan)
    : width_(width_of(plan)), slope_(static_cast<float>(plan.layers.back().slope)) {
  static_assert(3 * most_bundle <= nn::padded_width(1), "a row of latents holds the outputs of any network");
  const FcnWeights fcn = load(weights, plan.layers.back());
  outputs_ = fcn.out;
  first_ = fcn.first_layer_part(0, fcn.in, Bias::with);
  middle_ = nn::MiddleLayers(fcn, slope_);
  last_ = nn::Linear(fcn.out, fcn.hidden, fcn.weight2.data(), fcn.hidden, fcn.bias2);
}

void ParticleDecoder::apply(const float* latent, const int32_t* order, int rows, TileScratch& scratch,
                            std::vector<float>& acceleration) const {
  first_.apply(latent, width_, rows, scratch.hidden.data(), width_);
  after_first(order, rows, scratch, acceleration);
}

void ParticleDecoder::after_first(const int32_t* order, int rows, TileScratch& scratch,
                                  std::vector<float>& acceleration) const {
  for (int r = 0; r < rows; ++r) nn::activate_row(scratch.hidden.data() + r * width_, width_, slope_);
  const float* hidden = middle_.apply(scratch.hidden.data(), scratch.output.data(), rows);
  float* output = hidden == scratch.hidden.data() ? scratch.output.data() : scratch.hidden.data();
  last_.apply(hidden, width_, rows, output, width_);
  for (int r = 0; r < rows; ++r)
    std::copy_n(output + r * width_, outputs_, acceleration.data() + static_cast<int64_t>(order[r]) * outputs_);
}

}  // namespace graupel::graph
