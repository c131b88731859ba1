// Samples that change with time: when they do, what stays the same, and what is refused.
#include <gtest/gtest.h>

#include "core/error.h"
#include "rom/cuda/device_tables.h"
#include "rom/reduced_solver.h"
#include "tests/rom/swaying_model.h"

namespace graupel::rom {
namespace {

using test::swaying_model;
using test::swaying_scene;

constexpr double dt = 0.001;  ///< [s]

std::vector<int32_t> every(const ReducedModel& model, int32_t nth) {
  std::vector<int32_t> samples;
  for (int32_t p = 1; p < static_cast<int32_t>(model.fields->particles()); p += nth) samples.push_back(p);
  return samples;
}

template <typename T>
ReducedSolver<T> solver_of(const ReducedModel& model, const ReducedOptions& options = {}) {
  const Scene scene = swaying_scene();
  return {model, mpm::PreparedScene(scene, {.seed = scene.seed}), {33}, options};
}

TEST(SampleWindows, BeginAtTheFirstStepAtOrAfterTheirTime) {
  const ReducedModel fixed = swaying_model(swaying_scene());
  ReducedModel model = fixed;
  const auto first = static_cast<int64_t>(model.samples.size());
  model.later_samples = {{1.5 * dt, every(model, 4)}, {4 * dt, every(model, 9)}};
  const auto second = static_cast<int64_t>(every(model, 4).size()),
             third = static_cast<int64_t>(every(model, 9).size());
  auto solver = solver_of<float>(model), reference = solver_of<float>(fixed);
  // Steps begin at 0, 1, 2, 3, 4 dt.
  const int64_t expected[] = {first, first, second, second, third};
  for (int i = 0; i < 5; ++i) {
    solver.step(dt);
    reference.step(dt);
    EXPECT_EQ(solver.statistics().samples, expected[i]) << "step " << i;
    if (i < 2)
      EXPECT_EQ(solver.state().latent, reference.state().latent);
    else
      EXPECT_NE(solver.state().latent, reference.state().latent);
  }
}

TEST(SampleWindows, StepsAfterTheChangeAreThoseOfTheNewSamplesAlone) {
  ReducedModel fixed = swaying_model(swaying_scene());
  ReducedModel model = fixed;
  model.later_samples = {{1e-12, every(model, 4)}};  // due at the first step, within rounding of its time
  fixed.samples = every(model, 4);
  auto solver = solver_of<float>(model), reference = solver_of<float>(fixed);
  for (int i = 0; i < 3; ++i) {
    solver.step(dt);
    reference.step(dt);
    EXPECT_EQ(solver.state().latent, reference.state().latent);
    EXPECT_EQ(solver.statistics().mean_integration, reference.statistics().mean_integration);
  }
}

TEST(SampleWindows, OfTheSameSamplesChangeNothing) {
  const ReducedModel fixed = swaying_model(swaying_scene());
  ReducedModel model = fixed;
  model.later_samples = {{2 * dt, model.samples}};
  auto solver = solver_of<float>(model), reference = solver_of<float>(fixed);
  for (int i = 0; i < 4; ++i) {
    solver.step(dt);
    reference.step(dt);
    EXPECT_EQ(solver.state().latent, reference.state().latent);
    EXPECT_EQ(solver.state().velocity, reference.state().velocity);
  }
}

TEST(SampleWindows, GiveWayToSamplesOfTheOptions) {
  ReducedModel model = swaying_model(swaying_scene());
  model.later_samples = {{dt, every(model, 9)}};
  ReducedOptions options;
  options.samples = every(model, 4);
  auto solver = solver_of<float>(model, options);
  for (int i = 0; i < 3; ++i) solver.step(dt);
  EXPECT_EQ(solver.statistics().samples, static_cast<int64_t>(options.samples->size()));
  EXPECT_NO_THROW(device::check_options(model, options));
}

TEST(SampleWindows, AreStoredAndRefusedWhenDamaged) {
  ReducedModel model = swaying_model(swaying_scene());
  EXPECT_TRUE(ReducedModel::load(model.store(nn::DType::f32)).later_samples.empty());
  model.later_samples = {{0.25, every(model, 4)}, {0.5, every(model, 9)}};
  const ReducedModel stored = ReducedModel::load(model.store(nn::DType::f32));
  ASSERT_EQ(stored.later_samples.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(stored.later_samples[i].time, model.later_samples[i].time);
    EXPECT_EQ(stored.later_samples[i].samples, model.later_samples[i].samples);
  }
  const auto refused = [&](double time, std::vector<int32_t> samples) {
    ReducedModel bad = model;
    bad.later_samples[1] = {time, std::move(samples)};
    EXPECT_THROW(ReducedModel::load(bad.store(nn::DType::f32)), InputError);
  };
  refused(0.25, every(model, 9));
  refused(0.5, {});
  refused(0.5, {static_cast<int32_t>(model.fields->particles())});
}

TEST(SampleWindows, AreRefusedOnTheGpuByName) {
  ReducedModel model = swaying_model(swaying_scene());
  EXPECT_NO_THROW(device::check_options(model, {}));
  model.later_samples = {{0.25, model.samples}};
  try {
    device::check_options(model, {});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("sample_windows"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace graupel::rom
