// Evaluations of whole runs: every key with a finite value, known answers, and the documented list of metrics.
#include "compare/metrics/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>
#include <set>

#include "compare/comparison.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/compare/synthetic_run.h"

namespace graupel::compare {
namespace {

Vec3f fall(const Vec3f& x, std::size_t f) {
  const float t = static_cast<float>(f) / 60;
  return {x[0], x[1] - 0.5f * 9.8f * t * t, x[2]};
}

ParticleRun falling_blocks(std::size_t frames) {
  auto points = block(6, {0.2f, 0.6f, 0.2f}, 0.15f);
  const auto second = block(6, {0.6f, 0.6f, 0.6f}, 0.15f);
  std::vector<int32_t> type(points.size(), 5);
  type.insert(type.end(), second.size(), 6);
  points.insert(points.end(), second.begin(), second.end());
  return make_run(points, type, frames, fall);
}

TEST(Evaluation, ARunAgainstItselfHasNoError) {
  const Scene scene = scene_with_sphere();
  const sparsegrid::ObstacleSet obstacles(scene);
  const auto truth = falling_blocks(8);
  const auto e = evaluate_rollout(scene, obstacles, truth, truth);
  EXPECT_TRUE(missing_metrics(metric_list(), {MetricGroup::rollout}, e.values).empty());
  for (const char* key :
       {"position_mse_20", "position_mse_all", "delta", "displacement_relative_error", "sinkhorn", "density_error",
        "kinetic_energy_error", "center_of_mass_error", "front_error", "clump_size_error", "local_density_error"})
    EXPECT_EQ(e.values.at(key), 0) << key;
  EXPECT_EQ(e.values.at("occupancy_iou"), 1);
  ASSERT_EQ(e.materials.size(), 2u);
  EXPECT_EQ(e.materials.at("water").at("particles"), 216);
  EXPECT_TRUE(missing_metrics(material_metric_list(), {MetricGroup::rollout}, e.materials.at("sand")).empty());
  EXPECT_EQ(e.curves.density.size(), 8u);
}

TEST(Evaluation, ASidewaysShiftShowsInEveryMetric) {
  const Scene scene = unit_scene();
  const sparsegrid::ObstacleSet obstacles;
  const auto truth = falling_blocks(10);
  auto shifted = truth;
  const float d = 0.1f;
  for (std::size_t f = 1; f <= 10; ++f)
    for (Vec3f& x : shifted.trajectory.frames[f].position) x[0] += d;
  const auto e = evaluate_rollout(scene, obstacles, truth, shifted);
  EXPECT_NEAR(e.values.at("position_mse_all"), d * d, 1e-6);
  EXPECT_NEAR(e.values.at("center_of_mass_error"), d, 1e-5);
  EXPECT_NEAR(e.values.at("sinkhorn"), d * d, 0.15 * d * d);  // cells of bins cut the two clouds differently
  EXPECT_GT(e.values.at("density_error"), 0.5);
  EXPECT_LT(e.values.at("occupancy_iou"), 0.9);
  EXPECT_GT(e.values.at("front_error"), 0.02);
}

TEST(Evaluation, RunsOfOtherParticlesAreComparedByMassAlone) {
  const Scene scene = unit_scene();
  const sparsegrid::ObstacleSet obstacles;
  const auto fine = block(8, {0.3f, 0.5f, 0.3f}, 0.25f), coarse = block(4, {0.3f, 0.5f, 0.3f}, 0.25f);
  const auto truth = make_run(fine, std::vector<int32_t>(fine.size(), 8), 6, fall);
  auto run = make_run(coarse, std::vector<int32_t>(coarse.size(), 8), 6, fall);
  for (auto& m : run.mass) m *= 8;
  for (auto& v : run.volume) v *= 8;
  const auto e = evaluate_rollout(scene, obstacles, truth, run);
  EXPECT_FALSE(e.values.contains("position_mse_all"));
  EXPECT_FALSE(e.materials.begin()->second.contains("position_mse_all"));
  EXPECT_NEAR(e.values.at("center_of_mass_error"), 0, 1e-6);
  EXPECT_NEAR(e.values.at("kinetic_energy_error"), 0, 1e-6);
  EXPECT_LT(e.values.at("density_error"), 0.3);
}

TEST(Evaluation, RefusesRunsWithoutAMaterialOfTheTruth) {
  const auto both = falling_blocks(1);
  ParticleRun water = both;
  std::fill(water.trajectory.particle_type.begin(), water.trajectory.particle_type.end(), 5);
  EXPECT_THROW(evaluate_rollout(unit_scene(), {}, both, water), InputError);
}

TEST(Evaluation, RefusesRunsWithoutPredictedFrames) {
  const Scene scene = unit_scene();
  const auto start = make_run(block(2, {0.3f, 0.3f, 0.3f}, 0.1f), std::vector<int32_t>(8, 5), 0, stay);
  EXPECT_THROW(evaluate_rollout(scene, {}, start, start), InputError);
}

TEST(Evaluation, CostAndOneStepGroupsAreComplete) {
  RunCost cost;
  cost.frame = 0.02;
  MetricValues values = cost_values(cost, 7, 0.05);
  EXPECT_NEAR(values.at("speed_ratio"), 2.5, 1e-12);
  EXPECT_NEAR(values.at("frame_ms"), 20, 1e-12);
  values["loses_to_coarse"] = 0;
  EXPECT_TRUE(missing_metrics(metric_list(), {MetricGroup::cost}, values).empty());
  OneStepError error;
  error.model = 2;
  error.variance = 4;
  const MetricValues one_step = one_step_values(error);
  EXPECT_TRUE(missing_metrics(metric_list(), {MetricGroup::one_step}, one_step).empty());
  EXPECT_NEAR(one_step.at("one_step_normalized"), 0.5, 1e-12);
}

TEST(Evaluation, FloorsTakePositionsFromMovedAndTheRestFromReseeded) {
  const Scene scene = unit_scene();
  const auto truth = falling_blocks(3);
  const auto e = evaluate_rollout(scene, {}, truth, truth);
  EXPECT_TRUE(missing_metrics(metric_list(), {MetricGroup::floors}, floor_values(e, e)).empty());
}

TEST(Comparison, AModelOfSomeScenesIsMarked) {
  ModelResult one, other;
  one.model = "mpm";
  other.model = "sand.safetensors";
  one.values["delta"] = other.values["delta"] = 2;
  Comparison comparison;
  comparison.scenes.resize(2);
  comparison.scenes[0].models = {one};
  comparison.scenes[1].models = {one, other};
  EXPECT_EQ(models_of(comparison), (std::vector<std::string>{"mpm", "sand.safetensors"}));
  EXPECT_EQ(mark_of_missing_scenes(comparison, "mpm"), "");
  EXPECT_EQ(mark_of_missing_scenes(comparison, "sand.safetensors"), "1 of 2 scenes");
  EXPECT_EQ(mean_over_scenes(comparison, "sand.safetensors").at("delta"), 2);
}

TEST(Comparison, GeometricMeansAreOfPositiveMetrics) {
  Comparison comparison;
  comparison.scenes.resize(2);
  for (const double error : {1e-4, 1e-2}) {
    ModelResult result;
    result.model = "mpm:coarse";
    result.values = {{"sinkhorn", error}, {"penetration_max", error > 1e-3 ? 0.0 : 1.0}};
    comparison.scenes[error > 1e-3 ? 1 : 0].models = {result};
  }
  const MetricValues mean = geometric_mean_over_scenes(comparison, "mpm:coarse");
  EXPECT_NEAR(mean.at("sinkhorn"), 1e-3, 1e-12);
  EXPECT_FALSE(mean.contains("penetration_max"));
  EXPECT_TRUE(geometric_mean_over_scenes(comparison, "mpm").empty());
}

TEST(Comparison, RunsWithoutAOneStepErrorNeedNone) {
  ModelResult result;
  result.model = "mpm:coarse";
  Comparison comparison;
  comparison.groups = {MetricGroup::one_step};
  comparison.scenes.resize(1);
  comparison.scenes[0].models = {result};
  EXPECT_TRUE(incomplete_results(comparison).empty());
  comparison.scenes[0].models[0].one_step_source = "true history";
  EXPECT_FALSE(incomplete_results(comparison).empty());
}

TEST(MetricList, MissingAndNonFiniteValuesAreFound) {
  const std::vector<MetricInfo> list = {{"a", "", "", MetricGroup::cost}, {"b", "", "", MetricGroup::cost}};
  EXPECT_EQ(missing_metrics(list, {MetricGroup::cost}, {{"a", 1}}), std::vector<std::string>{"b"});
  EXPECT_EQ(missing_metrics(list, {MetricGroup::cost}, {{"a", std::nan("")}, {"b", INFINITY}}).size(), 2u);
  EXPECT_TRUE(missing_metrics(list, {MetricGroup::floors}, {}).empty());
}

/// Keys in the first column of the tables of docs/reference/metrics.md, e.g. "| `sinkhorn` | ...".
std::multiset<std::string> documented_keys() {
  const std::string text = read_file(GRAUPEL_SOURCE_DIR "/docs/reference/metrics.md");
  const std::regex row("(^|\n)\\| `([a-z0-9_.<>]+)`");
  std::multiset<std::string> keys;
  for (auto m = std::sregex_iterator(text.begin(), text.end(), row); m != std::sregex_iterator(); ++m)
    keys.insert((*m)[2]);
  return keys;
}

TEST(MetricList, TheDocumentListsTheSameMetrics) {
  std::multiset<std::string> expected;
  for (const MetricInfo& metric : metric_list()) expected.insert(metric.key);
  for (const MetricInfo& metric : material_metric_list()) expected.insert("materials.<name>." + metric.key);
  EXPECT_EQ(documented_keys(), expected);
}

}  // namespace
}  // namespace graupel::compare
