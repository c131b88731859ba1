// The GPU's step of a model of the deformation alone by modes against the CPU's: its kernels run here with fibers for
// threads, and, where there is a GPU, on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "rom/cuda/reduced_cuda.h"
#include "tests/gpu_only.h"
#include "tests/rom/fiber_run.h"
#include "tests/rom/mode_model.h"

namespace graupel::rom {
namespace {

using test::mode_model;
using test::two_laws_scene;
using Run = device::DeviceRunOn<device::FiberBackend>;

constexpr int frames = 6, steps_of_frame = 4;

mpm::PreparedScene prepare(const Scene& scene) { return {scene, {.seed = scene.seed}}; }

/// The kernels with fibers, one instance a scene.
std::unique_ptr<Run> fiber_run(const ReducedModel& model, const std::vector<Scene>& scenes) {
  std::vector<device::InstanceTable> tables;
  for (const Scene& scene : scenes) {
    const mpm::PreparedScene prepared = prepare(scene);
    tables.push_back(device::instance_table(model, prepared, start_of_run(model, prepared.particles, {})));
  }
  const std::vector<int32_t> samples = samples_of_run(model, {}, prepare(scenes.front()).particles);
  device::RunSettings settings;
  settings.steps_per_frame = steps_of_frame;
  settings.dt = model.frame_time / steps_of_frame;
  settings.contact_weight = model.contact_weight;
  return std::make_unique<Run>(device::model_table(model, samples), std::move(tables), settings);
}

/// Largest distance of the latents.
double difference(const LatentState& a, const double* b) {
  double worst = 0;
  for (std::size_t j = 0; j < a.latent.size(); ++j) worst = std::max(worst, std::abs(a.latent[j] - b[j]));
  return worst;
}

const char* const still_obstacle =
    R"(, "obstacles": [ { "shape": "sphere", "radius": 0.05, "position": [0.615, 0.48, 0.5], "friction": 0.3 } ])";
const char* const poking_obstacle =
    R"(, "obstacles": [ { "shape": "box", "size": [0.08, 0.1, 0.3], "position": [0.6237, 0.5031, 0.5017],
         "motion": { "velocity": [-0.571, 0, 0], "spin": 1 } },
         { "shape": "sphere", "radius": 0.03, "position": [0.4713, 0.3627, 0.5017] } ])";
const char* const held_top =
    R"(, "kinematic_regions": [ { "shape": "box", "size": [0.2, 0.04, 0.2], "position": [0.5, 0.6, 0.5],
         "motion": { "velocity": [0.3, 0.1, 0], "spin": 0.5, "end_time": 0.04 } } ])";
const char* const scenes[] = {"", still_obstacle, poking_obstacle, held_top};

struct Case {
  const char* more;
  ProjectionKind projection;
};
bool has_obstacles(const Case& of) { return of.more == still_obstacle || of.more == poking_obstacle; }

class ElasticDeviceStep : public testing::TestWithParam<Case> {};
const auto cases =
    testing::Values(Case{scenes[0], ProjectionKind::velocity}, Case{scenes[1], ProjectionKind::position_velocity},
                    Case{scenes[2], ProjectionKind::position_velocity}, Case{scenes[2], ProjectionKind::velocity},
                    Case{scenes[3], ProjectionKind::position_velocity});
INSTANTIATE_TEST_SUITE_P(Scenes, ElasticDeviceStep, cases);

/// Largest distances of the CPU's frame from one of the kernels, [particles, 6].
struct FrameDifference {
  double position = 0, velocity = 0;  ///< [m], [m/s]

  FrameDifference(const ParticleFrame& a, const std::vector<float>& b) {
    for (std::size_t p = 0; p < a.position.size(); ++p)
      for (int d = 0; d < 3; ++d) {
        const auto at = 6 * p + static_cast<std::size_t>(d);
        position = std::max(position, std::abs(static_cast<double>(b[at] - a.position[p][d])));
        velocity = std::max(velocity, std::abs(static_cast<double>(b[at + 3] - a.velocity[p][d])));
      }
  }
};

/// The CPU in double precision is the truth, but for contact, whose nodes and samples are others in double precision.
template <typename T>
void expect_step_of_the_cpu(const Case& of, double latent, double position, double velocity) {
  const Scene scene = two_laws_scene(of.more);
  ReducedModel model = mode_model(scene);
  model.projection = of.projection;
  ReducedSolver<T> cpu(model, prepare(scene), {}, {});
  const auto run = fiber_run(model, {scene});
  for (int f = 0; f < frames; ++f) {
    cpu.advance_frame();
    run->advance_frame();
    ASSERT_EQ(run->state(0).status, device::RunStatus::running);
    EXPECT_NEAR(run->state(0).residual, cpu.trust().residual, 1e-3 * cpu.trust().residual + 1e-4);
    EXPECT_EQ(run->state(0).down_weighted, 0);
  }
  EXPECT_EQ(run->state(0).steps, frames * steps_of_frame);
  EXPECT_LT(difference(cpu.state(), run->state(0).latent), latent);
  EXPECT_NEAR(run->state(0).condition, cpu.statistics().largest_condition, 1e-3 * run->state(0).condition);
  const FrameDifference frame(cpu.frame(), run->frame(0));
  EXPECT_LT(frame.position, position);
  EXPECT_LT(frame.velocity, velocity);
}

TEST_P(ElasticDeviceStep, IsTheStepOfTheCpu) {
  if (has_obstacles(GetParam()))
    expect_step_of_the_cpu<float>(GetParam(), 2e-4, 2e-5, 3e-3);
  else {
    expect_step_of_the_cpu<double>(GetParam(), 2e-6, 3e-7, 1e-5);
    expect_step_of_the_cpu<float>(GetParam(), 1e-5, 1e-6, 5e-5);
  }
}

TEST(ElasticDeviceRun, SamplesInContactWeighAsTheModelSays) {
  const Scene scene = two_laws_scene(poking_obstacle);
  ReducedModel model = mode_model(scene), even = model;
  even.contact_weight = 1;
  const auto run = fiber_run(even, {scene});
  ReducedSolver<float> cpu(even, prepare(scene), {}, {}), weighed(model, prepare(scene), {}, {});
  for (int f = 0; f < frames; ++f) {
    run->advance_frame();
    cpu.advance_frame();
    weighed.advance_frame();
  }
  EXPECT_LT(difference(cpu.state(), run->state(0).latent), 2e-4);
  EXPECT_GT(difference(weighed.state(), run->state(0).latent), 1e-3);
}

TEST(ElasticDeviceRun, InstancesMoveAsTheyDoAlone) {
  std::vector<Scene> three = {two_laws_scene(poking_obstacle), two_laws_scene(still_obstacle), two_laws_scene()};
  three[2].gravity = {3, -9.8, 0};
  const ReducedModel model = mode_model(three[0]);
  const auto together = fiber_run(model, three);
  together->advance_frame();
  for (int i = 0; i < 3; ++i) {
    const auto alone = fiber_run(model, {three[static_cast<std::size_t>(i)]});
    alone->advance_frame();
    for (int j = 0; j < model.latents(); ++j)
      EXPECT_NEAR(together->state(i).latent[j], alone->state(0).latent[j], 1e-6) << i;
  }
  EXPECT_GT(std::abs(together->state(0).latent[0] - together->state(2).latent[0]), 1e-4);
}

/// Symplectic Euler: after n steps v = g n dt, x = g dt^2 n (n + 1) / 2, from the start's velocity on.
TEST(ElasticDeviceRun, ABodyInTheAirFallsFreely) {
  const Scene scene = two_laws_scene();
  const ReducedModel model = mode_model(scene, 12, 3);  // translations by 0.1 m
  const auto run = fiber_run(model, {scene});
  run->advance_frame();
  const double n = steps_of_frame, dt = model.frame_time / n;
  const double velocity[3] = {0.5, -0.3, 0}, gravity[3] = {0, -4, 0};
  for (std::size_t d = 0; d < 3; ++d) {
    const double way = velocity[d] * n * dt + gravity[d] * dt * dt * n * (n + 1) / 2;
    EXPECT_NEAR(0.1 * (run->state(0).latent[d] - model.start_latent[d]), way, 1e-7);
    EXPECT_NEAR(0.1 * run->state(0).velocity[d], velocity[d] + gravity[d] * n * dt, 1e-5);
  }
}

/// Timed alone, kernels go beyond the steps of a frame and find points again and again.
TEST(ElasticDeviceRun, TimesItsKernels) {
  const Scene scene = two_laws_scene(poking_obstacle);
  const auto run = fiber_run(mode_model(scene), {scene});
  const std::vector<device::KernelTime> times = run->kernel_times(steps_of_frame);
  ASSERT_EQ(times.size(), 3u);
  EXPECT_STREQ(times[1].name, "decode");
  EXPECT_GT(run->view().instances[0].state->step, steps_of_frame);
}

/// A bar with samples at one end: points elsewhere take no part, before and after it has moved by cells.
TEST(ElasticDeviceRun, TakesThePointsThatReachSamples) {
  const Scene scene = two_laws_scene("", "0.64");
  ReducedModel model = mode_model(scene);
  model.samples.clear();
  for (std::size_t p = 0; 3 * p < model.reference.size() && model.samples.size() < 24; p += 3)
    if (model.reference[3 * p] < 0.26f) model.samples.push_back(static_cast<int32_t>(p));
  ReducedSolver<double> cpu(model, prepare(scene), {}, {});
  const auto run = fiber_run(model, {scene});
  for (int f = 0; f < frames; ++f) {
    cpu.advance_frame();
    run->advance_frame();
  }
  const device::InstanceState& state = run->state(0);
  EXPECT_GT(state.round, 1);
  EXPECT_GT(state.point_count, 100);
  EXPECT_LT(state.point_count, run->view().model.points / 2);
  EXPECT_LT(state.group_count, run->view().model.point_groups() / 2 + 1);
  EXPECT_EQ(state.status, device::RunStatus::running);
  EXPECT_LT(difference(cpu.state(), state.latent), 2e-6);
}

/// Ways of samples with given weights, projected by the CPU and by the kernel.
TEST(ElasticDeviceFit, IsTheProjectionOfTheCpu) {
  const Scene scene = two_laws_scene();
  const ReducedModel model = mode_model(scene, 4);
  const auto field = model.fields->bind_samples(model.samples);
  const Random random(8, RandomPurpose::test);
  for (const bool even : {true, false}) {
    const auto run = fiber_run(model, {scene});
    run->begin_frame();
    const device::InstanceView& instance = run->view().instances[0];
    const device::ModelView& table = run->view().model;
    device::WaySums& ways = *instance.ways;
    const double dt = run->view().dt;
    LatentState state = start_of_run(model, prepare(scene).particles, {});
    SampleMotion motion;
    field->evaluate(state.latent.data(), motion.before);
    motion.after = motion.before;
    for (int s = 0; s < table.samples; ++s) {
      const double weight = even ? 1 : s % 9 == 4 ? 0 : s % 3 == 1 ? 4.25 : 1;
      motion.weight.push_back(weight);
      instance.lost[s] = weight == 0 ? 1 : 0;
      ways.lost += instance.lost[s];
      ways.weight += weight;
      instance.weight[s] = static_cast<float>(weight);
      if (weight != 1) instance.weighed[ways.weighed++] = s;
      for (int d = 0; d < 3; ++d) {
        const double way = (d == 0 ? 2e-3 : 5e-4) + 1e-4 * random.uniform(static_cast<uint64_t>(3 * s + d), 0, -1, 1);
        motion.after[3 * s + d] += way;
        ways.moved2 += way * way;
        ways.weighted2 += weight * way * way;
        for (int k = 0; k < table.latents; ++k)
          ways.projection[k] +=
              weight * way * static_cast<double>(table.sample_modes[k * table.sample_rows + 3 * s + d]);
      }
    }
    const double moved = std::sqrt(ways.moved2 / table.samples);
    run->backend().project(run->view());
    const device::InstanceState& found = *instance.state;
    ASSERT_EQ(found.status, device::RunStatus::running);
    const FitReport report = project(ProjectionKind::position_velocity, *field, motion, dt, 20, state);
    for (std::size_t j = 0; j < state.latent.size(); ++j) {
      EXPECT_NEAR(found.latent[j], state.latent[j], 5e-8);
      EXPECT_NEAR(found.velocity[j], state.velocity[j], 5e-8 / dt);
      EXPECT_EQ(instance.rate[j], found.velocity[j]);
    }
    EXPECT_NEAR(found.condition, report.condition, 1e-4 * report.condition);
    EXPECT_NEAR(found.residual, report.distance / moved, 1e-4 * found.residual);
    EXPECT_NEAR(found.down_weighted, report.down_weighted, 1e-12);
    EXPECT_EQ(found.down_weighted > 0, !even);
    EXPECT_EQ(ways.weighed + ways.lost, 0) << "cleared for the next step";
  }
}

TEST(ElasticDeviceFit, StopsWhenMostSamplesAreLost) {
  const Scene scene = two_laws_scene();
  const ReducedModel model = mode_model(scene);
  const auto run = fiber_run(model, {scene});
  const device::InstanceView& instance = run->view().instances[0];
  instance.ways->lost = run->view().model.samples;
  const double before = instance.state->latent[0];
  run->backend().project(run->view());
  EXPECT_EQ(instance.state->status, device::RunStatus::samples_lost);
  run->advance_frame();  // nothing moves any more
  EXPECT_EQ(run->state(0).latent[0], before);
  EXPECT_EQ(run->state(0).steps, 0);
}

/// The text of the error, or "" where none is thrown.
template <typename Body>
std::string refusal(const Body& body) {
  try {
    body();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(ElasticDeviceTables, RefuseByNameWhatNoKernelKnows) {
  const Scene scene = two_laws_scene();
  const ReducedModel model = mode_model(scene);
  for (const ProjectionKind kind :
       {ProjectionKind::position, ProjectionKind::position_velocity, ProjectionKind::velocity}) {
    ReducedOptions options;
    options.projection = kind;
    options.iterations = 20;
    EXPECT_EQ(refusal([&] { device::check_options(model, options); }), "") << word_of(kind);
  }
  const auto option_is_refused = [&](const ReducedModel& of, const ReducedOptions& options, const char* name) {
    const std::string text = refusal([&] { device::check_options(of, options); });
    EXPECT_NE(text.find(name), std::string::npos) << text;
    EXPECT_NE(text.find("--device cpu"), std::string::npos) << text;
  };
  ReducedOptions eulerian, pulled;
  eulerian.quadrature = QuadratureKind::eulerian;
  pulled.manifold_pull = 0.1;
  ReducedModel integrated = model;
  integrated.gradient = GradientKind::integrated;
  option_is_refused(model, eulerian, "quadrature");
  option_is_refused(model, pulled, "manifold_pull");
  option_is_refused(integrated, {}, "gradient integrated");
  Scene pushed = scene, swayed = scene;
  pushed.loads.resize(1);
  swayed.gravity_keyframes.resize(1);
  EXPECT_EQ(refusal([&] { device::check_scene(scene); }), "");
  EXPECT_NE(refusal([&] { device::check_scene(pushed); }).find("loads"), std::string::npos);
  EXPECT_NE(refusal([&] { device::check_scene(swayed); }).find("gravity that changes"), std::string::npos);
  const ReducedModel large = mode_model(scene, 1, device::most_latents + 1);
  EXPECT_NE(refusal([&] { device::model_table(large, large.samples); }).find("33 latents"), std::string::npos);
  const ReducedModel network =
      test::deformation_model(scene, test::linear_network(test::translation()), std::vector<double>{0, 0, 0});
  EXPECT_NE(refusal([&] { device::model_table(network, network.samples); }).find("map=modes"), std::string::npos);
}

class CudaCromStep : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Scenes, CudaCromStep, cases);

template <typename T>
void expect_step_on_the_gpu(const Case& of, double latent, double position, double velocity) {
  const Scene scene = two_laws_scene(of.more);
  ReducedModel model = mode_model(scene);
  model.projection = of.projection;
  ReducedSolver<T> cpu(model, prepare(scene), {}, {});
  ReducedDeviceSolver gpu(model, {{prepare(scene), {}}}, {});
  for (int f = 0; f < frames; ++f) {
    cpu.advance_frame();
    gpu.advance_frame();
    ASSERT_FALSE(gpu.divergence(0)) << *gpu.divergence(0);
    EXPECT_NEAR(gpu.trust(0).residual, cpu.trust().residual, 1e-2 * cpu.trust().residual + 1e-4);
    EXPECT_NEAR(gpu.trust(0).latent_distance, cpu.trust().latent_distance, 1e-3);
  }
  EXPECT_EQ(gpu.statistics(0).timing.steps, frames * steps_of_frame);
  EXPECT_LT(difference(cpu.state(), gpu.state(0).latent.data()), latent);
  const ParticleFrame truth = cpu.frame(), frame = gpu.frame(0);
  ASSERT_EQ(frame.position.size(), truth.position.size());
  for (std::size_t p = 0; p < truth.position.size(); ++p) {
    EXPECT_LT(norm(frame.position[p] - truth.position[p]), position);
    EXPECT_LT(norm(frame.velocity[p] - truth.velocity[p]), velocity);
  }
}

TEST_P(CudaCromStep, IsTheStepOfTheCpuOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  if (has_obstacles(GetParam()))
    expect_step_on_the_gpu<float>(GetParam(), 1e-3, 1e-4, 2e-2);
  else
    expect_step_on_the_gpu<double>(GetParam(), 1e-5, 1e-6, 1e-4);
}

TEST(CudaCromRun, InstancesMoveAsTheyDoAlone) {
  GRAUPEL_NEEDS_GPU();
  const ReducedModel model = mode_model(two_laws_scene());
  std::vector<ReducedInstance> all;
  for (int i = 0; i < 20; ++i)
    all.push_back({prepare(two_laws_scene(i % 2 == 0 ? poking_obstacle : still_obstacle)), {}});
  ReducedDeviceSolver together(model, all, {});
  for (int f = 0; f < frames; ++f) together.advance_frame();
  for (const int i : {0, 7, 19}) {
    ReducedDeviceSolver alone(model, {all[static_cast<std::size_t>(i)]}, {});
    for (int f = 0; f < frames; ++f) alone.advance_frame();
    // Sums at nodes are of floats in any order: equal up to rounding.
    EXPECT_LT(difference(alone.state(0), together.state(i).latent.data()), 1e-5);
  }
  EXPECT_GT(difference(together.state(0), together.state(7).latent.data()), 1e-3);
}

TEST(CudaCromRun, InstancesMustHaveTheSameScriptedParticles) {
  GRAUPEL_NEEDS_GPU();
  const ReducedModel model = mode_model(two_laws_scene());
  EXPECT_NE(
      refusal([&] {
        ReducedDeviceSolver(model, {{prepare(two_laws_scene()), {}}, {prepare(two_laws_scene(held_top)), {}}}, {});
      }).find("kinematic_regions"),
      std::string::npos);
}

TEST(CudaCromRun, SaysThatThereIsNoGpu) {
  if (cuda_available()) GTEST_SKIP() << "there is a GPU here";
  const Scene scene = two_laws_scene();
  const ReducedModel model = mode_model(scene);
  EXPECT_NE(refusal([&] {
              ReducedDeviceSolver(model, {{prepare(scene), {}}}, {});
            }).find("--device cpu"),
            std::string::npos);
}

}  // namespace
}  // namespace graupel::rom
