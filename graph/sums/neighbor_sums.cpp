#include "graph/sums/neighbor_sums.h"

#include <cmath>

#include "graph/gns_graph.h"
#include "nn/activated_sums.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

namespace {

constexpr int most_links = 64;  ///< whose parts are made at once; they stay in the first-level cache

std::vector<std::vector<float>> unit_features() {
  std::vector<std::vector<float>> units(edge_feature_count, std::vector<float>(edge_feature_count, 0.0f));
  for (std::size_t i = 0; i < edge_feature_count; ++i) units[i][i] = 1;
  return units;
}

}  // namespace

NeighborSums::NeighborSums(const nn::Weights& weights, const HgnConfig& config)
    : width_(nn::padded_width(static_cast<int>(config.latent))),
      scale_(static_cast<float>(config.p2g_scale)),
      radius_(config.short_radius()) {
  const int h = static_cast<int>(config.latent);
  const FcnWeights layer = FcnWeights::load_layer(weights, "short_range.gather", 2 * h + edge_feature_count, h);
  gathered_ = nn::StackedLinear(h, {{&layer, 0, Bias::without}, {&layer, h, Bias::with}});
  link_ = nn::InputTable(layer, 2 * h, unit_features());
  network_ =
      ReceiverNetwork(FcnWeights::load(weights, "short_range", 2 * h, h, h), ReceiverNetwork::Inputs::sum_and_latent);
}

void NeighborSums::link(const std::vector<Vec3f>& position, SumWorkspace& workspace) const {
  workspace.position.clear();
  for (const int32_t p : workspace.topology.order) workspace.position.push_back(position[static_cast<std::size_t>(p)]);
  workspace.links = sparsegrid::build_radius_graph(workspace.position, radius_, sparsegrid::SelfEdges::with);
  workspace.neighbor.resize(position.size(), 2 * width_);
}

NextRows NeighborSums::rows(int32_t begin, SumWorkspace& workspace) const {
  const nn::Linear& layer = gathered_.linear();
  if (workspace.on_units) return {.layer = layer, .packed = workspace.neighbor.row<uint32_t>(begin, layer.width())};
  return {.layer = layer, .floats = workspace.neighbor.row<float>(begin, layer.width())};
}

void NeighborSums::apply(int32_t begin, int32_t end, const NextRows& next, SumWorkspace& workspace,
                         TileScratch& scratch) const {
  with_rows(workspace, [&](auto word) {
    for (int32_t r = begin; r < end; ++r)
      gather<decltype(word)>(r, workspace, scratch, network_.sum(scratch, r - begin));
  });
  network_.apply(scratch, end - begin, workspace.particle.data() + int64_t{begin} * width_, next);
}

template <typename Word>
void NeighborSums::gather(int32_t receiver, const SumWorkspace& workspace, TileScratch& scratch, float* sum) const {
  const auto at = static_cast<std::size_t>(receiver);
  const int32_t end = workspace.links.begin[at + 1];
  const Word* const own = workspace.neighbor.row<Word>(2 * int64_t{receiver} + 1, width_);
  float *const parts = scratch.output.data(), *const sum_of_some = parts + int64_t{most_links} * width_;
  nn::clear_row(sum, width_);
  nn::ActivatedRow<Word> rows[most_links];
  for (int32_t first = workspace.links.begin[at]; first < end; first += most_links) {
    const int count = std::min(most_links, end - first);
    for (int k = 0; k < count; ++k) {
      const int32_t sender = workspace.links.sender[static_cast<std::size_t>(first + k)];
      float* const part = parts + int64_t{k} * width_;
      link_part(workspace.position[static_cast<std::size_t>(sender)], workspace.position[at], part);
      rows[k] = {workspace.neighbor.row<Word>(2 * int64_t{sender}, width_), part, scale_};
    }
    nn::sum_activated(width_, count, rows, own, sum_of_some);
    nn::add_scaled_row(sum, 1, sum_of_some, width_);
  }
}

void NeighborSums::link_part(const Vec3f& sender, const Vec3f& receiver, float* part) const {
  const Vec3f d = (sender - receiver) * static_cast<float>(1 / radius_);
  const float length = norm(d);
  nn::clear_row(part, width_);
  nn::add_three_rows(part, {d[0], d[1], d[2]}, {link_.row(0), link_.row(1), link_.row(2)}, width_);
  nn::add_scaled_row(part, length, link_.row(3), width_);
}

}  // namespace graupel::graph
