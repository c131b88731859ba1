#include "mpm/sampling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/scene/source_body.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::HasSubstr;

Scene one_source(Source source) {
  Scene scene;
  scene.materials["water"] = preset("water");
  source.material = "water";
  source.position = {0.5, 0.5, 0.5};
  scene.sources.push_back(source);
  return scene;
}

TEST(Sampling, CountsOfTheCubeAndSphereOfTheHgnScenes) {
  EXPECT_EQ(sample_sources(scene_with("water"), 1).position.size(), 1074u);
  Source sphere;
  sphere.shape = Shape::sphere;
  sphere.radius = 0.04;
  EXPECT_EQ(sample_sources(one_source(sphere), 1).position.size(), 563u);
}

TEST(Sampling, ParticlesFillTheTurnedBodyEvenly) {
  Source box;
  box.shape = Shape::box;
  box.size = {0.3, 0.1, 0.2};
  box.rotation_axis = {1, 1, 0};
  box.rotation_angle = 40;
  const Scene scene = one_source(box);
  const SampledParticles p = sample_sources(scene, 3);
  Vec3d mean = {0, 0, 0}, spread = {0, 0, 0};
  for (const Vec3d& x : p.position) {
    const Vec3d local = scene.sources[0].to_local(x);
    for (int d = 0; d < 3; ++d) {
      ASSERT_LE(std::abs(local[d]), box.size[d] / 2 + 1e-12);
      spread[d] += local[d] * local[d];
    }
    mean += local;
  }
  const double n = static_cast<double>(p.position.size());
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(mean[d] / n, 0, 4 * box.size[d] / std::sqrt(12 * n));  // four standard errors
    EXPECT_NEAR(spread[d] / n, box.size[d] * box.size[d] / 12, 0.05 * box.size[d] * box.size[d] / 12);
  }
}

TEST(Sampling, VolumesOfAllShapesAgreeWithTheirInsideTest) {
  for (const Shape shape :
       {Shape::box, Shape::half_box, Shape::sphere, Shape::half_sphere, Shape::cone, Shape::pyramid, Shape::cylinder}) {
    Source source;
    source.shape = shape;
    source.size = {0.2, 0.3, 0.25};
    source.radius = 0.12;
    source.height = 0.2;
    const SourceBody body(source, 0, 0.01);
    const sparsegrid::LocalBox box = body.bounds();
    const Random random(1, RandomPurpose::test);
    int inside = 0;
    constexpr int n = 40000;
    for (int i = 0; i < n; ++i) {
      Vec3d x;
      for (int d = 0; d < 3; ++d) x[d] = random.uniform(i, d, box.low[d], box.high[d]);
      inside += body.contains(x);
    }
    const Vec3d e = box.high - box.low;
    EXPECT_NEAR(e[0] * e[1] * e[2] * inside / n, body.volume(), 0.03 * body.volume()) << word_of(shape);
  }
}

/// Cubes about these centres; `size` below 0 turns one inside out.
Source cubes_source(const std::vector<std::pair<Vec3d, double>>& cubes) {
  auto mesh = std::make_shared<TriangleMesh>();
  for (const auto& [center, size] : cubes) {
    const auto first = static_cast<int32_t>(mesh->vertices.size());
    for (int c = 0; c < 8; ++c)  // a negative size mirrors the cube
      mesh->vertices.push_back(center + Vec3d{(c & 1 ? 0.5 : -0.5), (c & 2 ? 0.5 : -0.5), (c & 4 ? 0.5 : -0.5)} * size);
    for (const std::array<int32_t, 3>& t : std::vector<std::array<int32_t, 3>>{{0, 2, 3},
                                                                               {0, 3, 1},
                                                                               {4, 5, 7},
                                                                               {4, 7, 6},
                                                                               {0, 1, 5},
                                                                               {0, 5, 4},
                                                                               {2, 6, 7},
                                                                               {2, 7, 3},
                                                                               {0, 4, 6},
                                                                               {0, 6, 2},
                                                                               {1, 3, 7},
                                                                               {1, 7, 5}})
      mesh->triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  Source source;
  source.shape = Shape::mesh;
  source.mesh = mesh;
  source.file = "cubes.obj";
  return source;
}

TEST(Sampling, MeshesOfSeveralPartsHaveTheMassOfTheirRegion) {
  const std::pair<Vec3d, double> left = {{-0.2, 0, 0}, 0.2};
  struct Case {
    std::vector<std::pair<Vec3d, double>> cubes;
    double volume;
  };
  for (const Case& one : {Case{{left, {{0.2, 0, 0}, -0.2}}, 0.016}, Case{{left, {{0.2, 0, 0}, -0.1}}, 0.009},
                          Case{{left, {{-0.1, 0, 0}, 0.2}}, 0.012}, Case{{left, {{-0.2, 0, 0}, 0.1}}, 0.008},
                          Case{{left, {{-0.2, 0, 0}, -0.16}}, 0.008 - 0.004096}})
    for (const Sampling sampling : {Sampling::random, Sampling::jittered_lattice}) {
      Source source = cubes_source(one.cubes);
      source.sampling = sampling;
      const SampledParticles p = sample_sources(one_source(source), 1);
      double volume = 0;
      for (const double v : p.volume) volume += v;
      EXPECT_NEAR(volume, one.volume, 0.03 * one.volume) << word_of(source.sampling);
      EXPECT_NEAR(p.position.size(), one.volume * 8 * 64 * 64 * 64, 0.03 * p.position.size());
      for (const Vec3d& x : p.position) {
        const Vec3d local = x - Vec3d{0.5, 0.5, 0.5} - one.cubes[1].first;
        const double depth = std::max({std::abs(local[0]), std::abs(local[1]), std::abs(local[2])});
        ASSERT_TRUE(one.cubes[1].second != -0.16 || depth > 0.079) << depth;
      }
    }
}

TEST(Sampling, AMeshGivesTheCountOfItsVolume) {
  auto mesh = std::make_shared<TriangleMesh>();
  for (int c = 0; c < 8; ++c)
    mesh->vertices.push_back({(c & 1 ? 0.1 : -0.1), (c & 2 ? 0.1 : -0.1), (c & 4 ? 0.1 : -0.1)});
  mesh->triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                     {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  Source source;
  source.shape = Shape::mesh;
  source.mesh = mesh;
  source.file = "cube.obj";
  const SampledParticles p = sample_sources(one_source(source), 1);
  EXPECT_EQ(p.position.size(), static_cast<std::size_t>(std::ceil(8 * 0.008 * 64 * 64 * 64)));
  for (const Vec3d& x : p.position)
    for (int d = 0; d < 3; ++d) ASSERT_LE(std::abs(x[d] - 0.5), 0.1 + 1e-3);
}

TEST(Sampling, APointOfTheLatticeLiesInEveryCellOfTheBox) {
  Source box;
  box.shape = Shape::box;
  box.size = {0.25, 0.125, 0.0625};  // 16 x 8 x 4 cells of 1/64, 8 points each
  box.sampling = Sampling::jittered_lattice;
  const SampledParticles p = sample_sources(one_source(box), 1);
  EXPECT_EQ(p.position.size(), 16u * 8 * 4 * 8);
  std::vector<int> count(p.position.size(), 0);
  for (const Vec3d& x : p.position) {
    const Vec3d local = x - Vec3d{0.375, 0.4375, 0.46875};
    const auto cell = [&](int d) { return static_cast<int>(local[d] * 128); };
    ++count[(cell(0) * 16 + cell(1)) * 8 + cell(2)];
  }
  for (const int c : count) ASSERT_EQ(c, 1);
}

TEST(Sampling, DependsOnSeedAndSourceAloneAndPlacesPoints) {
  Scene scene = scene_with("water");
  const SampledParticles alone = sample_sources(scene, 7);
  add_box(scene, "sand", {0.3, 0.3, 0.3});
  const SampledParticles both = sample_sources(scene, 7), other = sample_sources(scene, 8);
  for (std::size_t i = 0; i < alone.position.size(); ++i) ASSERT_EQ(alone.position[i], both.position[i]);
  EXPECT_FALSE(alone.position[0] == other.position[0]);
  EXPECT_EQ(both.source.back(), 1);
  EXPECT_EQ(both.material_names[both.material.back()], "sand");

  Source points;
  points.shape = Shape::points;
  points.points = std::make_shared<std::vector<Vec3d>>(std::vector<Vec3d>{{0, 0, 0}, {0.1, 0, 0}});
  points.rotation_axis = {0, 0, 1};
  points.rotation_angle = 90;
  const SampledParticles placed = sample_sources(one_source(points), 1);
  ASSERT_EQ(placed.position.size(), 2u);
  EXPECT_NEAR(placed.position[1][1], 0.6, 1e-12);
  EXPECT_NEAR(placed.volume[0], 1.0 / 64 / 64 / 64 / 8, 1e-18);
}

template <typename Call>
std::string config_error(Call&& call) {
  try {
    call();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Sampling, ImpossibleSourcesAreErrorsThatNameThem) {
  Source plane;
  plane.shape = Shape::plane;
  EXPECT_THAT(config_error([&] { sample_sources(one_source(plane), 1); }), HasSubstr("source 0 is a plane"));
  Scene unknown = scene_with("water");
  unknown.sources[0].material = "honey";
  EXPECT_THAT(config_error([&] { sample_sources(unknown, 1); }), HasSubstr("unknown material 'honey'"));

  Scene outside = scene_with("water", {0.5, 0.02, 0.5});
  EXPECT_THAT(
      config_error([&] { Simulation::create(outside, {}); }),
      testing::AllOf(HasSubstr("source 0 (/sources/0, "), HasSubstr("outside the walls"), HasSubstr("allowed")));
  Scene inside = scene_with("water");
  Obstacle sphere;
  sphere.shape = Shape::sphere;
  sphere.radius = 0.1;
  sphere.position = {0.55, 0.5, 0.5};
  inside.obstacles.push_back(sphere);
  EXPECT_THAT(config_error([&] { Simulation::create(inside, {}); }),
              testing::AllOf(HasSubstr("source 0"), HasSubstr("obstacle 0 (/obstacles/0, sphere)"), HasSubstr("Move")));
  Scene none = scene_with("water");
  none.sources.clear();
  EXPECT_THAT(config_error([&] { Simulation::create(none, {}); }), HasSubstr("no particles"));
}

}  // namespace
}  // namespace graupel::mpm
