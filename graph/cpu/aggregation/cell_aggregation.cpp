#include "graph/cpu/aggregation/cell_aggregation.h"

#include "graph/cpu/layer_weights.h"
#include "graph/topology/offset_tables.h"
#include "nn/activated_sums.h"

namespace graupel::graph {

using nn::FcnWeights;
using Bias = FcnWeights::Bias;

namespace {

float* row_of(Buffer<float>& buffer, int64_t row, int width) { return buffer.data() + row * width; }

}  // namespace

CellAggregation::CellAggregation(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block,
                                 std::size_t k)
    : width_(width_of(plan)) {
  const std::vector<PlanLayer> layers = plan.layers_of(block);
  const FcnWeights layer = load(weights, layers[2 * k]);
  const int h = layer.out;
  gathered_ = nn::StackedLinear(h, {{&layer, 0, Bias::without}, {&layer, h, Bias::with}});
  direction_ = nn::InputTable(layer, 2 * h, slot_directions());
  network_ = ReceiverNetwork(load(weights, layers[2 * k + 1]), ReceiverNetwork::Inputs::sum_and_latent);
}

void CellAggregation::apply(const sparsegrid::Hierarchy<3>& hierarchy, std::size_t level, const nn::Linear& next_layer,
                            AggregationWorkspace& workspace) const {
  const auto& cells = hierarchy.levels[level];
  const auto count = static_cast<int64_t>(cells.size());
  Buffer<float>& latent = workspace.cell[level];
  for_each_range(workspace, count, sum_rows(count), [&](int32_t begin, int32_t end, TileScratch& scratch) {
    with_rows(workspace, [&](auto word) {
      using Word = decltype(word);
      for (int32_t c = begin; c < end; ++c)
        gather<Word>(cells.neighbor[static_cast<std::size_t>(c)],
                     workspace.current.row<Word>(2 * int64_t{c} + 1, width_), workspace.current.row<Word>(0, width_),
                     network_.sum(scratch, c - begin));
    });
    network_.apply(scratch, end - begin, row_of(latent, begin, width_), workspace.next_rows(next_layer, begin));
  });
  workspace.advance();
}

template <typename Word>
void CellAggregation::gather(const std::array<int32_t, 6>& neighbor, const Word* receiver, const Word* rows,
                             float* sum) const {
  nn::ActivatedRow<Word> edges[6];
  int count = 0;
  for (int slot = 0; slot < 6; ++slot) {
    const int64_t sender = neighbor[static_cast<std::size_t>(slot)];
    edges[count] = {rows + 2 * sender * nn::words_of<Word>(width_), direction_.row(slot), 1.0f};
    count += sender >= 0;  // no branch: whether a neighbour is there is hard to foretell
  }
  nn::sum_activated(width_, count, edges, receiver, sum);
}

RestrictAggregation::RestrictAggregation(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block)
    : level_(block.level()), width_(width_of(plan)) {
  const std::vector<PlanLayer> layers = plan.layers_of(block);
  const FcnWeights layer = load(weights, layers[0]);
  const int h = layer.out;
  gathered_ = layer.first_layer_part(0, h, Bias::with);
  octant_ = nn::InputTable(layer, h, octant_offsets(-1));
  network_ = ReceiverNetwork(load(weights, layers[1]), ReceiverNetwork::Inputs::sum);
}

void RestrictAggregation::apply(const sparsegrid::Hierarchy<3>& hierarchy, const nn::Linear& next_layer,
                                AggregationWorkspace& workspace) const {
  const auto cells = static_cast<int64_t>(hierarchy.levels[level_ + 1].size());
  const HostLinks& links = workspace.topology.levels[level_];
  const auto& octant = hierarchy.levels[level_].octant;
  Buffer<float>& latent = workspace.cell[level_ + 1];
  for_each_range(workspace, cells, sum_rows(cells), [&](int32_t begin, int32_t end, TileScratch& scratch) {
    with_rows(workspace, [&](auto word) {
      using Word = decltype(word);
      for (int32_t c = begin; c < end; ++c) {
        float* const sum = network_.sum(scratch, c - begin);
        nn::clear_row(sum, width_);
        nn::ActivatedRow<Word> rows[8];
        int count = 0;
        const auto parent = static_cast<std::size_t>(c);
        for (int32_t i = links.child_begin[parent]; i < links.child_begin[parent + 1]; ++i) {
          const int32_t child = links.child[static_cast<std::size_t>(i)];
          rows[count++] = {workspace.current.row<Word>(child, width_),
                           octant_.row(octant[static_cast<std::size_t>(child)]), 1.0f};
        }
        nn::add_activated(width_, count, rows, sum);
      }
    });
    network_.apply(scratch, end - begin, row_of(latent, begin, width_), workspace.next_rows(next_layer, begin));
  });
  workspace.advance();
}

Prolong::Prolong(const nn::Weights& weights, const LayerPlan& plan, const PlanBlock& block)
    : level_(block.level()), width_(width_of(plan)) {
  const FcnWeights fcn = load(weights, plan.layers_of(block).front());
  const int h = fcn.out;
  gathered_ = fcn.first_layer_part(0, h, Bias::with);
  fine_part_ = fcn.first_layer_part(h, h, Bias::without);
  octant_ = nn::InputTable(fcn, 2 * h, octant_offsets(1));
  second_ = nn::NormalizedLayer(fcn);
}

void Prolong::apply(const sparsegrid::Hierarchy<3>& hierarchy, const nn::Linear& next_layer,
                    AggregationWorkspace& workspace) const {
  const auto& fine = hierarchy.levels[level_];
  const auto count = static_cast<int64_t>(fine.size());
  Buffer<float>& latent = workspace.cell[level_];
  for_each_range(workspace, count, sum_rows(count), [&](int32_t begin, int32_t end, TileScratch& scratch) {
    float* const f = row_of(latent, begin, width_);
    fine_part_.apply(f, width_, end - begin, scratch.hidden.data(), width_);
    with_rows(workspace, [&](auto word) {
      using Word = decltype(word);
      for (int32_t c = begin; c < end; ++c) {
        float* const hidden = scratch.hidden.data() + int64_t{c - begin} * width_;
        const auto cell = static_cast<std::size_t>(c);
        const nn::ActivatedRow<Word> row = {workspace.current.row<Word>(fine.parent[cell], width_),
                                            octant_.row(fine.octant[cell]), 1.0f};
        nn::sum_activated(width_, 1, &row, hidden, hidden);
      }
    });
    finish_latents(second_, scratch.hidden.data(), end - begin, true, f, workspace.next_rows(next_layer, begin),
                   scratch);
  });
  workspace.advance();
}

}  // namespace graupel::graph
