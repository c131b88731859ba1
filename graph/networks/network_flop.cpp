#include "graph/networks/network_flop.h"

#include "graph/topology/gns_graph.h"

namespace graupel::graph {

namespace {

constexpr double flop_of_multiply_add = 2;
constexpr double pairs_of_particle = 8;
constexpr double offset = 3;  ///< numbers of a pair's or an edge's offset

/// Multiply-adds of one HGN layer or FCN after another, a row. The names of the parts are those of
/// hierarchical_graph_network.h.
struct HgnCost {
  double particle = 0;                          ///< all that is done for a particle and its pairs
  double cell0 = 0;                             ///< for a cell of level 0 beside its block
  double cell = 0, edge = 0;                    ///< a block of message passing
  double between_fine = 0, between_coarse = 0;  ///< restrict and prolong, for a cell of either level
};

double decoder_cost(const HgnConfig& config) {
  const auto h = static_cast<double>(config.latent);
  return h * h + static_cast<double>(config.output_width()) * h;
}

/// Of a network that sums activations: gather layers once a pair or an edge, FCNs once a receiver.
HgnCost whole_cost_of_sums(const HgnConfig& config) {
  const auto h = static_cast<double>(config.latent), iterations = static_cast<double>(config.message_passing);
  const double encoder = static_cast<double>(config.input_width()) * h + h * h, decoder = decoder_cost(config);
  const double from_one = (h + offset) * h, from_two = (2 * h + offset) * h;  // gather layers
  const double on_sum = h * h + h * h, on_sum_and_latent = 2 * h * h + h * h;
  return {.particle = encoder + pairs_of_particle * (from_one + from_two) + on_sum_and_latent + decoder,
          .cell0 = on_sum,
          .cell = iterations * on_sum_and_latent,
          .edge = iterations * from_two,
          .between_fine = from_one + (2 * h + offset) * h + h * h,
          .between_coarse = on_sum};
}

/// The same with gather layers and prolongation taken apart, projected once a node.
HgnCost split_cost_of_sums(const HgnConfig& config) {
  const auto h = static_cast<double>(config.latent), iterations = static_cast<double>(config.message_passing);
  const double encoder = static_cast<double>(config.input_width() - config.embedding) * h + h * h,
               decoder = decoder_cost(config);
  return {.particle = encoder + 2 * h * h + (2 * h * h + h * h) + decoder,  // gathered there and back; its own FCN
          .cell0 = h * h + h * h + h * h,                                   // its FCN; what particles gather
          .cell = iterations * (2 * h * h + 2 * h * h + h * h),             // sender and receiver parts; its own FCN
          .between_fine = h * h + h * h + h * h,                            // its part of restrict; prolong
          .between_coarse = h * h + h * h + h * h};
}

HgnCost whole_cost(const HgnConfig& config) {
  const auto h = static_cast<double>(config.latent), iterations = static_cast<double>(config.message_passing);
  const double encoder = static_cast<double>(config.input_width()) * h + h * h, decoder = decoder_cost(config);
  const double to_grid = (h + offset) * h + h * h, to_particle = (2 * h + offset) * h + h * h;
  const double first_edge = (2 * h + offset) * h + h * h, later_edge = 3 * h * h + h * h;
  return {.particle = encoder + pairs_of_particle * (to_grid + to_particle) + decoder,
          .cell = iterations * (2 * h * h + h * h),
          .edge = first_edge + (iterations - 1) * later_edge,
          .between_fine = (h + offset) * h + h * h + (2 * h + offset) * h + h * h};
}

HgnCost split_cost(const HgnConfig& config) {
  const auto h = static_cast<double>(config.latent), iterations = static_cast<double>(config.message_passing);
  const double encoder = static_cast<double>(config.input_width() - config.embedding) * h + h * h,
               decoder = decoder_cost(config);
  const double first_of_pairs = 2 * h * h, second_of_pairs = 2 * pairs_of_particle * h * h;  // to the grid and back
  return {.particle = encoder + first_of_pairs + second_of_pairs + decoder,
          .cell0 = h * h,                                        // its part of grid_to_particle
          .cell = iterations * (2 * h * h + 2 * h * h + h * h),  // sender and receiver parts; its own FCN
          .edge = iterations * h * h + (iterations - 1) * h * h,
          .between_fine = h * h + h * h + h * h + h * h,
          .between_coarse = h * h};
}

/// Multiply-adds of a GNS, a row.
struct GnsCost {
  double particle = 0, moving = 0, edge = 0;
};

GnsCost cost_of(const GnsConfig& config, FirstLayers first_layers) {
  const auto h = static_cast<double>(config.latent), steps = static_cast<double>(config.message_passing);
  const double after_first = static_cast<double>(config.hidden_layers) * h * h;  // layers of an FCN behind its first
  const bool whole = first_layers == FirstLayers::whole;
  const auto features = static_cast<double>(config.input_width() - (whole ? 0 : config.embedding));
  const double latents_of_edge = 2 * h * h;  // of sender and receiver, once an edge or once a particle
  return {.particle = features * h + after_first + steps * (2 * h * h + after_first + (whole ? 0 : latents_of_edge)),
          .moving = after_first + static_cast<double>(config.output_width()) * h,  // the decoder's last layer is narrow
          .edge = edge_feature_count * h + after_first + steps * (h * h + after_first + (whole ? latents_of_edge : 0))};
}

}  // namespace

HgnRows rows_of(const sparsegrid::Hierarchy<3>& hierarchy) {
  HgnRows rows;
  rows.particles = static_cast<int64_t>(hierarchy.cell.size());
  for (const auto& level : hierarchy.levels) {
    HgnRows::Level& count = rows.level.emplace_back();
    count.cells = static_cast<int64_t>(level.size());
    for (const auto& neighbors : level.neighbor)
      for (const int32_t cell : neighbors) count.edges += cell >= 0;
  }
  return rows;
}

double flop_of(const HgnConfig& config, const HgnRows& rows, FirstLayers first_layers) {
  const bool whole = first_layers == FirstLayers::whole;
  const HgnCost cost = config.aggregation == Aggregation::activations
                           ? (whole ? whole_cost_of_sums(config) : split_cost_of_sums(config))
                           : (whole ? whole_cost(config) : split_cost(config));
  double sum = static_cast<double>(rows.particles) * cost.particle;
  for (std::size_t l = 0; l < rows.level.size(); ++l) {
    const auto cells = static_cast<double>(rows.level[l].cells), edges = static_cast<double>(rows.level[l].edges);
    const bool top = l + 1 == rows.level.size();
    const double blocks = top ? 1 : 2;  // down and up
    sum += blocks * (cells * cost.cell + edges * cost.edge);
    sum += cells * ((l == 0 ? cost.cell0 : cost.between_coarse) + (top ? 0 : cost.between_fine));
  }
  return flop_of_multiply_add * sum;
}

double flop_of(const GnsConfig& config, const GnsRows& rows, FirstLayers first_layers) {
  const GnsCost cost = cost_of(config, first_layers);
  return flop_of_multiply_add *
         (static_cast<double>(rows.particles) * cost.particle + static_cast<double>(rows.moving) * cost.moving +
          static_cast<double>(rows.edges) * cost.edge);
}

}  // namespace graupel::graph
