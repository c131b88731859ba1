#include "train/networks/cuda/fused_hgn.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/mm.h>

#include <initializer_list>

#include "graph/features/features.h"
#include "graph/plan/plan_walk.h"

namespace graupel::train {

namespace {

constexpr int corners = 8;
/// Pair q belongs to particle q / 8.
constexpr graph::RowOf by_particle{nullptr, 3, -1};

}  // namespace

/// From the gradient of the particles' latents before the decoder, block by block, to that of the encoder's result.
class FusedHgn::BackwardPass {
 public:
  BackwardPass(FusedHgn& network, const DeviceBatch& batch, float* grad_particles)
      : n_(network), batch_(batch), g_(grad_particles), skip_(batch.level.size()) {}

  float* run() {
    graph::run_blocks_in_reverse(n_.plan(), *this);
    return g_;
  }

  void grid_to_particle(const graph::PlanBlock& block);
  void pass_messages(const graph::PlanBlock& block);
  void prolong_to_fine(const graph::PlanBlock& block);
  void restrict_to_coarse(const graph::PlanBlock& block);
  void particle_to_grid(const graph::PlanBlock& block);

 private:
  const graph::AggregationRecord::Step& step_of(const graph::PlanBlock& block, int64_t iteration = 0) const {
    return n_.record_.blocks[block.number][static_cast<std::size_t>(iteration)];
  }
  graph::BlockLayers layers(const graph::PlanBlock& block, int64_t iteration = 0) const {
    return graph::layers_of(n_.plan(), block, iteration);
  }
  /// Back through the FCN `name` on [sum] or [sum, nodes], from the gradient g_ of its results: adds the products for
  /// all its weights, returns the gradient of the sum. To `nodes` goes the nodes' gradient, g_ included.
  const uint16_t* update_backward(const std::string& name, const graph::FusedMlp& network, float* nodes = nullptr);
  /// Runs a kernel of activation_aggregation.h, whose partial sums are the gradient of the last three columns of
  /// `matrix`.
  template <typename Gradient>
  void offsets_backward(const std::string& matrix, Gradient gradient);
  /// Gradient of nodes: add + sum over j of d[j] times the 128 columns of gather[j] from column[j] on.
  struct Projected {
    const uint16_t* d;
    const std::string& gather;
    int64_t column;
  };
  float* nodes_gradient(int64_t rows, std::initializer_list<Projected> projected, const float* add = nullptr);

  FusedHgn& n_;
  const DeviceBatch& batch_;
  float* g_;                            ///< gradient of what the block at hand made
  std::vector<float*> skip_;            ///< gradient of level l's cells through the up pass
  float* beside_cells_ = nullptr;       ///< of the particles' latents beside the cells
  const uint16_t* received_ = nullptr;  ///< of what grid_to_particle's gather layer takes of the particles
};

const uint16_t* FusedHgn::BackwardPass::update_backward(const std::string& name, const graph::FusedMlp& network,
                                                        float* nodes) {
  uint16_t* const sum = n_.rows16(network.rows);
  const Traces traces = n_.new_traces(network.rows);
  graph::FusedMlpGradient gradient{.network = network, .g32 = g_};
  gradient.operand[0] = {.d16 = sum};
  if (nodes) gradient.operand[1] = {.add32 = g_, .d32 = nodes};
  n_.back_through(name, gradient, traces);
  const std::string first = name + ".layer1";
  n_.add_product(network.rows, traces.d_sum, network.operand[0].rows, first, 0, h, true);
  if (nodes) n_.add_product(network.rows, traces.d_sum, network.operand[1].rows, first, h, h);
  return sum;
}

template <typename Gradient>
void FusedHgn::BackwardPass::offsets_backward(const std::string& matrix, Gradient gradient) {
  constexpr int parts = 3;
  gradient.partial = n_.partials(graph::most_offset_partials(), parts);
  const int rows = graph::sum_gradients(gradient, nullptr);
  const at::Tensor out = n_.gradient(matrix + ".weight");
  const auto columns = static_cast<int32_t>(out.size(1));
  n_.products_.add({.rows = rows,
                    .partial = gradient.partial,
                    .parts = parts,
                    .out = f32(out) + columns - parts,
                    .stride = columns});
}

float* FusedHgn::BackwardPass::nodes_gradient(int64_t rows, std::initializer_list<Projected> projected,
                                              const float* add) {
  float* const grad = n_.rows32(rows);
  graph::ProjectionGradient back{.rows = rows, .d = {}, .add32 = add, .sum32 = grad};
  graph::RowOperand* operand = back.d;
  for (const Projected& one : projected)
    *operand++ = {.rows = one.d, .weight = n_.packed_.tile(one.gather, one.column)};
  graph::project_back(back, nullptr);
  return grad;
}

void FusedHgn::BackwardPass::grid_to_particle(const graph::PlanBlock& block) {
  beside_cells_ = n_.rows32(batch_.particles);
  const graph::BlockLayers layer = layers(block);
  const std::string& gather = layer.gather->name;
  const int64_t n = batch_.particles, cells = batch_.level[0].cells;
  const graph::AggregationRecord::Step& step = step_of(block);
  const uint16_t* const sum = update_backward(layer.update->name, step.network, beside_cells_);
  uint16_t *const of_particles = n_.rows16(n), *const of_cells = n_.rows16(cells);
  offsets_backward(gather, graph::ActivationGradient{.nodes = n,
                                                     .items = {.fixed = corners},
                                                     .g = sum,
                                                     .is_receiver = true,
                                                     .weight = f32(batch_.weight),
                                                     .signs = step.signs,
                                                     .out = of_particles,
                                                     .corner_sign = -1,
                                                     .offset = f32(batch_.offset)});
  graph::sum_gradients(
      graph::ActivationGradient{
          .nodes = cells,
          .items = {.begin = index(batch_.pair_begin), .item = index(batch_.pair), .are_long = true},
          .g = sum,
          .row = by_particle,
          .weight = f32(batch_.weight),
          .signs = step.signs,
          .out = of_cells},
      nullptr);
  n_.add_product(n, of_particles, n_.record_.particles.f16, gather, h, h, true);
  n_.add_product(cells, of_cells, step.gathered, gather, 0, h);
  g_ = nodes_gradient(cells, {{of_cells, gather, 0}});
  received_ = of_particles;
}

void FusedHgn::BackwardPass::particle_to_grid(const graph::PlanBlock& block) {
  const graph::BlockLayers layer = layers(block);
  const std::string& gather = layer.gather->name;
  const int64_t n = batch_.particles;
  const graph::AggregationRecord::Step& step = step_of(block);
  const uint16_t* const sum = update_backward(layer.update->name, step.network);
  uint16_t* const sent = n_.rows16(n);
  const double scale = n_.plan().scale_of(block);
  offsets_backward(gather, graph::ActivationGradient{.nodes = n,
                                                     .items = {.fixed = corners},
                                                     .g = sum,
                                                     .row = {index(batch_.cell)},
                                                     .weight = f32(batch_.weight),
                                                     .scale = static_cast<float>(scale),
                                                     .signs = step.signs,
                                                     .out = sent,
                                                     .corner_sign = 1,
                                                     .offset = f32(batch_.offset)});
  n_.add_product(n, sent, n_.record_.particles.f16, gather, 0, h, true);
  g_ = nodes_gradient(n, {{received_, layers(n_.plan().blocks.back()).gather->name, h}, {sent, gather, 0}},
                      beside_cells_);
}

void FusedHgn::BackwardPass::restrict_to_coarse(const graph::PlanBlock& block) {
  const DeviceLevel& fine = batch_.level[block.level()];
  const graph::BlockLayers layer = layers(block);
  const std::string& gather = layer.gather->name;
  const graph::AggregationRecord::Step& step = step_of(block);
  const uint16_t* const sum = update_backward(layer.update->name, step.network);
  uint16_t* const sent = n_.rows16(fine.cells);
  offsets_backward(gather, graph::ActivationGradient{.nodes = fine.cells,
                                                     .items = {.fixed = 1},
                                                     .g = sum,
                                                     .row = {index(fine.parent)},
                                                     .signs = step.signs,
                                                     .out = sent,
                                                     .offsets = graph::Offsets::octant,
                                                     .octant = index(fine.octant)});
  n_.add_product(fine.cells, sent, step.gathered, gather, 0, h, true);
  g_ = nodes_gradient(fine.cells, {{sent, gather, 0}}, skip_[block.level()]);
}

void FusedHgn::BackwardPass::prolong_to_fine(const graph::PlanBlock& block) {
  const DeviceLevel& level = batch_.level[block.level()];
  const int64_t cells_above = batch_.level[block.level() + 1].cells;
  const std::string &name = layers(block).gather->name, first = name + ".layer1";
  float* const skip = skip_[block.level()] = n_.rows32(level.cells);
  uint16_t *const coarse = n_.rows16(level.cells), *const coarse_input = n_.rows16(level.cells);
  const Traces traces = n_.new_traces(level.cells);
  graph::FusedMlpGradient gradient{.network = step_of(block).network, .g32 = g_};
  gradient.network.operand[0].save = coarse_input;
  gradient.operand[0] = {.d16 = coarse};
  gradient.operand[1] = {.add32 = g_, .d32 = skip};
  n_.back_through(name, gradient, traces);
  n_.add_product(level.cells, traces.d_sum, coarse_input, first, 0, h);
  n_.add_product(level.cells, traces.d_sum, gradient.network.operand[1].rows, first, h, h, true);
  offsets_backward(first, graph::ActivationGradient{.nodes = level.cells,
                                                    .items = {.fixed = 1},
                                                    .g = traces.d_sum,
                                                    .is_receiver = true,
                                                    .scale = -1,
                                                    .offsets = graph::Offsets::octant,
                                                    .octant = index(level.octant)});
  g_ = n_.rows32(cells_above);
  graph::sum_segments({.segments = cells_above,
                       .begin = index(level.child_begin),
                       .item = index(level.child),
                       .source = coarse,
                       .out32 = g_},
                      nullptr);
}

void FusedHgn::BackwardPass::pass_messages(const graph::PlanBlock& block) {
  const DeviceLevel& level = batch_.level[block.level()];
  for (int64_t k = block.iterations; k-- > 0;) {
    const graph::BlockLayers layer = layers(block, k);
    const std::string& gather = layer.gather->name;
    const graph::AggregationRecord::Step& step = step_of(block, k);
    float* const beside_sums = n_.rows32(level.cells);
    const uint16_t* const sum = update_backward(layer.update->name, step.network, beside_sums);
    uint16_t *const sent = n_.rows16(level.cells), *const received = n_.rows16(level.cells);
    offsets_backward(gather, graph::EdgeGradient{.cells = level.cells,
                                                 .edge_begin = index(level.edge_begin),
                                                 .sender = index(level.sender),
                                                 .slot = index(level.slot),
                                                 .reverse = index(level.reverse),
                                                 .g = sum,
                                                 .signs = step.signs,
                                                 .sent = sent,
                                                 .received = received});
    n_.add_product(level.cells, sent, step.gathered, gather, 0, h);
    n_.add_product(level.cells, received, step.gathered, gather, h, h, true);
    g_ = nodes_gradient(level.cells, {{sent, gather, 0}, {received, gather, h}}, beside_sums);
  }
}

at::Tensor FusedHgn::forward(const DeviceBatch& batch) {
  const graph::RowLatents latents = graph::forward_aggregation(packed_, begin(batch), *this, record_, nullptr);
  if (!has_own_decoder()) return decode(latents.f32, batch.particles);
  before_decoder_ = latents.f16;
  at::Tensor out = at::empty({batch.particles, 3}, number_);
  graph::Decoder decoder = packed_.decoder();
  decoder.rows = batch.particles;
  decoder.x16 = latents.f16;
  decoder.out = f32(out);
  graph::decode(decoder, nullptr);
  return out;
}

void FusedHgn::backward(const DeviceBatch& batch, const at::Tensor& grad) {
  float* const grad_latents = has_own_decoder() ? own_decoder_backward(batch.particles, grad)
                                                : f32(kept_.emplace_back(decoder_backward(grad).contiguous()));
  encoder_backward(batch, BackwardPass(*this, batch, grad_latents).run());
}

float* FusedHgn::own_decoder_backward(int64_t particles, const at::Tensor& grad) {
  const std::string& name = plan().layers.back().name;
  const graph::Decoder decoder = packed_.decoder();
  graph::DecoderGradient back{.rows = particles,
                              .x16 = before_decoder_,
                              .w1 = decoder.w1,
                              .b1 = decoder.b1,
                              .w2 = decoder.w2,
                              .g = f32(kept_.emplace_back(grad.contiguous())),
                              .d_sum = rows16(particles),
                              .d_x = rows32(particles),
                              .partial = partials(graph::most_norm_partials(), 4)};
  const int rows = graph::decode_backward(back, nullptr);
  products_.add({.rows = rows,
                 .partial = back.partial,
                 .parts = 4,
                 .out = f32(gradient(name + ".layer2.weight")),
                 .step = h,
                 .bias = f32(gradient(name + ".layer2.bias")),
                 .biases = 3});
  add_product(particles, back.d_sum, before_decoder_, name + ".layer1", 0, h, true);
  return back.d_x;
}

void FusedHgn::encoder_backward(const DeviceBatch& batch, const float* grad) {
  // The inputs that belong to the embedding are a row of it a type: first the sums over the particles of a type.
  const std::string& name = plan().layers.front().name;
  const Traces traces = new_traces(batch.particles);
  back_through(name, {.network = record_.encoder, .g32 = grad}, traces);
  const int64_t features = batch.features.size(1);
  const at::Tensor inputs = at::cat({batch.features, batch.type_one_hot}, 1);
  const at::Tensor sums = kept_.emplace_back(at::empty({h, inputs.size(1)}, number_));
  products_.add({.rows = batch.particles,
                 .d = traces.d_sum,
                 .x = packed(inputs),
                 .out = f32(sums),
                 .stride = static_cast<int32_t>(inputs.size(1)),
                 .columns = static_cast<int32_t>(inputs.size(1)),
                 .bias = f32(gradient(name + ".layer1.bias"))});
  products_.run(nullptr);
  const at::Tensor by_type = sums.narrow(1, features, graph::embedding_rows), w1 = weight(name + ".layer1.weight"),
                   w1_grad = gradient(name + ".layer1.weight");
  at::Tensor embedding_columns = w1_grad.narrow(1, features, plan().embedding),
             embedding_grad = gradient("embedding.weight");
  w1_grad.narrow(1, 0, features).copy_(sums.narrow(1, 0, features));
  at::mm_out(embedding_columns, by_type, weight("embedding.weight"));
  at::mm_out(embedding_grad, by_type.t(), w1.narrow(1, features, plan().embedding));
}

}  // namespace graupel::train
