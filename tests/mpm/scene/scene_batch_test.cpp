// Batches of scenes: every scene has the bytes, the fields and the error of its single run, on any device.
#include <gtest/gtest.h>

#include <atomic>

#include "core/parallel/buffer.h"
#include "core/system/error.h"
#include "mpm/grouped_batch.h"
#include "mpm/simulation.h"
#include "tests/gpu_only.h"
#include "tests/mpm/changing_scenes.h"

namespace graupel::mpm {
namespace {

Scene thrown(const std::string& material, double size, double speed) {
  Scene scene = scene_with(material, {0.5, 0.12, 0.5}, size);
  scene.sources[0].velocity = {0.4, -speed, 0};
  scene.time_step.substeps_per_frame = 10;
  scene.frame_time = 10 * 3e-4;
  return scene;
}

/// Scenes of different materials and sizes; the second one diverges in its first frame.
std::vector<Scene> some_scenes() {
  return {thrown("taichi_water", 0.05, 1), thrown("taichi_water", 0.04, 300), thrown("taichi_jelly", 0.06, 2),
          thrown("taichi_sand", 0.05, 1)};
}

std::vector<PreparedScene> prepared(const std::vector<Scene>& scenes, Device device) {
  std::vector<PreparedScene> out;
  for (const Scene& scene : scenes)
    out.emplace_back(scene, SimulationOptions{.device = device, .seed = 3 + scene.sources.size()});
  return out;
}

void expect_same_frame(const ParticleFrame& a, const ParticleFrame& b) {
  EXPECT_EQ(a.time, b.time);
  EXPECT_TRUE(a.position == b.position);
  EXPECT_TRUE(a.velocity == b.velocity);
  EXPECT_TRUE(a.active == b.active);
  EXPECT_TRUE(a.fields == b.fields);
}

/// Rows in the memory of the device are the numbers of the frame.
void expect_rows(const ParticleFrame& frame, const std::shared_ptr<const float>& rows, ParticleQuantity what,
                 Device device) {
  std::vector<float> values(frame.position.size() * static_cast<std::size_t>(components_of(what)));
  device_copy(Device::cpu, values.data(), device, rows.get(), values.size() * sizeof(float));
  const auto expect_vectors = [&](const std::vector<Vec3f>& vectors) {
    for (std::size_t i = 0; i < vectors.size(); ++i)
      for (std::size_t d = 0; d < 3; ++d) ASSERT_EQ(values[3 * i + d], vectors[i][static_cast<int>(d)]) << i;
  };
  if (what == ParticleQuantity::position) return expect_vectors(frame.position);
  if (what == ParticleQuantity::velocity) return expect_vectors(frame.velocity);
  for (const ParticleField field : all_particle_fields) {
    if (quantity_of(field) != what) continue;
    EXPECT_TRUE(values == frame.fields[field]) << info_of(field).name;
  }
}

constexpr std::array all_quantities = {ParticleQuantity::position,
                                       ParticleQuantity::velocity,
                                       ParticleQuantity::stress,
                                       ParticleQuantity::affine,
                                       ParticleQuantity::deformation_gradient,
                                       ParticleQuantity::plastic};

/// Runs a scene alone for `frames`; returns why it diverged.
std::optional<std::string> run_alone(Simulation& run, int frames) {
  try {
    for (int f = 0; f < frames; ++f) run.advance_frame();
  } catch (const DivergedError& error) {
    return error.what();
  }
  return std::nullopt;
}

void expect_single_runs(const std::vector<Scene>& scenes, Device device) {
  constexpr int frames = 3;
  const auto starts = prepared(scenes, device);
  const auto batch = SceneBatch::create(starts);
  const auto begin = batch->frames({});
  for (int f = 0; f < frames; ++f) batch->advance_frame();
  const auto end = batch->frames(all_fields());
  ASSERT_EQ(batch->scene_count(), static_cast<int>(scenes.size()));
  int64_t particles = 0;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    SCOPED_TRACE("scene " + std::to_string(i));
    const auto alone = Simulation::create(starts[i]);
    EXPECT_EQ(batch->particle_type(static_cast<int>(i)), alone->particle_type());
    expect_same_frame(begin[i], alone->frame());
    const auto reason = run_alone(*alone, frames);
    EXPECT_EQ(batch->divergence(static_cast<int>(i)), reason);
    if (!reason) {
      expect_same_frame(end[i], frame_with_fields(*alone, all_fields()));
      for (const ParticleQuantity what : all_quantities) {
        expect_rows(end[i], batch->rows(what)[i], what, device);
        expect_rows(end[i], alone->rows(what), what, device);
      }
    }
    particles += static_cast<int64_t>(alone->particle_count());
  }
  EXPECT_EQ(batch->particle_count(), particles);
}

TEST(SceneBatch, EverySceneIsAsAloneOnTheCpu) {
  const auto scenes = some_scenes();
  expect_single_runs(scenes, Device::cpu);
  expect_single_runs({scenes[2]}, Device::cpu);
  const auto batch = SceneBatch::create(prepared(scenes, Device::cpu));
  batch->advance_frame();
  ASSERT_TRUE(batch->divergence(1));
  EXPECT_NE(batch->divergence(1)->find("diverged at particle"), std::string::npos);
  EXPECT_FALSE(batch->divergence(0));
  EXPECT_EQ(batch->statistics().substeps, 10);
}

/// A frame that was stopped after some substeps goes on with each scene where it was.
TEST(SceneBatch, AStoppedFrameGoesOn) {
  const auto starts = prepared(some_scenes(), Device::cpu);
  const auto whole = SceneBatch::create(starts);
  whole->advance_frame();
  const auto run_with_stops = [&](SceneBatch& batch) {
    std::atomic<int> asked = 0;
    int stopped = 0;
    while (!batch.advance_frame([&] { return ++asked % 7 == 0; })) ++stopped;
    EXPECT_GT(stopped, 2);
    EXPECT_EQ(batch.statistics().substeps, 10);
    const auto frames = batch.frames(all_fields()), expected = whole->frames(all_fields());
    for (const std::size_t i : {std::size_t{0}, std::size_t{2}, std::size_t{3}})
      expect_same_frame(frames[i], expected[i]);
  };
  run_with_stops(*SceneBatch::create(starts));
  run_with_stops(
      *make_grouped(starts, {{3, 1}, {2}, {0}}, [](const auto& group) { return SceneBatch::create(group); }));
}

TEST(SceneBatch, EverySceneIsAsAloneOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const auto scenes = some_scenes();
  expect_single_runs(scenes, Device::cuda);
  expect_single_runs({scenes[2]}, Device::cuda);
}

/// Scenes of different grids, and what the tuned kernels for GPUs do not know.
std::vector<Scene> scenes_that_share_no_launch() {
  std::vector<Scene> scenes = some_scenes();
  scenes[0].domain.dx = 1.0 / 48;
  scenes[2].transfer = {TransferScheme::rpic, 3};
  scenes.push_back(scenes[3]);  // one grid with the second and fourth
  scenes.back().sources[0].velocity = {0, -2, 0};
  return scenes;
}

/// Batches of any grouping give the frames and errors of each scene at its own index.
TEST(SceneBatch, GroupsKeepTheOrderOfTheScenes) {
  const auto starts = prepared(some_scenes(), Device::cpu);
  const auto together = SceneBatch::create(starts),
             apart =
                 make_grouped(starts, {{3, 1}, {2}, {0}}, [](const auto&group) { return SceneBatch::create(group); });
  ASSERT_EQ(apart->scene_count(), 4);
  for (int f = 0; f < 2; ++f) together->advance_frame(), apart->advance_frame();
  const auto expected = together->frames(all_fields()), frames = apart->frames(all_fields());
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(apart->particle_type(i), together->particle_type(i));
    EXPECT_EQ(apart->divergence(i), together->divergence(i));
    if (i != 1) expect_same_frame(frames[static_cast<std::size_t>(i)], expected[static_cast<std::size_t>(i)]);
  }
  EXPECT_EQ(apart->particle_count(), together->particle_count());
  EXPECT_EQ(apart->statistics().substeps, together->statistics().substeps);
}

TEST(SceneBatch, ScenesWithoutACommonLaunchAreAsAloneOnTheCpu) {
  expect_single_runs(scenes_that_share_no_launch(), Device::cpu);
}

/// Scenes that change, among others.
std::vector<Scene> scenes_of_all_kinds() {
  std::vector<Scene> scenes = scenes_that_share_no_launch();
  for (const auto& [name, scene] : changing_scenes()) scenes.push_back(scene);
  scenes.push_back(turning_paddle());
  scenes.back().sources[0].velocity = {0, -300, 0};  // diverges
  return scenes;
}

TEST(SceneBatch, ScenesThatChangeAreAsAloneOnTheCpu) { expect_single_runs(scenes_of_all_kinds(), Device::cpu); }

TEST(SceneBatch, ScenesThatChangeAreAsAloneOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_single_runs(scenes_of_all_kinds(), Device::cuda);
}

TEST(SceneBatch, ScenesWithoutACommonLaunchAreAsAloneOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_single_runs(scenes_that_share_no_launch(), Device::cuda);
}

}  // namespace
}  // namespace graupel::mpm
