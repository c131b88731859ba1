#include "graph/cuda/forward/gns_forward.h"

#include "core/system/error.h"
#include "graph/topology/gns_graph.h"

namespace graupel::graph {

namespace {

constexpr int64_t h = layer_width;
constexpr int64_t second = -1;  ///< stands for W2 among the columns of W1
constexpr RowOf always_first{nullptr, 0, 0};

/// W_s f_s, and W_r f_r with the bias, of the first layer of an edge network, [nodes].
struct Projections {
  float *sender = nullptr, *receiver = nullptr;
};

class ForwardPass {
 public:
  ForwardPass(const PackedGns& network, const GnsRows& rows, RowMemory& memory, EdgeMemory& edges, GnsRecord& record,
              void* stream)
      : network_(network), rows_(rows), memory_(memory), edges_(edges), record_(record), stream_(stream) {}

  float* run() {
    const int64_t steps = network_.config().message_passing;
    record_ = {};
    record_.step.resize(static_cast<std::size_t>(steps));
    encode_nodes();
    encode_edges();
    for (int64_t k = 0; k < steps; ++k) step(k, k + 1 < steps);
    return nodes_.f32;
  }

 private:
  /// Arrays of nodes that a step writes; where not all are kept, those of the step before the last.
  struct NodeArrays {
    RowLatents latents;
    Projections projections;
    uint16_t* received;
  };
  NodeArrays& arrays_of(int64_t k) {
    const auto place = static_cast<std::size_t>(memory_.keeps_all() ? k : k % 2);
    if (place == arrays_.size()) {
      const int64_t n = rows_.nodes;
      arrays_.push_back(
          {{memory_.rows32(n), memory_.rows16(n)}, {memory_.rows32(n), memory_.rows32(n)}, memory_.rows16(n)});
    }
    return arrays_[place];
  }
  /// Where nothing is kept, node networks make their rows' projections for the step that comes next.
  bool projects_ahead() const { return !memory_.keeps_all() && can_project_ahead(); }
  EpilogueProjection epilogue(int64_t k) {
    const std::string name = step_name(k, "edge");
    const Projections& to = arrays_of(k).projections;
    return {
        {network_.tile(name, 0), network_.tile(name, h)}, {nullptr, network_.fcn(name).b1}, {to.sender, to.receiver}};
  }

  void encode_nodes();
  void encode_edges();
  void project_nodes(int64_t k);
  void step(int64_t k, bool is_followed);

  const PackedGns& network_;
  const GnsRows& rows_;
  RowMemory& memory_;
  EdgeMemory& edges_;
  GnsRecord& record_;
  void* stream_;
  RowLatents nodes_;  ///< the newest
  std::vector<NodeArrays> arrays_;
};

void ForwardPass::encode_nodes() {
  const DeviceFcn& fcn = network_.fcn("encoder.node");
  float* const first = memory_.rows32(rows_.nodes);
  encode_features({.rows = rows_.nodes,
                   .features = rows_.features,
                   .width = static_cast<int>(network_.config().input_width() - network_.config().embedding),
                   .w1 = fcn.w1,
                   .stride = fcn.inputs,
                   .type_row = rows_.type_row,
                   .type_table = network_.type_table(),
                   .out = first},
                  stream_);
  nodes_ = {memory_.rows32(rows_.nodes), memory_.rows16(rows_.nodes)};
  FusedMlp& encoder = record_.node_encoder = network_.network("encoder.node", rows_.nodes, rows_.node_count);
  encoder.table[0] = {first, {}};
  encoder.sum32 = nodes_.f32;
  encoder.copy16 = nodes_.f16;
  forward(encoder, stream_);
}

void ForwardPass::encode_edges() {
  const DeviceFcn& fcn = network_.fcn("encoder.edge");
  FusedMlp& encoder = record_.edge_encoder = network_.network("encoder.edge", rows_.edges, rows_.edge_count);
  encoder.features = {rows_.edge_features, fcn.w1};
  encoder.table[0] = {fcn.b1, always_first};
  encoder.out16 = edges_.latent(0);
  forward(encoder, stream_);
}

void ForwardPass::project_nodes(int64_t k) {
  const EpilogueProjection wanted = epilogue(k);
  project({.rows = rows_.nodes,
           .row_count = rows_.node_count,
           .x = nodes_.f16,
           .weight = {wanted.weight[0], wanted.weight[1]},
           .bias = {wanted.bias[0], wanted.bias[1]},
           .out = {wanted.out[0], wanted.out[1]}},
          stream_);
}

void ForwardPass::step(int64_t k, bool is_followed) {
  const std::string edge_name = step_name(k, "edge"), node_name = step_name(k, "node");
  GnsRecord::Step& record = record_.step[static_cast<std::size_t>(k)];
  const NodeArrays own = arrays_of(k);
  if (k == 0 || !projects_ahead()) project_nodes(k);
  FusedMlp& edge = record.edge = network_.network(edge_name, rows_.edges, rows_.edge_count);
  edge.operand[0] = {.rows = edges_.latent(k), .weight = network_.tile(edge_name, 2 * h)};
  edge.table[0] = {own.projections.sender, {rows_.sender}};
  edge.table[1] = {own.projections.receiver, {rows_.receiver}};
  edge.out16 = edges_.message();
  if (is_followed) {
    edge.add16 = edges_.latent(k);
    edge.sum16 = edges_.latent(k + 1);
  }
  forward(edge, stream_);
  sum_segments({.segments = rows_.nodes,
                .row_count = rows_.node_count,
                .begin = rows_.begin,
                .are_long = true,
                .source = edge.out16,
                .out16 = own.received},
               stream_);
  FusedMlp& node = record.node = network_.network(node_name, rows_.nodes, rows_.node_count);
  node.operand[0] = {.rows = own.received, .weight = network_.tile(node_name, 0)};
  node.operand[1] = {.rows = nodes_.f16, .weight = network_.tile(node_name, h)};
  node.table[0] = {network_.fcn(node_name).b1, always_first};
  node.add32 = nodes_.f32;
  node.sum32 = own.latents.f32;
  node.copy16 = own.latents.f16;
  if (is_followed && projects_ahead()) node.epilogue = epilogue(k + 1);
  forward(node, stream_);
  nodes_ = own.latents;
}

}  // namespace

std::string step_name(int64_t k, const char* part) {
  return std::string("step.").append(std::to_string(k)).append(".").append(part);
}

bool PackedGns::fits(const GnsConfig& config) {
  return config.latent == h && config.hidden_layers == 1 && config.input_width() <= h;
}

PackedGns::PackedGns(const GnsConfig& config, std::map<std::string, DeviceFcn> fcns, const float* embedding)
    : config_(config), fcns_(std::move(fcns)) {
  GRAUPEL_ASSERT(fits(config));
  std::vector<TileSource> sources;
  const auto add = [&](const std::string& name, int64_t column, const float* matrix, int32_t stride) {
    tile_of_[{name, column}] = static_cast<int64_t>(sources.size());
    sources.push_back({matrix, stride, h});
  };
  for (const auto& [name, fcn] : fcns_) {
    if (fcn.gamma) add(name, second, fcn.w2, h);
    for (int64_t column = 0; column + h <= fcn.inputs; column += h) add(name, column, fcn.w1 + column, fcn.inputs);
  }
  tile_sources_.upload(sources);
  tiles_.resize_discard(sources.size() * tile_numbers);
  const DeviceFcn& encoder = fcn("encoder.node");
  table_source_.upload({{Offsets::embedding, 1, encoder.w1 + (config.input_width() - config.embedding), encoder.inputs,
                         encoder.b1, embedding, static_cast<int32_t>(config.embedding)}});
  table_.resize_discard(most_table_rows * h);
}

void PackedGns::refresh(void* stream) {
  pack_tiles(static_cast<int>(tile_sources_.size()), tile_sources_.data(), tiles_.data(), stream);
  make_tables(1, table_source_.data(), table_.data(), stream);
}

const uint16_t* PackedGns::tile(const std::string& fcn, int64_t first_column) const {
  return tiles_.data() + tile_of_.at({fcn, first_column}) * tile_numbers;
}

FusedMlp PackedGns::network(const std::string& name, int64_t rows, const int32_t* row_count) const {
  const DeviceFcn& net = fcn(name);
  FusedMlp network;
  network.rows = rows;
  network.row_count = row_count;
  network.slope = static_cast<float>(config_.leaky_slope);
  network.w2 = tile(name, second);
  network.b2 = net.b2;
  network.gamma = net.gamma;
  network.beta = net.beta;
  return network;
}

float* forward_to_decoder(const PackedGns& network, const GnsRows& rows, RowMemory& memory, EdgeMemory& edges,
                          GnsRecord& record, void* stream) {
  return ForwardPass(network, rows, memory, edges, record, stream).run();
}

}  // namespace graupel::graph
