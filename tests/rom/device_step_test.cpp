// The GPU's step of a reduced-order model against the CPU's: its kernels run here with fibers for threads, and, where
// there is a GPU, on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/system/error.h"
#include "rom/cuda/reduced_cuda.h"
#include "tests/gpu_only.h"
#include "tests/rom/fiber_run.h"
#include "tests/rom/swaying_model.h"

namespace graupel::rom {
namespace {

using test::swaying_model;
using test::swaying_scene;
using Run = device::DeviceRunOn<device::FiberBackend>;

mpm::PreparedScene prepare(const Scene& scene) { return {scene, {.seed = scene.seed}}; }

/// The kernels with fibers, one instance a parameter.
std::unique_ptr<Run> fiber_run(const ReducedModel& model, const Scene& scene, const std::vector<double>& parameters,
                               const ReducedOptions& options = {}) {
  std::vector<device::InstanceTable> tables;
  for (const double mu : parameters) {
    const ReducedSolver<float> start(model, prepare(scene), {mu}, options);
    tables.push_back(device::instance_table(model, prepare(scene), start.state()));
  }
  const auto samples = options.samples.value_or(model.samples);
  return std::make_unique<Run>(
      device::model_table(model, samples), std::move(tables),
      device::RunSettings{2, scene.frame_time / 2, options.manifold_pull.value_or(model.manifold_pull),
                          scene.frame_time / 2 / model.frame_time});
}

/// Largest distance of the latents, over the way since the start. The CPU's run is of single precision too: in double
/// precision other nodes and samples meet obstacles.
double difference(const LatentState& a, const double* b) {
  double worst = 0, way = 0;
  for (std::size_t j = 0; j < a.latent.size(); ++j) {
    worst = std::max(worst, std::abs(a.latent[j] - b[j]));
    way = std::max(way, std::abs(a.latent[j]));
  }
  return worst / way;
}

const char* const scenes[] = {
    "",
    R"(, "obstacles": [ { "shape": "sphere", "radius": 0.025, "position": [0.305, 0.13, 0.25], "friction": 0.3 } ])",
    R"(, "obstacles": [ { "shape": "box", "size": [0.05, 0.1, 0.3], "position": [0.305, 0.12, 0.25],
         "motion": { "velocity": [-0.4, 0, 0], "spin": 2 } },
         { "shape": "sphere", "radius": 0.02, "position": [0.2, 0.1, 0.25] } ])",
    R"(, "kinematic_regions": [ { "shape": "box", "size": [0.2, 0.03, 0.2], "position": [0.25, 0.19, 0.25],
         "motion": { "velocity": [0.1, 0, 0], "end_time": 1 } } ])"};

class DeviceStep : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Scenes, DeviceStep, testing::ValuesIn(scenes));

TEST_P(DeviceStep, IsTheStepOfTheCpu) {
  const Scene scene = swaying_scene(GetParam());
  const ReducedModel model = swaying_model(scene);
  ReducedSolver<float> cpu(model, prepare(scene), {33}, {});
  const auto run = fiber_run(model, scene, {33});
  {
    cpu.advance_frame();
    run->advance_frame();
    ASSERT_EQ(run->state(0).status, device::RunStatus::running);
    EXPECT_LT(difference(cpu.state(), run->state(0).latent), 5e-4);
    EXPECT_NEAR(run->state(0).residual, cpu.trust().residual, 1e-2 * cpu.trust().residual);
    EXPECT_EQ(cpu.trust().down_weighted, 0);
    EXPECT_EQ(run->state(0).down_weighted, 0);
  }
  EXPECT_EQ(run->state(0).steps, 2);
  const ParticleFrame truth = cpu.frame();
  const std::vector<float> frame = run->frame(0);
  for (std::size_t p = 0; p < truth.position.size(); ++p)
    for (std::size_t d = 0; d < 3; ++d) {
      EXPECT_NEAR(frame[6 * p + d], truth.position[p][static_cast<int>(d)], 2e-5);
      EXPECT_NEAR(frame[6 * p + 3 + d], truth.velocity[p][static_cast<int>(d)], 5e-3);
    }
}

/// The swaying model with two training runs, whose curve a run at 33 is pulled to.
ReducedModel pulled_model(const Scene& scene) {
  ReducedModel model = swaying_model(scene);
  model.manifold_pull = 0.4;
  model.training_latents.clear();
  model.training_run.clear();
  model.run_parameters = {30, 40};
  for (const int32_t run : {0, 1})
    for (int step = 0; step < 5; ++step) {
      model.training_latents.insert(model.training_latents.end(), {0.004f * step, 0.01f * run - 0.002f * step});
      model.training_run.push_back(run);
    }
  return model;
}

TEST(DeviceRun, TimesItsKernels) {
  const Scene scene = swaying_scene(scenes[2]);  // the obstacle's poses are those of one frame
  const auto run = fiber_run(swaying_model(scene), scene, {33});
  run->advance_frame();
  EXPECT_EQ(run->kernel_times(2).size(), 4u);
  EXPECT_LE(run->view().instances[0].state->step, 4 + 2);
}

TEST(DeviceRun, TakesTheSameWayBackToTheTraining) {
  const Scene scene = swaying_scene();
  const ReducedModel model = pulled_model(scene);
  ReducedModel free = model;
  free.manifold_pull = 0;
  ReducedOptions options;
  ReducedSolver<float> cpu(model, prepare(scene), {33}, options), other(free, prepare(scene), {33}, options);
  const auto run = fiber_run(model, scene, {33}, options);
  cpu.advance_frame();
  other.advance_frame();
  run->advance_frame();
  EXPECT_LT(difference(cpu.state(), run->state(0).latent), 1e-3);
  EXPECT_GT(difference(other.state(), run->state(0).latent), 0.05);
  for (int j = 0; j < 2; ++j)
    EXPECT_NEAR(run->state(0).velocity[j], cpu.state().velocity[static_cast<std::size_t>(j)],
                2e-3 * std::abs(cpu.state().velocity[0]));
}

TEST(DeviceRun, InstancesMoveAsTheyDoAlone) {
  const Scene scene = swaying_scene(scenes[1]);
  const ReducedModel model = swaying_model(scene);
  const auto alone = fiber_run(model, scene, {39});
  alone->advance_frame();
  for (const std::vector<double>& parameters : {std::vector<double>{31, 39}, {31, 39, 33, 36}}) {  // few and many
    const auto together = fiber_run(model, scene, parameters);
    together->advance_frame();
    EXPECT_EQ(device::has_many_instances(together->view()), parameters.size() == 4);
    for (int j = 0; j < 2; ++j) EXPECT_EQ(together->state(1).latent[j], alone->state(0).latent[j]);
    EXPECT_NE(together->state(0).latent[0], together->state(1).latent[0]);
  }
}

TEST(DeviceRun, FindsThePointsThatReachSamples) {
  const Scene scene = swaying_scene("", "[0.04, 0.06, 0.2]");
  const ReducedModel model = swaying_model(scene);
  ReducedOptions options;
  options.samples = {5};  // few points reach one sample
  const auto run = fiber_run(model, scene, {33}, options);
  const mpm::PreparedScene prepared = prepare(scene);
  // At the start all particles are where the scene has them, but for rounding and the closure.
  const auto positions = model.fields->bind_positions_f64(model.clusters.representatives());
  const ReducedSolver<float> start(model, prepared, {33}, options);
  const std::vector<int32_t> all = model.clusters.representatives();
  std::vector<double> x(3 * static_cast<std::size_t>(mpm::padded_to_tile(static_cast<int64_t>(all.size()))));
  positions->decode(start.state(), x.data());
  const auto grid = mpm::grid_of<double>(scene.domain);
  const ParticleFrame first = start.frame();
  // The sample marks the blocks of its stencil with a node more on every side.
  const Vec<int, 3> base = mpm::base_node(grid.local(first.position[5].cast<double>()));
  const auto marked = [&](const Vec<int, 3>& from, const Vec<int, 3>& to) {  // two boxes of nodes share a block
    bool shared = true;
    for (int d = 0; d < 3; ++d)
      shared = shared && from[d] / mpm::block_width <= (base[d] + 3) / mpm::block_width &&
               to[d] / mpm::block_width >= (base[d] - 1) / mpm::block_width;
    return shared;
  };
  std::set<int32_t> expected;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Vec<int, 3> b = mpm::base_node(grid.local(mpm::TiledView<double, 3>{x.data()}.vec(static_cast<int64_t>(i))));
    if (marked(b, b + Vec<int, 3>{2, 2, 2})) expected.insert(all[i]);
  }
  run->begin_frame();
  run->backend().branch(run->view());
  run->backend().decode(run->view());
  const device::InstanceView& instance = run->view().instances[0];
  std::set<int32_t> found;
  for (int32_t i = 0; i < run->view().model.points; ++i)
    if (instance.point_taken[i] != 0) found.insert(run->view().model.point_particle[i]);
  EXPECT_EQ(static_cast<int32_t>(found.size()), instance.state->point_count);
  EXPECT_EQ(found, expected);
  EXPECT_GT(found.size(), 3u);
  int32_t blocks = 1;
  for (int d = 0; d < 3; ++d) blocks *= (base[d] + 3) / mpm::block_width - (base[d] - 1) / mpm::block_width + 1;
  EXPECT_EQ(instance.state->block_count, blocks);
  EXPECT_LT(found.size(), all.size());
}

/// Ways that samples have gone, projected into the arrays of a run. Gauss-Newton of the CPU and of the kernels go on
/// from there.
struct TwoFits {
  TwoFits(const ReducedModel& model, int lost_every) {
    const Scene scene = swaying_scene();
    run = fiber_run(model, scene, {33});
    run->begin_frame();
    run->backend().branch(run->view());
    const device::InstanceView& instance = run->view().instances[0];
    const auto field = model.fields->bind_samples(model.samples);
    const int samples = field->samples();
    const double dt = run->view().dt;
    Eigen::VectorXd before, target(3 * samples);
    latent.resize(2);
    start.resize(2);
    for (int j = 0; j < 2; ++j) {
      start[j] = instance.state->latent[j];
      latent[j] = start[j] + dt * instance.state->velocity[j];
    }
    field->evaluate(start.data(), before);
    const Random random(8, RandomPurpose::test);
    std::vector<double> weight(static_cast<std::size_t>(samples), 1);
    for (int s = 0; s < samples; ++s) {
      const bool is_lost = lost_every > 0 && s % lost_every == 4;
      weight[static_cast<std::size_t>(s)] = is_lost ? 0 : 1;
      instance.lost[s] = is_lost ? 1 : 0;
      for (int d = 0; d < 3; ++d) {
        const double noise = random.uniform(static_cast<uint64_t>(3 * s + d), 0, -1, 1);
        const double way = (d == 0 ? 2e-3 : 5e-4) + 1e-4 * noise;
        target[3 * s + d] = before[3 * s + d] + way;
        if (!is_lost) add_way(3 * s + d, way);
      }
      instance.ways->lost += is_lost ? 1 : 0;
    }
    run->backend().solve_equations(run->view());
    report = fit_latent(*field, target, weight, {.iterations = 1}, latent);
    run->backend().fit(run->view());
  }
  void add_way(int row, double way) {
    const device::ModelView& table = run->view().model;
    device::WaySums& ways = *run->view().instances[0].ways;
    for (int k = 0; k < table.deformation_modes; ++k)
      ways.projection[k] += static_cast<double>(table.sample_modes[k * table.sample_rows + row]) * way;
    ways.moved2 += way * way;
  }
  const device::InstanceState& state() const { return *run->view().instances[0].state; }
  /// Distance of the two solutions over the way.
  double difference() const {
    double sum = 0;
    for (int j = 0; j < 2; ++j) sum += std::pow(state().latent[j] - latent[j], 2);
    return std::sqrt(sum) / (latent - start).norm();
  }

  std::unique_ptr<Run> run;
  Eigen::VectorXd start, latent;
  FitReport report;
};

TEST(DeviceFit, IsTheFirstStepOfGaussNewtonOfTheCpu) {
  const ReducedModel model = swaying_model(swaying_scene());
  for (const int lost_every : {0, 9}) {
    const TwoFits fits(model, lost_every);
    ASSERT_EQ(fits.state().status, device::RunStatus::running);
    EXPECT_LT(fits.difference(), 1e-5);
    EXPECT_NEAR(fits.state().condition, fits.report.condition, 1e-3 * fits.report.condition);
    EXPECT_NEAR(fits.state().down_weighted, fits.report.down_weighted, 1e-12);
    EXPECT_EQ(fits.state().down_weighted > 0, lost_every > 0);
    for (int j = 0; j < 2; ++j)
      EXPECT_NEAR(fits.state().velocity[j] * fits.run->view().dt, fits.state().latent[j] - fits.start[j], 1e-12);
  }
}

TEST(DeviceFit, StopsWhenMostSamplesAreLost) {
  const Scene scene = swaying_scene();
  const ReducedModel model = swaying_model(scene);
  const auto run = fiber_run(model, scene, {33});
  const device::InstanceView& instance = run->view().instances[0];
  instance.ways->lost = run->view().model.samples;
  const double before = instance.state->latent[0];
  run->backend().fit(run->view());
  EXPECT_EQ(instance.state->status, device::RunStatus::samples_lost);
  run->advance_frame();  // nothing moves any more
  EXPECT_EQ(run->state(0).latent[0], before);
  EXPECT_EQ(run->state(0).steps, 0);
}

TEST(DeviceHalf, IsTheStoredHalf) {
  for (const float value : {0.0f, 1.0f, -1.0f, 0.333f, -65504.0f, 6e-8f, 5.5e-5f, 1e-3f}) {
    const uint16_t bits = nn::f16_from_float(value);
    EXPECT_EQ(device::float_of_half(bits), nn::float_from_f16(bits)) << value;
  }
}

TEST(DeviceTables, RefuseWhatNoKernelKnows) {
  const ReducedModel model = swaying_model(swaying_scene());
  EXPECT_NO_THROW(device::check_options(model, {}));
  ReducedOptions options;
  options.iterations = 1;
  EXPECT_NO_THROW(device::check_options(model, options));
  options.iterations = 2;
  EXPECT_THROW(device::check_options(model, options), ConfigError);
  ReducedOptions pulled;
  pulled.manifold_pull = 0.1;
  EXPECT_NO_THROW(device::check_options(pulled_model(swaying_scene()), pulled));
  EXPECT_THROW(device::check_options(model, pulled), ConfigError);  // it knows no runs
  EXPECT_THROW(device::check_scene(swaying_scene(R"(, "transfer": { "spline": "cubic" })")), ConfigError);
  EXPECT_NO_THROW(device::check_scene(swaying_scene()));
}

TEST(ReducedCuda, SaysThatThereIsNoGpu) {
  if (cuda_available()) GTEST_SKIP() << "there is a GPU here";
  const Scene scene = swaying_scene();
  const ReducedModel model = swaying_model(scene);
  EXPECT_THROW(ReducedDeviceSolver(model, {{prepare(scene), {33}}}, {}), ConfigError);
}

class ReducedCudaStep : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Scenes, ReducedCudaStep, testing::ValuesIn(scenes));

TEST_P(ReducedCudaStep, IsTheStepOfTheCpuOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const Scene scene = swaying_scene(GetParam());
  const ReducedModel model = swaying_model(scene);
  ReducedSolver<float> cpu(model, prepare(scene), {33}, {});
  ReducedDeviceSolver gpu(model, {{prepare(scene), {33}}}, {});
  {
    cpu.advance_frame();
    gpu.advance_frame();
    ASSERT_FALSE(gpu.divergence(0)) << *gpu.divergence(0);
    EXPECT_LT(difference(cpu.state(), gpu.state(0).latent.data()), 5e-4);
    EXPECT_NEAR(gpu.trust(0).residual, cpu.trust().residual, 1e-2 * cpu.trust().residual);
    EXPECT_NEAR(gpu.trust(0).latent_distance, cpu.trust().latent_distance, 1e-3);
  }
  const ParticleFrame truth = cpu.frame(), frame = gpu.frame(0);
  ASSERT_EQ(frame.position.size(), truth.position.size());
  for (std::size_t p = 0; p < truth.position.size(); ++p) {
    EXPECT_LT(norm(frame.position[p] - truth.position[p]), 2e-5);
    EXPECT_LT(norm(frame.velocity[p] - truth.velocity[p]), 5e-3);
  }
  EXPECT_EQ(gpu.statistics(0).timing.steps, 2);
}

TEST(ReducedCuda, InstancesMoveAsTheyDoAlone) {
  GRAUPEL_NEEDS_GPU();
  const Scene scene = swaying_scene(scenes[2]);
  const ReducedModel model = swaying_model(scene);
  std::vector<ReducedInstance> all;
  for (int i = 0; i < 20; ++i) all.push_back({prepare(scene), {30.0 + i}});
  ReducedDeviceSolver together(model, all, {});
  together.advance_frame();
  for (const int i : {0, 7, 19}) {
    ReducedDeviceSolver alone(model, {all[static_cast<std::size_t>(i)]}, {});
    alone.advance_frame();
    // Sums at nodes are of floats in any order: equal up to rounding.
    EXPECT_LT(difference(alone.state(0), together.state(i).latent.data()), 2e-5);
  }
  EXPECT_GT(difference(together.state(0), together.state(19).latent.data()), 1e-4);
}

}  // namespace
}  // namespace graupel::rom
