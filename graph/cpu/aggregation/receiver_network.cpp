#include "graph/cpu/aggregation/receiver_network.h"

#include <algorithm>

#include "core/system/error.h"
#include "nn/matrix_extension_mlp.h"

namespace graupel::graph {

namespace {

/// On units for bf16, where they are used for all layers; else false, and nothing is done.
bool apply_on_units(const nn::Linear* first, const nn::NormalizedLayer& second, const NextLayerRows& next_rows,
                    nn::ChainRows rows) {
  const nn::MatrixExtensionMlp chain{.first = first ? first->on_units() : nn::MatrixExtensionLayer(),
                                     .second = second.linear().on_units(),
                                     .next = next_rows.layer.on_units(),
                                     .gamma = second.gamma(),
                                     .beta = second.beta(),
                                     .out = second.linear().out()};
  if ((first && !chain.first.tiles) || !chain.second.tiles || !chain.next.tiles ||
      second.width() > nn::most_chain_width) {
    GRAUPEL_ASSERT(!next_rows.packed);
    return false;
  }
  rows.next = next_rows.floats;
  rows.packed_next = next_rows.packed;
  nn::apply_chain_on_units(chain, rows);
  return true;
}

}  // namespace

void finish_latents(const nn::NormalizedLayer& second, const float* hidden, int32_t rows, bool add, float* latent,
                    const NextLayerRows& next_rows, TileScratch& scratch) {
  const int width = second.width();
  if (apply_on_units(nullptr, second, next_rows,
                     {.rows = rows, .input = hidden, .input_stride = width, .latent = latent, .add = add}))
    return;
  float* const output = scratch.output.data();
  second.apply(hidden, rows, output);
  for (int32_t r = 0; r < rows; ++r) {
    float* const f = latent + int64_t{r} * width;
    const float* const y = output + int64_t{r} * width;
    if (add)
      second.add_to(f, y);
    else
      second.finish(f, y);
  }
  next_rows.layer.apply(latent, width, rows, next_rows.floats, next_rows.layer.width());
}

ReceiverNetwork::ReceiverNetwork(const nn::FcnWeights& fcn, Inputs inputs)
    : width_(nn::padded_width(fcn.hidden)),
      inputs_(inputs == Inputs::sum ? 1 : 2),
      first_(fcn.first_layer_of_padded(inputs_)),
      second_(fcn) {}

void ReceiverNetwork::apply(TileScratch& scratch, int32_t rows, float* latent, const NextLayerRows& next_rows) const {
  const bool both = inputs_ == 2;
  if (apply_on_units(&first_, second_, next_rows,
                     {.rows = rows,
                      .input = scratch.sums.data(),
                      .input_stride = width_,
                      .latent = latent,
                      .with_latent = both,
                      .add = both}))
    return;
  float* const hidden = scratch.hidden.data();
  float* const input = both ? scratch.input.data() : scratch.sums.data();
  if (both)
    for (int32_t r = 0; r < rows; ++r) {
      std::copy_n(sum(scratch, r), width_, input + 2 * int64_t{r} * width_);
      std::copy_n(latent + int64_t{r} * width_, width_, input + (2 * int64_t{r} + 1) * width_);
    }
  first_.apply(input, int64_t{inputs_} * width_, rows, hidden, width_);
  for (int32_t r = 0; r < rows; ++r) nn::activate_row(hidden + int64_t{r} * width_, width_);
  finish_latents(second_, hidden, rows, both, latent, next_rows, scratch);
}

}  // namespace graupel::graph
