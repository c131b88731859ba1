// Rollouts of many scenes at once on a GPU have the bits of each scene alone.
#include <gtest/gtest.h>

#include "graph/cuda/aggregation/pair_aggregation.h"
#include "graph/cuda_batch.h"
#include "sparsegrid/hierarchy.h"
#include "tests/gpu_only.h"
#include "tests/graph/many_scenes.h"

namespace graupel::graph {
namespace {

/// Parts of a scene are those that it has alone, one after the other.
TEST(PairParts, DoNotDependOnTheScenesBefore) {
  const std::vector<int64_t> pairs = {8, 40, 8 * 37, 0, 64, 8 * 1001};
  const std::vector<int32_t> begins = begins_of_parts(pairs);
  const auto scenes = static_cast<int32_t>(pairs.size());
  const PairParts together{scenes, begins.data(), begins.data() + scenes + 1}, alone{};
  int32_t first_pair = 0, first_part = 0;
  for (const int64_t count : pairs) {
    int32_t parts = 0;
    for (int32_t k = 0; k < count; ++k) {
      const int32_t part = together.part_of(first_pair + k);
      ASSERT_EQ(part - first_part, alone.part_of(k));
      const PairParts::Range range = together.pairs_of(part);
      ASSERT_LE(range.begin, first_pair + k);
      ASSERT_LT(first_pair + k, range.end);
      ASSERT_EQ(range.begin - first_pair, alone.pairs_of(alone.part_of(k)).begin);
      ASSERT_LE(range.end, first_pair + count);
      parts = part - first_part + 1;
    }
    first_pair += static_cast<int32_t>(count);
    first_part += parts;
  }
  EXPECT_LE(first_part, rows_of_pair_aggregation(0, first_pair, scenes));
  const PairParts::Range beyond = together.pairs_of(first_part);
  EXPECT_EQ(beyond.begin, beyond.end);
}

class CudaBatchTest : public ::testing::Test {
 protected:
  CudaBatchTest() {
    options_.frames = 7;
    options_.device = Device::cuda;
  }
  LearnedSimulator make(int64_t bundle, Aggregation aggregation = Aggregation::activations) const {
    HgnConfig config = wide_config(aggregation);
    config.bundle = bundle;
    return file_.read_back(random_weights(config, wide_statistics()));
  }
  /// Of different sizes, motions and obstacles.
  ManyScenes different_scenes(int count) const {
    ManyScenes scenes;
    for (int k = 0; k < count; ++k) {
      constexpr int particles[] = {37, 800, 1, 3001, 1500, 90};
      Case c = clouds_at_a_ball(particles[k % 6], 0.004 * (k % 4), {0.002 * k / count, -0.01, 0});
      if (k % 3 == 1) c.scene.obstacles.clear();
      if (k % 5 == 2) c.scene.gravity = {0, -3, 1};
      scenes.add(std::move(c), options_);
    }
    return scenes;
  }
  static void expect_together(const std::vector<LearnedSimulator::SceneResult>& results) {
    for (const auto& result : results) EXPECT_EQ(result.alone, "") << result.scene;
  }
  WeightsFile file_;
  LearnedSimulator::RolloutOptions options_;
};

TEST_F(CudaBatchTest, ScenesHaveTheBitsThatTheyHaveAlone) {
  GRAUPEL_NEEDS_GPU();
  for (const int64_t bundle : {1, 2, 3}) {  // the last ones cut
    const LearnedSimulator simulator = make(bundle);
    for (const int count : {2, 6}) {  // grids in one launch, and in several
      const ManyScenes scenes = different_scenes(count);
      const auto results = scenes.run(simulator);
      expect_together(results);
      scenes.expect_as_alone(simulator, results);
    }
  }
}

TEST_F(CudaBatchTest, BatchesFollowEachOther) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator simulator = make(2);
  const ManyScenes scenes = different_scenes(8);
  LearnedSimulator::ManyOptions options;
  options.most_at_once = 3;
  std::vector<std::size_t> order;
  const auto results = scenes.run(simulator, options, &order);
  EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7}));
  expect_together(results);
  scenes.expect_as_alone(simulator, results);
}

/// They are taken aside before another batch, and come in pieces.
TEST_F(CudaBatchTest, FramesAreReadWhileAnotherBatchRuns) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator simulator = make(2);
  const ManyScenes scenes = different_scenes(6);
  const auto results = scenes.run(simulator);
  CudaBatch batch(simulator.weights());
  const std::vector<int32_t> no_material;
  const auto run = [&](std::size_t first, std::size_t end) {
    std::vector<CudaScene> list;
    for (std::size_t i = first; i < end; ++i) {
      const auto& s = scenes.list()[i];
      list.push_back({s.scene, s.environment, s.particle_type, &no_material, s.start, {}});
    }
    batch.start(list, options_.frames);
    batch.run();
  };
  run(0, 6);
  batch.keep_frames();
  run(2, 5);
  for (const int64_t at_once : {1, 900, 5000, 1 << 21}) {
    std::vector<int64_t> next(6, 0);
    batch.read_frames(
        [&](const std::vector<CudaBatch::FramePiece>& pieces) {
          for (const auto& [scene, first, position] : pieces) {
            ASSERT_EQ(first, next[scene]);
            const auto& frames = results[scene].trajectory.frames;
            const std::size_t n = frames[0].position.size();
            for (std::size_t i = 0; i < position.size(); ++i)
              ASSERT_EQ(position[i], frames[static_cast<std::size_t>(first) + 1 + i / n].position[i % n]);
            next[scene] += static_cast<int64_t>(position.size() / n);
          }
        },
        at_once);
    EXPECT_EQ(next, std::vector<int64_t>(6, options_.frames));
  }
}

TEST_F(CudaBatchTest, MoreScenesThanALaunchTakes) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator simulator = make(2);
  options_.frames = 4;
  ManyScenes scenes;
  for (int k = 0; k < 64; ++k) scenes.add(clouds_at_a_ball(20 + 3 * k), options_);
  const auto results = scenes.run(simulator);
  expect_together(results);
  scenes.expect_as_alone(simulator, results);
}

/// Cells of the finest grids of all scenes, at the places that `at` gives.
template <typename At>
std::size_t finest_cells(const ManyScenes& scenes, double spacing, const At& at) {
  std::size_t cells = 0;
  for (std::size_t i = 0; i < scenes.list().size(); ++i)
    cells += sparsegrid::build_hierarchy<3>(at(i), spacing, scenes.list()[i].environment->grid_origin(spacing), 1)
                 .levels[0]
                 .size();
  return cells;
}

/// One scene needs many times the cells of its first frame, and its pressures go on. The first recording has room for
/// half as many cells again (LevelCapacity), so that there must be another one.
TEST_F(CudaBatchTest, GoOnWhereMatterSpreads) {
  GRAUPEL_NEEDS_GPU();
  Case spreading = clouds_at_a_ball(600);
  const Vec3f middle{0.5f, 0.7f, 0.5f};
  for (std::size_t t = 0; t < spreading.history.size(); ++t)
    for (std::size_t i = 0; i < spreading.type.size(); ++i) {
      const Vec3f start = middle + (spreading.history[5][i] - Vec3f{0.4f, 0.4f, 0.4f}) * 0.1f;
      spreading.history[t][i] = start + (start - middle) * (0.4f * static_cast<float>(t));
    }
  const LearnedSimulator simulator = make(2);
  options_.frames = 12;
  ManyScenes scenes;
  scenes.add(clouds_at_a_ball(800), options_);
  scenes.add(spreading, options_);
  scenes.add(clouds_at_a_ball(3000), options_);
  const auto results = scenes.run(simulator);
  expect_together(results);
  scenes.expect_as_alone(simulator, results);
  const double spacing = wide_config(Aggregation::activations).spacing;
  const auto first = [&](std::size_t i) { return results[i].trajectory.frames.front().position; };
  const auto before_last = [&](std::size_t i) { return results[i].trajectory.frames[10].position; };
  EXPECT_GT(finest_cells(scenes, spacing, before_last), 3 * finest_cells(scenes, spacing, first) / 2 + 64);
}

TEST_F(CudaBatchTest, ScenesThatDivergeOrLeaveTheGridStopAlone) {
  GRAUPEL_NEEDS_GPU();
  for (const int64_t bundle : {1, 2}) {
    const LearnedSimulator simulator = make(bundle);
    options_.project = false;
    ManyScenes scenes;
    scenes.add(clouds_at_a_ball(800), options_);
    scenes.add(moving_by(clouds_at_a_ball(100), {1.5f, 0, 0}), options_);  // more than the domain's edge a frame
    scenes.add(moving_by(clouds_at_a_ball(100), {0.4f, 0, 0}), options_);  // out of the domain
    scenes.add(clouds_at_a_ball(300), options_);
    const auto results = scenes.run(simulator);
    expect_together(results);
    scenes.expect_as_alone(simulator, results);
    EXPECT_EQ(results[1].trajectory.diverged_at_frame, 1);
    EXPECT_GT(results[2].trajectory.diverged_at_frame, 1);
    for (const std::size_t i : {0, 3}) EXPECT_EQ(results[i].trajectory.diverged_at_frame, -1);
  }
}

TEST_F(CudaBatchTest, AllScenesMayDiverge) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator simulator = make(2);
  ManyScenes scenes;
  for (int k = 0; k < 3; ++k) scenes.add(moving_by(clouds_at_a_ball(50), {1.5f, 0, 0}), options_);
  for (const auto& result : scenes.run(simulator)) EXPECT_EQ(result.trajectory.diverged_at_frame, 1);
}

TEST_F(CudaBatchTest, ScenesThatDoNotFitRunAloneInTheSameCall) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator simulator = make(2);
  ManyScenes scenes;
  Case moving = clouds_at_a_ball(60);
  moving.scene.obstacles[0].motion.emplace().velocity = {0.1, 0, 0};
  scenes.add(moving, options_);
  scenes.add(clouds_at_a_ball(60), options_);
  auto shorter = options_;
  shorter.frames = 3;
  scenes.add(clouds_at_a_ball(60), shorter);
  scenes.add(clouds_at_a_ball(90), options_);
  std::vector<std::size_t> order;
  const auto results = scenes.run(simulator, {}, &order);
  EXPECT_EQ(order, (std::vector<std::size_t>{1, 3, 0, 2}));
  EXPECT_EQ(results[0].alone, "its obstacles move");
  EXPECT_EQ(results[1].alone, "");
  EXPECT_EQ(results[2].alone, "no other scene fits beside it (as many frames, the same lower corner, room)");
  scenes.expect_as_alone(simulator, results);
}

TEST_F(CudaBatchTest, ProgressEndsWithTheLastFrame) {
  GRAUPEL_NEEDS_GPU();
  for (const int64_t frames : {1, 2, 7}) {
    options_.frames = frames;
    int64_t last = 0;
    different_scenes(3).run(make(2), {.progress = [&](int64_t frame) {
                              EXPECT_GE(frame, last);
                              last = frame;
                            }});
    EXPECT_EQ(last, frames);
  }
}

TEST_F(CudaBatchTest, GoesOnAfterAnException) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator used = make(2), fresh = make(2);
  different_scenes(3).expect_to_go_on_after_an_exception(used, fresh);
}

TEST_F(CudaBatchTest, OtherNetworksRunSceneByScene) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator simulator = make(2, Aggregation::messages);
  const ManyScenes scenes = different_scenes(2);
  const auto results = scenes.run(simulator);
  for (const auto& result : results) EXPECT_EQ(result.alone, "the network is no HGN that aggregates activations");
  scenes.expect_as_alone(simulator, results);
}

}  // namespace
}  // namespace graupel::graph
