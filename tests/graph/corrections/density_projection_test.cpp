// The density projection keeps volume, moves nothing that is not too dense, and respects symmetry, walls and obstacles.
#include "graph/corrections/density_projection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/math/random.h"
#include "core/parallel/buffer.h"
#include "core/system/error.h"
#include "graph/corrections/density_cells.h"
#include "graph/corrections/density_kernels.h"
#include "graph/features/rest_density.h"
#include "tests/gpu_only.h"
#include "tests/graph/random_input.h"

namespace graupel::graph {
namespace {

constexpr double spacing = 0.04, lattice = 0.01;  // 64 particles a cell at rest
constexpr double rest = 1 / (lattice * lattice * lattice);

/// Walls at 0.02 and 0.98: 24 cells along each axis.
Scene box_scene() {
  Scene scene;
  scene.domain.dx = 0.01;
  scene.domain.wall_cells = 2;
  return scene;
}

/// Particles with `step` between them, from low + step / 2 on.
std::vector<Vec3f> block(const Vec3d& low, const Vec3i& count, double step) {
  std::vector<Vec3f> position;
  for (int z = 0; z < count[2]; ++z)
    for (int y = 0; y < count[1]; ++y)
      for (int x = 0; x < count[0]; ++x)
        position.push_back((low + (Vec3d{x + 0.5, y + 0.5, z + 0.5}) * step).cast<float>());
  return position;
}

std::vector<Vec3f> random_cloud(int n, const Vec3d& low, const Vec3d& high) {
  const Random random(11, RandomPurpose::test);
  std::vector<Vec3f> position(static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < position.size(); ++i)
    for (int d = 0; d < 3; ++d) position[i][d] = static_cast<float>(random.uniform(i, d, low[d], high[d]));
  return position;
}

/// Of the fullest cell of a grid whose corner is at 0.02, of the density at rest.
double largest_density(const std::vector<Vec3f>& position, double edge = spacing) {
  std::map<std::array<int, 3>, double> mass;
  for (const Vec3f& x : position) {
    std::array<int, 3> cell{};
    double at[3];
    for (int d = 0; d < 3; ++d) {
      const double u = (double(x[d]) - 0.02) / edge - 0.5;
      cell[static_cast<std::size_t>(d)] = static_cast<int>(std::floor(u));
      at[d] = u - std::floor(u);
    }
    for (int k = 0; k < 8; ++k) {
      double w = 1;
      for (int d = 0; d < 3; ++d) w *= k >> d & 1 ? at[d] : 1 - at[d];
      mass[{cell[0] + (k & 1), cell[1] + (k >> 1 & 1), cell[2] + (k >> 2)}] += w;
    }
  }
  double most = 0;
  for (const auto& [cell, m] : mass) most = std::max(most, m);
  return most / (rest * edge * edge * edge);
}

Vec3d centre_of(const std::vector<Vec3f>& position) {
  Vec3d sum = Vec3d::zero();
  for (const Vec3f& x : position) sum += x.cast<double>();
  return sum * (1.0 / static_cast<double>(position.size()));
}

double largest_way(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, double(norm(a[i] - b[i])));
  return most;
}

void apply_times(DensityProjection& projection, const Environment& environment, std::vector<Vec3f>& position,
                 int times) {
  for (int k = 0; k < times; ++k) {
    const std::vector<Vec3f> before = position;
    projection.apply(position.data(), static_cast<int64_t>(position.size()));
    project_out(environment, before, position);
  }
}

TEST(DensityProjection, MatterAtRestOrThinnerStaysWhereItIs) {
  const Environment environment(box_scene());
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  const std::vector<std::vector<Vec3f>> still = {block({0.3, 0.3, 0.3}, {20, 20, 20}, lattice),
                                                 block(Vec3d::filled(0.02), {96, 16, 96}, lattice),  // between walls
                                                 block({0.02, 0.9, 0.5}, {30, 8, 30}, lattice),  // below the ceiling
                                                 random_cloud(2000, Vec3d::filled(0.1), Vec3d::filled(0.9)),
                                                 {{0.5f, 0.5f, 0.5f}},
                                                 {}};
  for (const std::vector<Vec3f>& start : still) {
    std::vector<Vec3f> position = start;
    for (int k = 0; k < 3; ++k) projection.apply(position.data(), static_cast<int64_t>(position.size()));
    EXPECT_EQ(position, start) << start.size();
  }
}

TEST(DensityProjection, ACompressedBlockExpandsToTheDensityAtRest) {
  const Environment environment(box_scene());
  for (const double limit : {1.0, 1.5}) {
    DensityProjection projection(Device::cpu, environment, limit * rest, spacing);
    std::vector<Vec3f> position = block(Vec3d::filled(0.4), {24, 24, 24}, lattice / std::cbrt(2.0));
    ASSERT_GT(largest_density(position), 1.9);
    apply_times(projection, environment, position, 8);
    EXPECT_LT(largest_density(position), 1.06 * limit);
    EXPECT_GT(largest_density(position), 0.9 * limit);
  }
}

TEST(DensityProjection, ADeepTankThatIsPressedTogetherKeepsItsDepth) {
  Scene scene = box_scene();
  scene.domain.size = {0.36, 1, 0.36};
  const Environment environment(scene);
  constexpr double coarse = 2 * lattice;  // 8 particles a cell
  DensityProjection projection(Device::cpu, environment, 1 / (coarse * coarse * coarse), spacing);
  std::vector<Vec3f> position = block(Vec3d::filled(0.02), {16, 40, 16}, coarse);
  double worst = 0;
  for (int frame = 0; frame < 60; ++frame) {  // to 0.55 of its depth, but for the projection
    for (Vec3f& x : position) x[1] = 0.02f + 0.99f * (x[1] - 0.02f);
    apply_times(projection, environment, position, 1);
    worst = std::max(worst, 8 * largest_density(position));
  }
  EXPECT_LT(worst, 1.12);
  EXPECT_GT(centre_of(position)[1], 0.95 * 0.42);
}

TEST(DensityProjection, ABlockThatExpandsInTheAirKeepsItsCentre) {
  const Environment environment(box_scene());
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  // Two cells along each axis, evenly dense, its middle on a cell's corner.
  std::vector<Vec3f> position = block(Vec3d::filled(0.42), {18, 18, 18}, 0.16 / 18);
  const std::vector<Vec3f> start = position;
  apply_times(projection, environment, position, 1);
  EXPECT_GT(largest_way(position, start), 0.001);
  EXPECT_LT(norm(centre_of(position) - centre_of(start)), 2e-5);
}

TEST(DensityProjection, WhatIsSymmetricStaysSymmetric) {
  const Environment environment(box_scene());
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  std::vector<Vec3f> half = random_cloud(3000, {0.36, 0.36, 0.36}, {0.5, 0.5, 0.5}), position = half;
  for (const Vec3f& x : half) position.push_back({x[2], x[1], x[0]});
  projection.apply(position.data(), static_cast<int64_t>(position.size()));
  EXPECT_GT(largest_way(half, {position.begin(), position.begin() + 3000}), 0.005);
  for (std::size_t i = 0; i < half.size(); ++i) {
    const Vec3f& x = position[i];
    ASSERT_LT(norm(position[i + half.size()] - Vec3f{x[2], x[1], x[0]}), 1e-6f);
  }
  // Mirrored cells are of the other colour, so this holds once the pressure is solved.
  projection.restart();
  position = half;
  for (const Vec3f& x : half) position.push_back({1 - x[0], x[1], x[2]});
  projection.apply(position.data(), static_cast<int64_t>(position.size()));
  for (std::size_t i = 0; i < half.size(); ++i) {
    const Vec3f& x = position[i];
    ASSERT_LT(norm(position[i + half.size()] - Vec3f{1 - x[0], x[1], x[2]}), 0.01f * static_cast<float>(spacing));
  }
}

TEST(DensityProjection, NothingIsPressedIntoWallsAndObstacles) {
  Scene scene = scene_with_ball({0.2, 0.02, 0.2}, 0.1);
  scene.domain = box_scene().domain;
  const Environment environment(scene);
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  std::vector<Vec3f> position = random_cloud(12000, Vec3d::filled(0.02), {0.22, 0.22, 0.22});  // 1.5 times
  position.erase(std::remove_if(position.begin(), position.end(),
                                [&](const Vec3f& x) { return environment.obstacles.sample(x.cast<double>()).phi < 0; }),
                 position.end());
  std::vector<Vec3f> pushed = position;
  projection.apply(pushed.data(), static_cast<int64_t>(pushed.size()));
  EXPECT_GT(largest_way(pushed, position), 0.01);
  double deepest = 0;
  for (const Vec3f& x : pushed) {
    for (int d = 0; d < 3; ++d) deepest = std::min(deepest, double(x[d]) - 0.02);
    deepest = std::min(deepest, environment.obstacles.sample(x.cast<double>()).phi);
  }
  EXPECT_GT(deepest, -0.2 * spacing);
  apply_times(projection, environment, position, 10);
  for (const Vec3f& x : position) {
    for (int d = 0; d < 3; ++d) ASSERT_GE(x[d], 0.02f);
    ASSERT_GT(environment.obstacles.sample(x.cast<double>()).phi, -1e-5);
  }
  EXPECT_LT(largest_density(position), 1.25);
}

TEST(DensityProjection, DependsOnNeitherThreadsNorOrderNorTheLastRollout) {
  const Environment environment(scene_with_ball({0.3, 0.3, 0.5}, 0.1));
  const std::vector<Vec3f> start = random_cloud(20000, {0.3, 0.2, 0.3}, {0.5, 0.4, 0.6});
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  std::vector<Vec3f> expected;
  for (const int threads : {1, 2, 5}) {
    set_num_threads(threads);
    projection.restart();
    std::vector<Vec3f> position = start;
    apply_times(projection, environment, position, 3);
    if (threads == 1) expected = position;
    EXPECT_EQ(position, expected) << threads;
  }
  set_num_threads(0);
  const std::vector<std::size_t> order = random_order(start.size());
  std::vector<Vec3f> shuffled;
  for (const std::size_t i : order) shuffled.push_back(start[i]);
  DensityProjection fresh(Device::cpu, environment, rest, spacing);
  apply_times(fresh, environment, shuffled, 3);
  for (std::size_t i = 0; i < order.size(); ++i) ASSERT_EQ(shuffled[i], expected[order[i]]);
}

/// Smaller and larger ones before.
TEST(DensityProjection, StartsAsANewOneAfterAnotherScene) {
  Scene small = box_scene();
  small.domain.size = {0.5, 0.6, 0.7};
  const Environment first(scene_with_ball({0.3, 0.3, 0.5}, 0.1)), second(small);
  const std::vector<Vec3f> start = random_cloud(20000, {0.15, 0.2, 0.2}, {0.35, 0.4, 0.5});
  for (const Device device : {Device::cpu, Device::cuda}) {
    if (device == Device::cuda && !cuda_available()) continue;
    const auto moved = [&](DensityProjection& projection, std::size_t n) {
      Buffer<Vec3f> position(device, 0);
      position.upload({start.begin(), start.begin() + static_cast<std::ptrdiff_t>(n)});
      for (int k = 0; k < 3; ++k) projection.apply(position.data(), static_cast<int64_t>(n));
      return position.download();
    };
    DensityProjection kept(device, first, 0.3 * rest, 0.7 * spacing);
    moved(kept, start.size());
    const auto expect_as_new = [&](const Environment& environment, double limit, double of_cells, std::size_t n) {
      kept.start(environment, limit * rest, of_cells);
      kept.reserve(static_cast<int64_t>(n));
      DensityProjection fresh(device, environment, limit * rest, of_cells);
      const std::vector<Vec3f> expected = moved(fresh, n);
      EXPECT_NE(expected, std::vector<Vec3f>(start.begin(), start.begin() + static_cast<std::ptrdiff_t>(n)));
      EXPECT_EQ(moved(kept, n), expected) << n;
    };
    expect_as_new(second, 0.2, spacing, 5000);
    expect_as_new(first, 0.4, 0.5 * spacing, start.size());
    expect_as_new(first, 0.3, 0.7 * spacing, 8000);
  }
}

/// As of an emitter: the lists grow between two frames, and what they held is still there. The pressures of cells that
/// hold no matter any more are dropped, and none of others.
TEST(DensityProjection, KeepsItsPressureWhenMoreParticlesCome) {
  const Environment environment(box_scene());
  const std::vector<Vec3f> few = random_cloud(200, {0.6, 0.6, 0.6}, {0.7, 0.7, 0.7}),
                           many = random_cloud(20000, {0.3, 0.2, 0.3}, {0.5, 0.4, 0.6});
  for (const Device device : {Device::cpu, Device::cuda}) {
    if (device == Device::cuda && !cuda_available()) continue;
    const auto third_frame = [&](bool has_room) {
      DensityProjection projection(device, environment, 0.1 * rest, spacing);
      if (has_room) projection.reserve(static_cast<int64_t>(many.size()));
      Buffer<Vec3f> position(device, 0);
      for (const auto& frame : {few, many, few}) {
        if (!has_room) projection.reserve(static_cast<int64_t>(frame.size()));
        position.upload(frame);
        projection.apply(position.data(), static_cast<int64_t>(frame.size()));
      }
      return position.download();
    };
    EXPECT_EQ(third_frame(/*has_room=*/false), third_frame(/*has_room=*/true));
  }
}

TEST(DensityProjection, ParticlesOutsideAreLeftAlone) {
  const Environment environment(box_scene());
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  std::vector<Vec3f> position(2000, Vec3f{0.5f, -0.3f, 0.5f});
  position.push_back({0.5f, std::numeric_limits<float>::infinity(), 0.5f});
  std::vector<Vec3f> start = position;
  projection.apply(position.data(), static_cast<int64_t>(position.size()));
  EXPECT_EQ(position, start);
  position[7] = {0.5f, 0.5f, std::nanf("")};
  projection.apply(position.data(), static_cast<int64_t>(position.size()));
  EXPECT_EQ(position[7][0], 0.5f);
  EXPECT_EQ(position[8], start[8]);
}

TEST(DensityProjection, LargeDomainsTakeLargerCells) {
  for (const double shift : {0.0, 0.5}) {
    const density::Cells scene_of_a_million = density::cells_over(Vec3d::zero(), {18.6, 1, 18.6}, 0.035, shift);
    EXPECT_EQ(scene_of_a_million.spacing, 0.035);
    EXPECT_GT(scene_of_a_million.count(), 8000000);
    const density::Cells larger = density::cells_over(Vec3d::zero(), {90, 1, 90}, 0.035, shift);
    EXPECT_EQ(larger.spacing, 0.07);
    EXPECT_LE(larger.count(), density::most_cells);
    EXPECT_EQ(larger.size[0] % 2, 0);
    for (int d = 0; d < 3; ++d) {
      EXPECT_LE(larger.origin[d], -density::border * 0.07);
      EXPECT_GE(larger.origin[d] + larger.size[d] * 0.07, (d == 1 ? 1 : 90) + 1.4 * 0.07);
    }
    EXPECT_LE(density::cells_over(Vec3d::zero(), Vec3d::filled(1e4), 0.035, shift).count(), density::most_cells);
  }
}

TEST(DensityProjection, RefusesCellsThatDoNotFitIntoTheMemory) {
  const density::Cells cells = density::cells_over(Vec3d::zero(), Vec3d::filled(1), 0.01, 0);
  const auto bytes = static_cast<uint64_t>(density::bytes_of_cell * static_cast<double>(cells.count()));
  EXPECT_NO_THROW(density::check_fits(cells, bytes + 1));
  EXPECT_THROW(density::check_fits(cells, bytes - 1), ConfigError);
}

void expect_same_on_gpu(int particles, double of_cells, const Vec3d& high = {0.5, 0.4, 0.6}) {
  // No face of a cell lies between two of the ball's voxels, where its normal jumps.
  const Environment environment(scene_with_ball({0.3123, 0.3057, 0.4891}, 0.1));
  DensityProjection on_cpu(Device::cpu, environment, rest, of_cells), on_gpu(Device::cuda, environment, rest, of_cells);
  std::vector<Vec3f> position = random_cloud(particles, {0.3, 0.2, 0.3}, high);
  Buffer<Vec3f> device(Device::cuda, 0);
  for (int frame = 0; frame < 4; ++frame) {
    device.upload(position);  // later frames start from the last one's pressure
    on_gpu.apply(device.data(), static_cast<int64_t>(position.size()));
    const std::vector<Vec3f> start = position;
    on_cpu.apply(position.data(), static_cast<int64_t>(position.size()));
    EXPECT_GT(largest_way(position, start), 1e-3 * of_cells / spacing);
    EXPECT_LT(largest_way(device.download(), position), 1e-4 * spacing) << of_cells << " " << frame;
  }
}

TEST(DensityProjection, MovesNothingWhereItIsToSkip) {
  const Environment environment(box_scene());
  DensityProjection projection(Device::cpu, environment, rest, spacing);
  const std::vector<Vec3f> start = random_cloud(20000, {0.3, 0.2, 0.3}, {0.5, 0.4, 0.6});
  std::vector<Vec3f> position = start;
  int32_t flag = 1;
  projection.skip_where(&flag);
  projection.apply(position.data(), static_cast<int64_t>(position.size()));
  EXPECT_EQ(position, start);
  flag = 0;
  projection.apply(position.data(), static_cast<int64_t>(position.size()));
  EXPECT_NE(position, start);
}

/// A frame that is skipped leaves the pressure that the next one starts from.
TEST(DensityProjection, KeepsItsPressureOverSkippedFramesOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const Environment environment(box_scene());
  const std::vector<Vec3f> start = random_cloud(20000, {0.3, 0.2, 0.3}, {0.5, 0.4, 0.6});
  const auto n = static_cast<int64_t>(start.size());
  const auto second_frame = [&](bool skips) {
    DensityProjection projection(Device::cuda, environment, rest, spacing);
    Buffer<Vec3f> position(Device::cuda, 0);
    Buffer<int32_t> flag(Device::cuda, 0);
    position.upload(start);
    projection.apply(position.data(), n);
    const std::vector<Vec3f> after = position.download();
    if (skips) {
      flag.upload({1});
      projection.skip_where(flag.data());
      position.upload(std::vector<Vec3f>(start.size(), Vec3f::filled(0.1f)));
      projection.apply(position.data(), n);
      projection.skip_where(nullptr);
    }
    position.upload(after);
    projection.apply(position.data(), n);
    return position.download();
  };
  EXPECT_EQ(second_frame(true), second_frame(false));
}

TEST(DensityProjection, IsTheSameOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_same_on_gpu(20000, spacing);
  expect_same_on_gpu(40000, spacing / 3);                      // more cells than one block holds
  expect_same_on_gpu(60000, spacing / 3.2, {0.5, 0.5, 0.65});  // more than a cluster has threads for a colour
  expect_same_on_gpu(40000, spacing / 5);                      // swept by the whole GPU
}

TEST(RestDensity, IsThatOfTheSourcesOrOfTheStart) {
  Scene scene;
  scene.domain.dx = 0.02;
  const std::vector<Vec3f> dense = block(Vec3d::filled(0.2), {40, 40, 40}, lattice);
  EXPECT_NEAR(rest_density(scene, dense, spacing) / rest, 1, 0.05) << "no source";
  EXPECT_EQ(rest_density(scene, {}, spacing), 0);
  scene.sources.resize(2);
  scene.sources[0].particles_per_cell = 8;
  scene.sources[1].particles_per_cell = 2;
  EXPECT_NEAR(rest_density(scene, random_cloud(500, Vec3d::filled(0.1), Vec3d::filled(0.9)), spacing), rest,
              1e-6 * rest);
  scene.sources[0].particles_per_cell = 1;  // a box around scattered matter
  EXPECT_NEAR(rest_density(scene, dense, spacing) / rest, 1, 0.05);
}

/// A turned box, a thin plate between cells, a ball that two of them meet in, with narrow bands and wide ones.
TEST(DensityProjection, CellsFarFromSurfacesHaveTheFacesOfASearch) {
  Scene scene = box_scene();
  Obstacle ball, plate;
  ball.shape = Shape::sphere;
  ball.radius = 0.25;
  ball.position = {0.4, 0.35, 0.5};
  plate.shape = Shape::box;
  plate.size = {0.6, 0.024, 0.4};
  plate.position = {0.55, 0.6, 0.5};
  plate.rotation_axis = {1, 0.2, 0.7};
  plate.rotation_angle = 35;
  scene.obstacles = {ball, plate};
  const Environment environment(scene);
  for (const double edge : {0.012, 0.02, 0.04}) {
    const density::Cells cells = density::cells_over(environment.box_low, environment.box_high, edge, 0);
    std::vector<density::OpenFractions> found(static_cast<std::size_t>(cells.count()));
    const density::FindOpenFractions find{cells, environment.obstacles.view(Device::cpu), environment.box_low,
                                          environment.box_high, found.data()};
    int far = 0, wrong = 0;
    for (int64_t i = 0; i < cells.count(); ++i) {
      find(i);
      const auto n = static_cast<int>(i);
      const Vec3i cell = {n % cells.size[0], n / cells.size[0] % cells.size[1], n / cells.size[0] / cells.size[1]};
      const Vec3d centre = cells.origin + (cell.cast<double>() + Vec3d::filled(0.5)) * cells.spacing;
      const auto here = find.nearest(centre);
      far += find.is_far_from_surfaces(here);
      float faces[3];
      find.find_faces(centre, here, faces);
      for (int d = 0; d < 3; ++d) wrong += faces[d] != found[static_cast<std::size_t>(i)].face[d];
    }
    EXPECT_EQ(wrong, 0) << edge;
    EXPECT_TRUE(edge > 0.03 || far > cells.count() / 4) << edge;
  }
}

}  // namespace
}  // namespace graupel::graph
