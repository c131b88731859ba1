#include "graph/sums/receiver_network.h"

#include <algorithm>

namespace graupel::graph {

ReceiverNetwork::ReceiverNetwork(const nn::FcnWeights& fcn, Inputs inputs)
    : width_(nn::padded_width(fcn.hidden)),
      inputs_(inputs == Inputs::sum ? 1 : 2),
      first_(fcn.first_layer_of_padded(inputs_)),
      second_(fcn) {}

void ReceiverNetwork::apply(TileScratch& scratch, int32_t rows, float* latent) const {
  float* const hidden = scratch.hidden.data();
  float* const output = scratch.output.data();
  const int64_t stride = int64_t{inputs_} * width_;
  if (inputs_ == 2)
    for (int32_t r = 0; r < rows; ++r) std::copy_n(latent + int64_t{r} * width_, width_, sum(scratch, r) + width_);
  first_.apply(scratch.input.data(), stride, rows, hidden, width_);
  for (int32_t r = 0; r < rows; ++r) nn::activate_row(hidden + int64_t{r} * width_, width_);
  second_.apply(hidden, rows, output);
  for (int32_t r = 0; r < rows; ++r) {
    float* const f = latent + int64_t{r} * width_;
    const float* const y = output + int64_t{r} * width_;
    if (inputs_ == 2)
      second_.add_to(f, y);
    else
      second_.finish(f, y);
  }
}

}  // namespace graupel::graph
