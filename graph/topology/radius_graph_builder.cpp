#include "graph/topology/radius_graph_builder.h"

#include <cmath>
#include <string>

#include "core/parallel/parallel_for_in.h"
#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "graph/features/features.h"

namespace graupel::graph {

using namespace radius;

namespace {

constexpr Grain light{.items = 256};
/// Cells are a little wider than the radius, so that the rounding of x / size never parts a pair by two cells.
constexpr double cell_margin = 1 + 1e-6;

CellBox box_of(const RadiusScene& scene, double size, int64_t first_cell) {
  CellBox box{};
  double volume = 1;
  for (int d = 0; d < 3; ++d) {
    const double low = std::floor(scene.low[d] / size), high = std::floor(scene.high[d] / size);
    volume *= high - low + 1;
    if (!(std::abs(low) < (1 << 20)) || !(static_cast<double>(first_cell) + volume <= (1 << 26)))
      throw ConfigError("the scenes do not fit the network's cells (" + std::to_string(volume) + " cells of " +
                        std::to_string(size) + " m in one of them, at most 2^26 in all). Use fewer scenes at once or " +
                        "smaller domains");
    box.low[d] = static_cast<int>(low);
    box.size[d] = static_cast<int>(high - low) + 1;
  }
  box.first_cell = static_cast<int32_t>(first_cell);
  return box;
}

/// Waits for the stream.
GraphCounts read(const Buffer<GraphCounts>& counts, void* stream) {
#ifdef __CUDACC__
  if (counts.device() == Device::cuda) {
    GraphCounts host{};
    const auto in = static_cast<cudaStream_t>(stream);
    GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(&host, counts.data(), sizeof(host), cudaMemcpyDeviceToHost, in));
    GRAUPEL_CUDA_CHECK(cudaStreamSynchronize(in));
    return host;
  }
#endif
  static_cast<void>(stream);
  return counts.download().front();
}

}  // namespace

struct RadiusGraphBuilder::Arrays {
  explicit Arrays(Device device) : scratch(device) {
    const auto place = [&](auto&... buffer) { ((buffer = std::decay_t<decltype(buffer)>(device, 0)), ...); };
    place(scene, counts, cell_of, unsorted, node, cell_count, filled, cell_begin, sorted, near, rank, point_of,
          pair_count, pair_sum, begin, sender, receiver, reverse, features);
    counts.resize_discard(1);
  }
  ListScratch scratch;
  Buffer<PointScene> scene;
  Buffer<GraphCounts> counts;
  Buffer<int32_t> cell_of, unsorted, node;         ///< [nodes]
  Buffer<int32_t> cell_count, filled, cell_begin;  ///< [cells + 1]
  Buffer<Vec3f> sorted;                            ///< positions in the order of `node`
  Buffer<int32_t> near, rank, point_of;            ///< [obstacle points]
  Buffer<int32_t> pair_count, pair_sum;            ///< [9 nodes + 1]
  Buffer<int32_t> begin, sender, receiver, reverse;
  Buffer<float> features;
};

RadiusGraphBuilder::RadiusGraphBuilder(Device device, double radius, double receptive_field)
    : device_(device),
      radius_(radius),
      receptive_field_(receptive_field),
      cell_size_(radius * cell_margin),
      arrays_(std::make_unique<Arrays>(device)) {}
RadiusGraphBuilder::~RadiusGraphBuilder() = default;
RadiusGraphBuilder::RadiusGraphBuilder(RadiusGraphBuilder&&) noexcept = default;

template <typename Body>
void RadiusGraphBuilder::launch(void* stream, int64_t n, const Body& body) const {
  parallel_for_in(stream, device_, n, body, light);
}

void RadiusGraphBuilder::prepare(const std::vector<RadiusScene>& scenes, void* stream) {
  GRAUPEL_ASSERT(!scenes.empty());
  std::vector<PointScene> views;
  int64_t cells = 0;
  particles_ = points_ = 0;
  for (const RadiusScene& scene : scenes) {
    const CellBox box = box_of(scene, cell_size_, cells);
    views.push_back({box, particles_, scene.particles, points_, scene.point, scene.symmetry, scene.environment});
    cells += int64_t{box.size[0]} * box.size[1] * box.size[2];
    particles_ += scene.particles;
    points_ += scene.points;
  }
  scenes_ = static_cast<int>(scenes.size());
  cells_ = static_cast<int32_t>(cells);
  Arrays& a = *arrays_;
  const auto resize_all = [](int64_t size, auto&... buffer) {
    (buffer.resize_discard(static_cast<std::size_t>(size)), ...);
  };
  resize_all(most_nodes(), a.cell_of, a.unsorted, a.node, a.sorted);
  resize_all(cells + 1, a.cell_count, a.filled, a.cell_begin);
  resize_all(points_ + 1, a.near, a.rank, a.point_of);
  resize_all(neighbour_rows * most_nodes() + 1, a.pair_count, a.pair_sum);
  resize_all(most_nodes() + 1, a.begin);
  upload_in(stream, a.scene, views);
}

Points RadiusGraphBuilder::points() const {
  return {arrays_->scene.data(),   scenes_, cell_size_, 1 / cell_size_, particles_, cells_, position_,
          arrays_->point_of.data()};
}
CellOrder RadiusGraphBuilder::order() const {
  return {arrays_->cell_begin.data(), arrays_->node.data(), arrays_->sorted.data()};
}
RowSearch RadiusGraphBuilder::search() const {
  const auto rounded = static_cast<double>(static_cast<float>(radius_));
  return {points(), order(), rounded * rounded};
}

/// Lists of cells; those of a cell in ascending order.
void RadiusGraphBuilder::list_cells(int64_t nodes, const GraphCounts* counts, void* stream) {
  Arrays& a = *arrays_;
  launch(stream, cells_ + 1, ClearCells{a.cell_count.data(), a.filled.data()});
  launch(stream, nodes, CountNodes{points(), counts, a.cell_of.data(), a.cell_count.data()});
  prefix_sums(device_, cells_, a.cell_count.data(), a.cell_begin.data(), a.scratch, stream);
  launch(stream, nodes, FillCells{a.cell_of.data(), a.cell_begin.data(), a.filled.data(), a.unsorted.data()});
  launch(
      stream, nodes,
      SortNodes{a.cell_of.data(), a.cell_begin.data(), a.unsorted.data(), position_, a.node.data(), a.sorted.data()});
}

void RadiusGraphBuilder::build(Vec3f* position, void* stream) {
  Arrays& a = *arrays_;
  position_ = position;
  launch(stream, 1, ResetCounts{particles_, a.counts.data()});
  if (points_ > 0) {
    list_cells(particles_, nullptr, stream);
    launch(stream, points_, MarkNear{points(), order(), receptive_field_, a.near.data()});
    prefix_sums(device_, points_, a.near.data(), a.rank.data(), a.scratch, stream);
    launch(
        stream, points_ + 1,
        PlaceObstacles{points(), points_, a.near.data(), a.rank.data(), position_, a.point_of.data(), a.counts.data()});
  }
  list_cells(most_nodes(), a.counts.data(), stream);
  const int64_t items = neighbour_rows * most_nodes();
  launch(stream, items, CountPairs{search(), a.counts.data(), a.pair_count.data()});
  prefix_sums(device_, items, a.pair_count.data(), a.pair_sum.data(), a.scratch, stream);
  launch(stream, items, FindOverflow{a.pair_sum.data(), a.counts.data()});
  link_pairs(stream);
}

/// The edges, where there is room for them.
void RadiusGraphBuilder::link_pairs(void* stream) {
  Arrays& a = *arrays_;
  launch(stream, most_nodes() + 1,
         BeginEdges{most_nodes(), capacity_, particles_, a.pair_sum.data(), a.counts.data(), a.begin.data()});
  int32_t* const unsorted = a.reverse.data();  // until the edges back are known
  launch(stream, neighbour_rows * most_nodes(),
         FillPairs{search(), a.counts.data(), a.pair_sum.data(), unsorted, a.receiver.data()});
  launch(stream, capacity_, SortSenders{a.counts.data(), a.begin.data(), a.receiver.data(), unsorted, a.sender.data()});
  launch(stream, capacity_,
         DescribeEdges{a.counts.data(), radius_, position_, a.begin.data(), a.sender.data(), a.receiver.data(),
                       a.reverse.data(), a.features.data()});
}

void RadiusGraphBuilder::describe_obstacles(const FeatureRules& rules, float* features, int32_t* type_row,
                                            void* stream) {
  launch(stream, points_,
         DescribeObstacles{points(), arrays_->counts.data(), rules, embedding_row(obstacle_particle_type), features,
                           type_row});
}

RadiusCounts RadiusGraphBuilder::finish(double spare, void* stream) {
  Arrays& a = *arrays_;
  GraphCounts counts = read(a.counts, stream);
  if (counts.overflow)
    throw InputError("the particles have too many neighbours (at most 2^31 - 1 pairs within the radius). They have " +
                     std::string("clumped: use an earlier frame, or a scene with fewer particles"));
  if (counts.fault) {
    capacity_ = counts.wanted_edges + static_cast<int64_t>(spare * counts.wanted_edges) + 1024;
    for (Buffer<int32_t>* buffer : {&a.sender, &a.receiver, &a.reverse})
      buffer->resize_discard(static_cast<std::size_t>(capacity_));
    a.features.resize_discard(static_cast<std::size_t>(capacity_ * edge_feature_count));
    link_pairs(stream);
    counts = read(a.counts, stream);
    GRAUPEL_ASSERT(!counts.fault);
  }
  return {counts.nodes, counts.edges};
}

RadiusLinks RadiusGraphBuilder::links() const {
  const Arrays& a = *arrays_;
  const GraphCounts* const c = a.counts.data();
  return {&c->nodes,         &c->obstacles,    &c->edges,         a.begin.data(), a.sender.data(),
          a.receiver.data(), a.reverse.data(), a.features.data(), &c->fault};
}

}  // namespace graupel::graph
