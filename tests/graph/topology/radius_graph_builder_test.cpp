// The graph made on a device is that of sparsegrid::build_radius_graph over the particles and the obstacle particles
// that within_cutoff() chooses.
#include "graph/topology/radius_graph_builder.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/math/random.h"
#include "core/system/error.h"
#include "graph/features/features.h"
#include "sparsegrid/radius_graph.h"
#include "tests/gpu_only.h"
#include "tests/graph/random_input.h"

namespace graupel::graph {
namespace {

GnsConfig small_config() {
  GnsConfig config;
  config.radius = 0.05;
  config.message_passing = 4;
  config.history = 3;
  config.signed_distance = true;
  return config;
}

/// One scene's particles as the network sees them, and its obstacle points as they are.
struct Cloud {
  Vec3d low, high;
  std::vector<Vec3f> position, point;
  AxisMap symmetry;
};

Cloud random_cloud(uint64_t seed, int particles, int points, double edge) {
  const Random random(seed, RandomPurpose::test);
  Cloud cloud{{0, 0, 0}, {1, 1, 1}, {}, {}, {}};
  const auto draw = [&](uint64_t i, double low, double high) {
    Vec3f x;
    for (int d = 0; d < 3; ++d) x[d] = static_cast<float>(random.uniform(i, d, low, high));
    return x;
  };
  for (int i = 0; i < particles; ++i) cloud.position.push_back(draw(static_cast<uint64_t>(i), 0.3, 0.3 + edge));
  for (int i = 0; i < points; ++i) cloud.point.push_back(draw(1000000 + static_cast<uint64_t>(i), 0, 1));
  return cloud;
}

std::vector<Cloud> clouds() {
  std::vector<Cloud> all = {random_cloud(1, 300, 400, 0.2), random_cloud(2, 40, 0, 0.1), random_cloud(3, 1, 50, 0.2)};
  all[0].symmetry = {{2, 1, 0}, {-1, 1, 1}};  // about the box's middle once shifted below
  all[0].low = {-1, 0, 0};
  all[0].high = {0, 1, 1};
  for (Vec3f& x : all[0].position) x = all[0].symmetry.apply(x);
  // On the radius exactly, at one place, and outside of the box.
  all[1].position.insert(
      all[1].position.end(),
      {{0.25f, 0.5f, 0.5f}, {0.25f, 0.5f, 0.5f}, {1.3f, 0.5f, 1.2f}, {1.34f, 0.5f, 1.2f}, {-0.2f, 0.5f, 1}});
  const auto radius = static_cast<float>(small_config().radius);
  all[1].position.insert(all[1].position.end(), {{0, 0, 0}, {radius, 0, 0}, {0, 0, radius}});
  return all;
}

template <typename T>
std::vector<T> host_copy(Device device, const T* data, int64_t count) {
  std::vector<T> values(static_cast<std::size_t>(count));
  device_copy(Device::cpu, values.data(), device, data, values.size() * sizeof(T));
  return values;
}

/// The arrays on the host.
struct HostGraph {
  RadiusCounts counts;
  std::vector<int32_t> begin, sender, receiver, reverse;
  std::vector<Vec3f> position;
  std::vector<float> features;
};

/// Makes the graphs of one set of scenes after the other with one builder.
class GraphOnDevice {
 public:
  explicit GraphOnDevice(Device device, const GnsConfig& config = small_config())
      : device_(device), builder_(device, config) {}

  HostGraph build(const std::vector<Cloud>& all) {
    points_.clear();
    std::vector<RadiusScene> scenes;
    std::vector<Vec3f> particles;
    for (const Cloud& cloud : all) {
      points_.emplace_back(device_, 0).upload(cloud.point);
      scenes.push_back({cloud.low,
                        cloud.high,
                        static_cast<int64_t>(cloud.position.size()),
                        points_.back().data(),
                        static_cast<int64_t>(cloud.point.size()),
                        cloud.symmetry,
                        {}});
      particles.insert(particles.end(), cloud.position.begin(), cloud.position.end());
    }
    builder_.prepare(scenes);
    particles.resize(static_cast<std::size_t>(builder_.most_nodes()));
    Buffer<Vec3f> position(device_, 0);
    position.upload(particles);
    builder_.build(position.data());
    HostGraph host;
    host.counts = builder_.finish(0);
    const RadiusLinks links = builder_.links();
    EXPECT_EQ(host_copy(device_, links.fault, 1).front(), 0);
    EXPECT_EQ(host_copy(device_, links.edge_count, 1).front(), host.counts.edges);
    host.begin = host_copy(device_, links.begin, host.counts.nodes + 1);
    host.sender = host_copy(device_, links.sender, host.counts.edges);
    host.receiver = host_copy(device_, links.receiver, host.counts.edges);
    host.reverse = host_copy(device_, links.reverse, host.counts.edges);
    host.features = host_copy(device_, links.features, edge_feature_count * host.counts.edges);
    host.position = host_copy(device_, position.data(), host.counts.nodes);
    return host;
  }
  RadiusGraphBuilder& builder() { return builder_; }

 private:
  Device device_;
  RadiusGraphBuilder builder_;
  std::vector<Buffer<Vec3f>> points_;
};

/// Nodes as the batch numbers them: particles of all scenes, then near obstacle points of all scenes.
struct Expected {
  std::vector<Vec3f> position;
  std::vector<std::vector<int32_t>> senders;
};

Expected expected_graph(const std::vector<Cloud>& all, const GnsConfig& config) {
  Expected expected;
  std::vector<std::vector<Vec3f>> near(all.size());
  for (std::size_t s = 0; s < all.size(); ++s) {
    std::vector<Vec3f> turned;
    for (const Vec3f& x : all[s].point) turned.push_back(all[s].symmetry.apply(x));
    for (const int32_t p : within_cutoff(turned, all[s].position, config.receptive_field()))
      near[s].push_back(turned[static_cast<std::size_t>(p)]);
    expected.position.insert(expected.position.end(), all[s].position.begin(), all[s].position.end());
  }
  const std::size_t particles = expected.position.size();
  for (const auto& points : near) expected.position.insert(expected.position.end(), points.begin(), points.end());
  expected.senders.resize(expected.position.size());
  std::size_t first = 0, first_point = particles;
  for (std::size_t s = 0; s < all.size(); ++s) {
    std::vector<Vec3f> own = all[s].position;
    own.insert(own.end(), near[s].begin(), near[s].end());
    const auto row = [&](std::size_t i) {
      return i < all[s].position.size() ? first + i : first_point + i - all[s].position.size();
    };
    const auto graph = sparsegrid::build_radius_graph(own, config.radius, sparsegrid::SelfEdges::with);
    for (std::size_t r = 0; r < own.size(); ++r)
      for (int32_t e = graph.begin[r]; e < graph.begin[r + 1]; ++e)
        expected.senders[row(r)].push_back(
            static_cast<int32_t>(row(static_cast<std::size_t>(graph.sender[static_cast<std::size_t>(e)]))));
    first += all[s].position.size();
    first_point += near[s].size();
  }
  return expected;
}

void expect_graph_of(const HostGraph& graph, const std::vector<Cloud>& all, const GnsConfig& config = small_config()) {
  const Expected expected = expected_graph(all, config);
  ASSERT_EQ(graph.position, expected.position);
  ASSERT_EQ(graph.counts.nodes, static_cast<int64_t>(expected.position.size()));
  for (std::size_t r = 0; r < expected.senders.size(); ++r) {
    const auto begin = graph.sender.begin() + graph.begin[r], end = graph.sender.begin() + graph.begin[r + 1];
    ASSERT_EQ(std::vector<int32_t>(begin, end), expected.senders[r]) << "receiver " << r;
  }
  ASSERT_EQ(graph.begin.back(), graph.counts.edges);
  for (std::size_t e = 0; e < graph.sender.size(); ++e) {
    const auto s = static_cast<std::size_t>(graph.sender[e]), r = static_cast<std::size_t>(graph.receiver[e]),
               back = static_cast<std::size_t>(graph.reverse[e]);
    ASSERT_TRUE(graph.begin[r] <= static_cast<int32_t>(e) && static_cast<int32_t>(e) < graph.begin[r + 1]);
    ASSERT_EQ(graph.sender[back], static_cast<int32_t>(r));
    ASSERT_EQ(graph.receiver[back], static_cast<int32_t>(s));
    const auto features = edge_features(graph.position[s], graph.position[r], config.radius);
    for (std::size_t k = 0; k < features.size(); ++k) ASSERT_FLOAT_EQ(graph.features[4 * e + k], features[k]);
  }
}

void expect_the_graph_of_the_cpu(Device device) {
  GraphOnDevice on_device(device);
  expect_graph_of(on_device.build(clouds()), clouds());
  const std::vector<Cloud> dense = {random_cloud(5, 900, 100, 0.12)};  // more edges than there was room for
  expect_graph_of(on_device.build(dense), dense);
  const std::vector<Cloud> few = {random_cloud(6, 20, 10, 0.1)};
  expect_graph_of(on_device.build(few), few);
}

TEST(RadiusGraphBuilder, GraphIsThatOfTheHost) { expect_the_graph_of_the_cpu(Device::cpu); }

TEST(RadiusGraphBuilder, GraphIsThatOfTheHostOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_the_graph_of_the_cpu(Device::cuda);
  // Large, and the same every time.
  GnsConfig config;
  const std::vector<Cloud> large = {random_cloud(8, 20000, 5000, 0.3), random_cloud(9, 7000, 6000, 0.2)};
  const HostGraph graph = GraphOnDevice(Device::cuda, config).build(large);
  expect_graph_of(graph, large, config);
}

TEST(RadiusGraphBuilder, WithoutRoomThereAreNoEdgesAndAFault) {
  Buffer<Vec3f> position(Device::cpu, 0);
  RadiusGraphBuilder builder(Device::cpu, small_config());
  const Cloud few = random_cloud(1, 20, 0, 0.1), many = random_cloud(1, 500, 0, 0.1);
  const auto build = [&](const Cloud& cloud) {
    builder.prepare({{cloud.low, cloud.high, static_cast<int64_t>(cloud.position.size())}});
    position.upload(cloud.position);
    builder.build(position.data());
  };
  build(few);
  builder.finish(0.5);
  EXPECT_EQ(*builder.links().fault, 0);
  EXPECT_EQ(*builder.links().node_count, 20);
  build(many);
  EXPECT_EQ(*builder.links().fault, 1);
  EXPECT_EQ(*builder.links().node_count, 0);
  EXPECT_EQ(*builder.links().edge_count, 0);
  EXPECT_EQ(builder.finish(0).nodes, 500);
  EXPECT_EQ(*builder.links().fault, 0);
}

/// Obstacle particles have the features of resting particles at their places.
void expect_resting_features(Device device) {
  const GnsConfig config = small_config();
  const Scene scene = scene_with_ball({0.5, 0.2, 0.5}, 0.15);
  const Environment environment(scene, config.dx);
  Cloud cloud = random_cloud(4, 30, 0, 0.1);
  for (const Vec3f& x : environment.obstacle_particles.at_spacing(0.03)) cloud.point.push_back(x);
  Normalization normalization;
  normalization.velocity_mean[1] = 0.5f;
  const FeatureRules rules(config, normalization);
  Buffer<Vec3f> point(device, 0), position(device, 0);
  point.upload(cloud.point);
  RadiusGraphBuilder builder(device, config);
  builder.prepare({{cloud.low,
                    cloud.high,
                    30,
                    point.data(),
                    static_cast<int64_t>(cloud.point.size()),
                    {},
                    environment.view(device)}});
  std::vector<Vec3f> nodes = cloud.position;
  nodes.resize(static_cast<std::size_t>(builder.most_nodes()));
  position.upload(nodes);
  builder.build(position.data());
  Buffer<float> features(device, nodes.size() * static_cast<std::size_t>(rules.width));
  Buffer<int32_t> type(device, nodes.size());
  builder.describe_obstacles(rules, features.data(), type.data());
  const int64_t obstacles = builder.finish(0).nodes - 30;
  ASSERT_GT(obstacles, 10);
  const std::vector<int32_t> near = within_cutoff(cloud.point, cloud.position, config.receptive_field());
  std::vector<std::vector<Vec3f>> resting(static_cast<std::size_t>(config.history) + 1);
  for (auto& frame : resting)
    for (const int32_t p : near) frame.push_back(cloud.point[static_cast<std::size_t>(p)]);
  const std::vector<float> expected = particle_features(config, normalization, environment, resting),
                           actual = features.download();
  ASSERT_EQ(static_cast<int64_t>(near.size()), obstacles);
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_NEAR(actual[30 * static_cast<std::size_t>(rules.width) + i], expected[i], 1e-6f) << i;
  for (int64_t i = 0; i < obstacles; ++i) EXPECT_EQ(type.download()[static_cast<std::size_t>(30 + i)], 3);
}

TEST(RadiusGraphBuilder, ObstacleParticlesRest) { expect_resting_features(Device::cpu); }

TEST(RadiusGraphBuilder, ObstacleParticlesRestOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_resting_features(Device::cuda);
}

TEST(RadiusGraphBuilder, RefusesAWorldOfTooManyCells) {
  GnsConfig config = small_config();
  config.radius = 1e-4;
  RadiusGraphBuilder builder(Device::cpu, config);
  EXPECT_THROW(builder.prepare({{{0, 0, 0}, {1, 1, 1}, 5}}), ConfigError);
}

}  // namespace
}  // namespace graupel::graph
