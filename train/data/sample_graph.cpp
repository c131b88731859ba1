#include "train/data/sample_graph.h"

#include "core/parallel/parallel_for.h"

namespace graupel::train {

namespace {

/// Room for edges beyond those of a batch: other batches have a few more.
constexpr double spare = 0.125;

/// Grids of HGN.
class GridSamples : public SampleGraph {
 public:
  GridSamples(const graph::HgnConfig& config, Device device)
      : builder_(device, config.spacing, static_cast<int>(config.levels)) {}

  void prepare(const std::vector<Scene>& scenes, void* stream) override {
    std::vector<graph::SceneGrid> grids;
    particles_ = 0;
    for (const Scene& scene : scenes) {
      grids.push_back({scene.draw.origin, scene.draw.low, scene.draw.high, scene.particles});
      particles_ += scene.particles;
    }
    builder_.prepare(grids, stream);
  }
  int64_t most_rows() const override { return particles_; }
  void build(const graph::FeatureRules&, const Rows& rows, void* stream) override {
    builder_.build(rows.position, stream);
  }
  void finish(SampleArrays& arrays, void* stream) override {
    arrays.counts = builder_.counts(stream);
    arrays.rows = particles_;
    arrays.links = builder_.links();
  }

 private:
  graph::GridBuilder builder_;
  int64_t particles_ = 0;
};

/// Pairs within the radius, of GNS.
class RadiusSamples : public SampleGraph {
 public:
  RadiusSamples(const graph::GnsConfig& config, Device device) : builder_(device, config) {}

  void prepare(const std::vector<Scene>& scenes, void* stream) override {
    std::vector<graph::RadiusScene> radius_scenes;
    radius_scenes.reserve(scenes.size());
    for (const Scene& scene : scenes)
      radius_scenes.push_back({scene.draw.low, scene.draw.high, scene.particles, scene.point, scene.points,
                               scene.draw.symmetry, scene.environment});
    builder_.prepare(radius_scenes, stream);
  }
  int64_t most_rows() const override { return builder_.most_nodes(); }
  void build(const graph::FeatureRules& rules, const Rows& rows, void* stream) override {
    builder_.build(rows.position, stream);
    builder_.describe_obstacles(rules, rows.features, rows.type_row, stream);
  }
  void finish(SampleArrays& arrays, void* stream) override {
    const graph::RadiusCounts counts = builder_.finish(spare, stream);
    arrays.rows = counts.nodes;
    arrays.pair_count = counts.edges;
    arrays.pairs = builder_.links();
  }

 private:
  graph::RadiusGraphBuilder builder_;
};

}  // namespace

std::vector<const std::vector<Vec3f>*> obstacle_points(const DataSplit& split, const NetworkConfig& config) {
  const auto* gns = std::get_if<graph::GnsConfig>(&config);
  if (gns == nullptr || !gns->obstacle_particles) return {};
  std::vector<const std::vector<Vec3f>*> points(static_cast<std::size_t>(split.count()));
  parallel_for(
      Device::cpu, split.count(),
      [&](int64_t i) {
        const graph::Environment& environment = split.trajectory(static_cast<int>(i)).context->environment;
        points[static_cast<std::size_t>(i)] = &environment.obstacle_particles.at_spacing(gns->obstacle_spacing);
      },
      Grain{1});
  return points;
}

std::unique_ptr<SampleGraph> make_sample_graph(const NetworkConfig& config, Device device) {
  if (const auto* hgn = std::get_if<graph::HgnConfig>(&config)) return std::make_unique<GridSamples>(*hgn, device);
  return std::make_unique<RadiusSamples>(std::get<graph::GnsConfig>(config), device);
}

}  // namespace graupel::train
