// Rollouts of scenes that change: obstacles that move, particles that come, go or follow a script, open and periodic
// walls.
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/error.h"
#include "graph/corrections/free_flight.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/features/periodic_images.h"
#include "graph/networks/graph_network.h"
#include "tests/graph/changing_scene_case.h"
#include "tests/graph/cuda/simulator_case.h"

namespace graupel::graph {
namespace {

class ChangingScenes : public LearnedSimulatorTest {
 protected:
  LearnedSimulator make_random() const { return make(random_weights(small_config(), free_flight())); }
  static Trajectory roll(const LearnedSimulator& simulator, const ChangingCase& c, int64_t frames,
                         double density_limit = 1) {
    LearnedSimulator::RolloutOptions options;
    options.frames = frames;
    options.density_limit = density_limit;
    options.schedule = &c.schedule;
    const int history = static_cast<int>(simulator.config().history) + 1;
    return simulator.rollout(c.scene, Environment(c.scene), c.type, c.history(history), options);
  }
};

Vec3d mean_velocity(const ParticleFrame& frame) {
  Vec3d sum = Vec3d::zero();
  for (const Vec3f& v : frame.velocity) sum += v.cast<double>();
  return sum * (1 / static_cast<double>(frame.velocity.size()));
}

TEST_F(ChangingScenes, ABodyInFlightCrossesAPeriodicWallAndKeepsItsMomentum) {
  const ChangingCase c = body_across_a_periodic_wall();
  const Environment environment(c.scene);
  const Trajectory t = roll(make_random(), c, 10);
  ASSERT_EQ(t.frame_count(), 11u);
  std::size_t wrapped = 0;
  for (std::size_t f = 1; f < t.frame_count(); ++f) {
    const double time = static_cast<double>(f) * frame_time;
    const Vec3d v = mean_velocity(t.frames[f]);
    EXPECT_NEAR(v[0], 3, 1e-3) << f;
    EXPECT_NEAR(v[1], 0.5 + gravity * (time - frame_time / 2), 1e-3) << f;
    EXPECT_NEAR(v[2], 0.2, 1e-3) << f;
    std::size_t low = 0;
    for (const Vec3f& x : t.frames[f].position) {
      EXPECT_GE(x[0], static_cast<float>(environment.box_low[0])) << f;
      EXPECT_LE(x[0], static_cast<float>(environment.box_high[0])) << f;
      low += x[0] < 0.5f ? 1 : 0;
    }
    if (f == 4) {
      EXPECT_GT(low, 0u) << "a part has crossed";
      EXPECT_LT(low, c.type.size());
    }
    wrapped = low;
  }
  EXPECT_EQ(wrapped, c.type.size());
}

TEST_F(ChangingScenes, ABodyAcrossAPeriodicWallIsOneGroup) {
  const ChangingCase c = body_across_a_periodic_wall();
  const Environment environment(c.scene);
  std::vector<std::vector<Vec3f>> history = c.history(2);
  for (std::size_t i = 0; i < c.type.size(); ++i) {
    const float shift = history[1][i][0] + 0.1f > static_cast<float>(environment.box_high[0]) ? -0.9f : 0.1f;
    for (std::vector<Vec3f>& frame : history) frame[i][0] += shift;
  }
  FreeFlight flight(Device::cpu, c.scene, environment, c.type);
  flight.find_groups(history[0].data(), history[1].data());
  const std::vector<int32_t> groups = flight.groups();
  EXPECT_GE(groups[0], 0);
  EXPECT_EQ(groups, std::vector<int32_t>(groups.size(), groups[0]));
  // Accelerations that turn the body about its centre are taken from it as from one that is whole.
  std::vector<Vec3f> next(c.type.size()), flying(c.type.size());
  for (std::size_t i = 0; i < next.size(); ++i) {
    flying[i] = history[1][i] * 2.0f - history[0][i] + environment.gravity_step;
    const Vec3f arm = c.position[i] - Vec3f{0.85f, 0.7f, 0.5f};
    next[i] = flying[i] + Vec3f{-arm[1], arm[0], 0} * 0.01f;
  }
  flight.correct(history[0].data(), history[1].data(), next.data());
  for (std::size_t i = 0; i < next.size(); ++i) EXPECT_LT(norm(next[i] - flying[i]), 2e-6f);
}

/// A body that spans the period has no spin of its own.
TEST_F(ChangingScenes, ALayerAcrossThePeriodFallsAndKeepsItsMomentum) {
  ChangingCase c;
  c.scene = body_across_a_periodic_wall().scene;
  const auto low = static_cast<float>(Environment(c.scene).box_low[0]);
  for (int i = 0; i < 400; ++i)
    c.add({low + 0.02f * (static_cast<float>(i % 50) + 0.5f), 0.8f + 0.02f * static_cast<float>(i / 50 % 2),
           0.5f + 0.02f * static_cast<float>(i / 100)},
          {1, 0, 0});
  const Trajectory t = roll(make_random(), c, 8, /*density_limit=*/0);
  for (std::size_t f = 1; f < t.frame_count(); ++f) {
    EXPECT_NEAR(mean_velocity(t.frames[f])[0], 1, 1e-3) << f;
    EXPECT_NEAR(mean_velocity(t.frames[f])[1], gravity * frame_time * (static_cast<double>(f) - 0.5), 1e-3) << f;
  }
}

/// Matter that is too dense spreads at a periodic wall as it does in the middle.
TEST_F(ChangingScenes, DensityIsHeldAcrossAPeriodicWall) {
  const auto spread_at = [&](float center) {
    ChangingCase c;
    c.scene = body_across_a_periodic_wall().scene;
    c.scene.gravity = Vec3d::zero();
    c.scene.sources.emplace_back();  // eight particles a cell at rest
    const double low = Environment(c.scene).box_low[0];
    for (const Vec3f& x : cube({center, 0.5f, 0.5f}, 0.07f, 12))
      c.add({static_cast<float>(x[0] > low + 1 ? x[0] - 1 : x[0]), x[1], x[2]}, Vec3f::zero());
    nn::Weights weights = random_weights(small_config(), free_flight());
    silence_decoder(weights);
    weights.tensors["normalization.acceleration_mean"] = nn::Tensor::from_float({0, 0, 0}, {3});
    const Trajectory t = roll(make(weights), c, 6);
    double squares = 0;
    for (const Vec3f& x : t.frames.back().position) {
      double d = x[0] - center;
      d -= std::round(d);
      squares += d * d;
    }
    return std::sqrt(squares / static_cast<double>(c.type.size()));
  };
  const double middle = spread_at(0.546875f), wall = spread_at(1.046875f), at_rest = 0.07 / std::sqrt(12.0);
  EXPECT_GT(middle, 1.1 * at_rest);
  EXPECT_NEAR(wall / middle, 1, 0.05);
}

/// A cloud at a periodic wall is one in the middle of the domain.
template <typename Config>
void expect_same_across_a_wall(const Config& config, double tolerance) {
  ChangingCase middle = body_across_a_periodic_wall(), wall = middle;
  const Environment environment(middle.scene);
  const GraphNetwork network(random_weights(config, free_flight()));
  for (std::size_t i = 0; i < middle.position.size(); ++i) {
    const Vec3f center = {0.85f, 0.7f, 0.5f};
    middle.position[i] = middle.position[i] - center + Vec3f{0.546875f, 0.5f, 0.5f};
    wall.position[i] = middle.position[i] + Vec3f{0.5f, 0, 0};  // half a period
  }
  auto history = wall.history(static_cast<int>(config.history) + 1);
  for (std::size_t i = 0; i < wall.position.size(); ++i)
    if (history.back()[i][0] > static_cast<float>(environment.box_high[0]))
      for (auto& frame : history) frame[i][0] -= 1;
  FrameTiming timing;
  const auto expected =
      network.predict(environment, middle.type, {}, middle.history(static_cast<int>(config.history) + 1), timing);
  const auto actual = network.predict(environment, wall.type, {}, history, timing);
  double error = 0;
  for (std::size_t k = 0; k < expected.size(); ++k) error = std::max<double>(error, std::abs(actual[k] - expected[k]));
  EXPECT_LT(error, tolerance * largest(expected));
}

TEST_F(ChangingScenes, HgnSeesNeighboursAcrossAPeriodicWall) {
  HgnConfig config = small_config();
  config.spacing = 1.0 / 8;
  expect_same_across_a_wall(config, 1e-3);
}

TEST_F(ChangingScenes, GnsSeesNeighboursAcrossAPeriodicWall) {
  GnsConfig config;
  config.latent = 16;
  config.message_passing = 2;
  config.embedding = 4;
  config.history = 3;
  config.radius = 0.08;
  expect_same_across_a_wall(config, 1e-3);
}

/// An engine in place of the CPU's, such as a GPU, gets the images as particles and gives what the CPU's gives.
TEST_F(ChangingScenes, AnotherEngineGetsTheImagesToo) {
  ChangingCase c = body_across_a_periodic_wall();
  for (Vec3f& x : c.position) x[0] += 0.12f;  // at the wall
  const GraphNetwork network(random_weights(small_config(), free_flight()));
  std::size_t seen = 0;
  const NetworkEngine engine = [&](const std::vector<float>& features, const std::vector<int32_t>& type,
                                   const std::vector<Vec3f>& position, const Vec3d& origin,
                                   std::vector<float>& acceleration) {
    seen = position.size();
    acceleration = network.forward(features, type, position, origin);
  };
  FrameTiming timing;
  const Environment environment(c.scene);
  const auto elsewhere = network.predict(environment, c.type, {}, c.history(4), timing, &engine);
  EXPECT_GT(seen, c.type.size());
  EXPECT_EQ(elsewhere, network.predict(environment, c.type, {}, c.history(4), timing));
  EXPECT_EQ(elsewhere.size(), 3 * c.type.size());
}

TEST_F(ChangingScenes, APaddlePushesParticlesAndLeavesNoneInside) {
  const ChangingCase c = moving_paddle();
  nn::Weights weights = random_weights(small_config(), free_flight());
  silence_decoder(weights);
  weights.tensors["normalization.acceleration_mean"] = nn::Tensor::from_float({0, 0, 0}, {3});
  const Trajectory t = roll(make(weights), c, 10);
  ASSERT_EQ(t.frame_count(), 11u);
  const Environment start(c.scene);
  for (std::size_t f = 0; f < t.frame_count(); ++f) {
    const Environment here = start.at(static_cast<double>(f) * frame_time);
    const double front = 0.25 + 3 * static_cast<double>(f) * frame_time + 0.02;
    for (const Vec3f& x : t.frames[f].position) {
      EXPECT_GT(here.obstacles.sample(x.cast<double>()).phi, -1e-5) << f;
      EXPECT_GT(x[0], front - 1e-4) << "none passes through the paddle, frame " << f;
    }
  }
  EXPECT_GT(t.frames.back().position[0][0], 0.7f);
}

TEST_F(ChangingScenes, AnEnvironmentAtATimeIsThatOfTheMovedObstacle) {
  Scene moving = scene_with_ball({0.4, 0.5, 0.5}, 0.15);
  moving.obstacles[0].motion = motion_of({0.5, 0.25, 0});
  const Environment then = Environment(moving).at(0.5);
  const Environment still(scene_with_ball({0.65, 0.625, 0.5}, 0.15));
  EXPECT_EQ(then.normals.active_cells(), still.normals.active_cells());
  const Random random(3, RandomPurpose::test);
  for (uint64_t i = 0; i < 500; ++i) {
    const Vec3d x = {random.uniform(i, 0), random.uniform(i, 1), random.uniform(i, 2)};
    EXPECT_EQ(then.obstacles.sample(x).phi, still.obstacles.sample(x).phi);
    EXPECT_EQ(then.normals.at(x), still.normals.at(x));
  }
}

TEST_F(ChangingScenes, EmittedParticlesAppearWithTheirVelocityAndLeaveAtASink) {
  const ChangingCase c = emitter_over_a_sink();
  const Trajectory t = roll(make_ballistic(), c, 30);
  ASSERT_EQ(t.frame_count(), 31u);
  std::vector<uint8_t> was(c.type.size(), 0);
  for (std::size_t f = 0; f < t.frame_count(); ++f) {
    const double time = static_cast<double>(f) * frame_time;
    ASSERT_EQ(t.frames[f].active.size(), c.type.size());
    for (std::size_t i = 0; i < c.type.size(); ++i) {
      const Vec3f& x = t.frames[f].position[i];
      const double age = time - c.schedule.birth_time[i];
      const double y = 0.6 - 2 * age + gravity * age * age / 2;
      if (age < 0) {
        EXPECT_FALSE(t.frames[f].is_active(i));
        EXPECT_EQ(x, c.position[i]);
      } else if (y > 0.31) {
        EXPECT_TRUE(t.frames[f].is_active(i)) << f << " " << i;
        EXPECT_NEAR(x[1], y, 1e-5) << f << " " << i;
        if (f > 0) {
          EXPECT_NEAR(t.frames[f].velocity[i][1], -2 + gravity * (age - frame_time / 2), 1e-3);
        }
        was[i] = 1;
      } else {
        EXPECT_FALSE(t.frames[f].is_active(i)) << "gone, " << f << " " << i;
        EXPECT_EQ(norm(t.frames[f].velocity[i]), 0);
      }
    }
  }
  EXPECT_EQ(was, std::vector<uint8_t>(c.type.size(), 1));
}

TEST_F(ChangingScenes, ParticlesLeaveByAnOpenWallAndTheOthersDoNotSeeThem) {
  ChangingCase c;
  c.scene.domain.faces.x_high = WallConfig{Wall::open, {}};
  for (const Vec3f& x : cube({0.85f, 0.7f, 0.5f}, 0.1f, 3)) c.add(x, {3, 0, 0});
  const Trajectory t = roll(make_ballistic(), c, 4);
  const auto gone = [&](std::size_t f) { return std::count(t.frames[f].active.begin(), t.frames[f].active.end(), 0); };
  EXPECT_EQ(gone(0), 0);
  EXPECT_EQ(gone(2), 9);
  EXPECT_EQ(gone(3), 18);
  EXPECT_EQ(gone(4), 27);
  // Where a particle has left is of no matter to the others.
  ChangingCase other = emitter_over_a_sink();
  other.schedule.birth_time[7] = 1e9;
  ChangingCase elsewhere = other;
  elsewhere.position[7] = {0.4f, 0.59f, 0.5f};
  const LearnedSimulator random = make_random();
  const Trajectory a = roll(random, other, 8), b = roll(random, elsewhere, 8);
  for (std::size_t i = 0; i < other.type.size(); ++i)
    if (i != 7) {
      EXPECT_EQ(a.frames.back().position[i], b.frames.back().position[i]);
    }
}

TEST_F(ChangingScenes, ScriptedParticlesFollowTheScriptUntilTheyAreReleased) {
  const double release = 0.2;
  const ChangingCase c = scripted_particles(release);
  const Trajectory t = roll(make_random(), c, 20);
  ASSERT_EQ(t.frame_count(), 21u);
  const ParticleScript& script = c.schedule.scripts[0];
  for (std::size_t f = 0; f < t.frame_count(); ++f) {
    const double time = static_cast<double>(f) * frame_time;
    const RigidMap map = script.motion.at(time, script.body_center);
    for (std::size_t i = 0; i < 8; ++i) {
      const double off = norm(t.frames[f].position[i].cast<double>() - map(c.position[i].cast<double>()));
      if (time <= release + 1e-9) {
        EXPECT_LT(off, 1e-7) << f;
      }
      if (time > release + 2 * frame_time) {
        EXPECT_GT(off, 1e-4) << f;
      }
    }
  }
}

TEST_F(ChangingScenes, ScenesOfAPlaneKeepTheirZ) {
  HgnConfig config = small_config();
  config.dimensions = 2;
  ChangingCase c = moving_paddle();
  c.scene.domain.dimensions = 2;
  c.scene.domain.faces.x_high = WallConfig{Wall::open, {}};
  for (Vec3f& x : c.position) x[2] = static_cast<float>(c.scene.domain.plane());
  c.schedule.birth_time.back() = 0.05;
  const Trajectory t = roll(make(random_weights(config, free_flight())), c, 12);
  ASSERT_EQ(t.frame_count(), 13u);
  for (const ParticleFrame& frame : t.frames)
    for (const Vec3f& x : frame.position) EXPECT_EQ(x[2], static_cast<float>(c.scene.domain.plane()));
}

/// What does not change has the same bits, whichever way it goes.
TEST_F(ChangingScenes, WhatRestsIsAStaticScene) {
  const LearnedSimulator simulator = make_random();
  ChangingCase still;
  still.scene = scene_with_ball({0.5, 0.35, 0.5}, 0.15);
  for (const Vec3f& x : sheet()) still.add(x, {0, -2, 0});
  still.schedule = {};
  const Trajectory expected = roll(simulator, still, 25);
  EXPECT_TRUE(expected.frames.back().active.empty());

  ChangingCase resting = still;
  resting.scene.obstacles[0].motion = Motion{};
  const Trajectory with_motion = roll(simulator, resting, 25);
  ChangingCase sunk = still;
  sunk.scene.sinks.emplace_back();  // where no particle comes
  sunk.scene.sinks.back().position = {0.1, 0.9, 0.1};
  const Trajectory with_sink = roll(simulator, sunk, 25);
  EXPECT_EQ(with_sink.frames.back().active, std::vector<uint8_t>(still.type.size(), 1));
  for (std::size_t f = 0; f < expected.frame_count(); ++f) {
    EXPECT_EQ(with_motion.frames[f].position, expected.frames[f].position) << f;
    EXPECT_EQ(with_sink.frames[f].position, expected.frames[f].position) << f;
  }
}

TEST_F(ChangingScenes, AScheduleOfOtherParticlesIsRefused) {
  ChangingCase c = emitter_over_a_sink();
  c.schedule.birth_time.pop_back();
  EXPECT_THROW(roll(make_ballistic(), c, 1), InputError);
  c.schedule = {};
  EXPECT_THROW(roll(make_ballistic(), c, 1), InputError);
  ChangingCase half = body_across_a_periodic_wall();
  half.scene.domain.faces.x_high.reset();
  EXPECT_THROW(Environment{half.scene}, ConfigError);
}

TEST(PeriodicImages, LieOutsideTheWallsAndAtCornersToo) {
  Scene scene;
  for (auto* wall :
       {&scene.domain.faces.x_low, &scene.domain.faces.x_high, &scene.domain.faces.z_low, &scene.domain.faces.z_high})
    *wall = WallConfig{Wall::periodic, {}};
  const Environment environment(scene);
  const auto low = static_cast<float>(environment.box_low[0]);
  const PeriodicImages images =
      periodic_images(environment, {{low + 0.01f, 0.5f, low + 0.02f}, {0.5f, 0.5f, 0.5f}}, 0.05);
  ASSERT_EQ(images.source, std::vector<int32_t>(3, 0));
  const auto period = static_cast<float>(environment.period[0]);
  EXPECT_EQ(images.shift[0], (Vec3f{period, 0, 0}));
  EXPECT_EQ(images.shift[1], (Vec3f{0, 0, period}));
  EXPECT_EQ(images.shift[2], (Vec3f{period, 0, period}));
}

TEST(ParticleLifecycle, TheStoredPastOfWhatIsBornIsBallistic) {
  Scene scene;
  ParticleSchedule schedule;
  schedule.birth_time = {0.025, 0};
  schedule.birth_velocity = {{1, 0, 0}, {0, 0, 0}};
  std::vector<std::vector<Vec3f>> positions(3, std::vector<Vec3f>(2, Vec3f::filled(0.5f)));
  add_past_of_born(scene, schedule, 2 * frame_time, positions);
  EXPECT_EQ(positions[2][0], Vec3f::filled(0.5f));
  EXPECT_NEAR(positions[1][0][0], 0.5 + (frame_time - 0.025), 1e-6);
  EXPECT_NEAR(positions[0][0][1], 0.5 + gravity * 0.025 * 0.025 / 2, 1e-6);
  EXPECT_EQ(positions[0][1], Vec3f::filled(0.5f));
}

}  // namespace
}  // namespace graupel::graph
