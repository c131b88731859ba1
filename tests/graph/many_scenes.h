// Scenes of one rollout of many, for tests: they own what LearnedSimulator::SceneRollout points to.
#pragma once

#include <deque>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/graph/rollout_case.h"

namespace graupel::graph {

class ManyScenes {
 public:
  void add(Case c, const LearnedSimulator::RolloutOptions& options, const std::string& name = "clouds") {
    const Case& kept = cases_.emplace_back(std::move(c));
    const Environment& environment = environments_.emplace_back(kept.scene);
    list_.push_back({name, &kept.scene, &environment, &kept.type, &kept.history, options});
  }
  const std::vector<LearnedSimulator::SceneRollout>& list() const { return list_; }

  /// Rollouts of all; `order` has the places in the order in which they came.
  std::vector<LearnedSimulator::SceneResult> run(const LearnedSimulator& simulator,
                                                 const LearnedSimulator::ManyOptions& options = {},
                                                 std::vector<std::size_t>* order = nullptr) const {
    std::vector<LearnedSimulator::SceneResult> results(list_.size());
    simulator.rollout_many(
        list_,
        [&](LearnedSimulator::SceneResult&& result) {
          if (order != nullptr) order->push_back(result.scene);
          results.at(result.scene) = std::move(result);
        },
        options);
    return results;
  }
  Trajectory alone(const LearnedSimulator& simulator, std::size_t i) const {
    const LearnedSimulator::SceneRollout& s = list_[i];
    return simulator.rollout(*s.scene, *s.environment, *s.particle_type, *s.start, s.options);
  }
  /// To the last bit.
  void expect_as_alone(const LearnedSimulator& simulator,
                       const std::vector<LearnedSimulator::SceneResult>& results) const {
    ASSERT_EQ(results.size(), list_.size());
    for (std::size_t i = 0; i < results.size(); ++i) {
      const Trajectory expected = alone(simulator, i);
      const Trajectory& actual = results[i].trajectory;
      EXPECT_EQ(results[i].scene, i);
      EXPECT_EQ(actual.diverged_at_frame, expected.diverged_at_frame) << "scene " << i;
      EXPECT_EQ(actual.particle_type, expected.particle_type);
      ASSERT_EQ(actual.frame_count(), expected.frame_count()) << "scene " << i;
      for (std::size_t f = 0; f < expected.frame_count(); ++f) {
        ASSERT_EQ(actual.frames[f].position, expected.frames[f].position) << "scene " << i << ", frame " << f;
        ASSERT_EQ(actual.frames[f].velocity, expected.frames[f].velocity) << "scene " << i << ", frame " << f;
        EXPECT_EQ(actual.frames[f].time, expected.frames[f].time);
      }
    }
  }
  /// What progress throws comes out as it is, and leaves nothing behind: `used` then has the bits of a `fresh` one.
  void expect_to_go_on_after_an_exception(const LearnedSimulator& used, const LearnedSimulator& fresh) const {
    struct Stop : std::runtime_error {
      Stop() : std::runtime_error("asked to stop") {}
    };
    EXPECT_THROW(run(used, {.progress = [](int64_t) { throw Stop(); }}), Stop);
    const LearnedSimulator::SceneRollout& s = list_.front();
    LearnedSimulator::RolloutOptions options = s.options;
    options.progress = [](int64_t, const FrameTiming&) { throw Stop(); };
    EXPECT_THROW(used.rollout(*s.scene, *s.environment, *s.particle_type, *s.start, options), Stop);
    expect_as_alone(fresh, run(used));
    expect_as_alone(used, run(fresh));
  }

 private:
  std::deque<Case> cases_;
  std::deque<Environment> environments_;
  std::vector<LearnedSimulator::SceneRollout> list_;
};

/// All particles move by `step` [m/frame] before the start.
inline Case moving_by(Case c, const Vec3f& step) {
  for (std::size_t t = 0; t + 1 < c.history.size(); ++t)
    for (std::size_t i = 0; i < c.type.size(); ++i)
      c.history[t][i] = c.history.back()[i] - step * static_cast<float>(c.history.size() - 1 - t);
  return c;
}

}  // namespace graupel::graph
