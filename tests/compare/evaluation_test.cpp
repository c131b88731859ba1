// Evaluations of whole runs: every key with a finite value, known answers, and the documented list of metrics.
#include "compare/metrics/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
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

/// The same run with some particles out of it: `active`(particle, frame).
ParticleRun with_active(ParticleRun run, const std::function<bool(std::size_t, std::size_t)>& active) {
  for (std::size_t f = 0; f < run.trajectory.frames.size(); ++f) {
    auto& list = run.trajectory.frames[f].active;
    for (std::size_t i = 0; i < run.size(); ++i) list.push_back(active(i, f) ? 1 : 0);
  }
  return run;
}

TEST(Evaluation, PositionErrorsAreOfParticlesInBothRuns) {
  const auto blocks = falling_blocks(6);
  auto shifted = blocks;
  for (std::size_t f = 1; f <= 6; ++f)
    for (std::size_t i = 0; i < shifted.size(); ++i)
      shifted.trajectory.frames[f].position[i][0] += i % 2 == 0 ? 0.1f : 5;
  const auto truth = with_active(blocks, [](std::size_t i, std::size_t f) { return i % 2 == 0 && f >= 3; });
  const auto e = evaluate_rollout(unit_scene(), {}, truth, shifted);
  EXPECT_EQ(e.curves.position[1], 0);  // nobody is in both
  EXPECT_NEAR(e.curves.position[3], 0.01, 1e-6);
  EXPECT_NEAR(e.values.at("center_of_mass_error"), (0.1 + 5) / 2, 0.01);  // of all in each, frames 3..6
  EXPECT_TRUE(missing_metrics(metric_list(), {MetricGroup::rollout}, e.values).empty());
}

TEST(Evaluation, MassThatIsNotInTheRunCountsNowhere) {
  const auto blocks = falling_blocks(6);
  const auto half = [](std::size_t i, std::size_t) { return i % 2 == 0; };
  const auto truth = with_active(blocks, half);
  auto run = truth;  // those out of it may be anywhere
  for (auto& frame : run.trajectory.frames)
    for (std::size_t i = 1; i < run.size(); i += 2) frame.position[i] = {9, 9, 9};
  const auto e = evaluate_rollout(unit_scene(), {}, truth, run);
  for (const char* key : {"position_mse_all", "sinkhorn", "density_error", "kinetic_energy_error", "clump_size_error",
                          "local_density_error", "outside_walls_share", "outside_domain_max"})
    EXPECT_EQ(e.values.at(key), 0) << key;
  const auto whole = evaluate_rollout(unit_scene(), {}, truth, blocks);
  EXPECT_NEAR(whole.values.at("density_error"), 1, 0.1);  // twice the mass
}

TEST(Evaluation, ARunThatNeverHasAMaterialIsFinite) {
  const auto blocks = falling_blocks(6);
  const auto none = with_active(blocks, [](std::size_t, std::size_t) { return false; });
  for (const auto& e :
       {evaluate_rollout(unit_scene(), {}, blocks, none), evaluate_rollout(unit_scene(), {}, none, blocks),
        evaluate_rollout(unit_scene(), {}, none, none)})
    EXPECT_TRUE(missing_metrics(metric_list(), {MetricGroup::rollout}, e.values).empty());
  EXPECT_EQ(evaluate_rollout(unit_scene(), {}, blocks, none).values.at("density_error"), 1);
  EXPECT_EQ(evaluate_rollout(unit_scene(), {}, none, blocks).values.at("density_error"), 2);
}

TEST(Evaluation, APeriodicWallIsNoDistance) {
  Scene scene = unit_scene();
  scene.gravity = Vec3d::zero();
  scene.domain.wall_cells = 2;
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{.kind = Wall::periodic, .friction = {}};
  const auto low = static_cast<float>(scene.wall_low()[0]), high = static_cast<float>(scene.wall_high()[0]);
  const auto points = block(6, {low + 0.0625f, 0.3f, 0.3f}, 0.125f);
  const std::vector<int32_t> type(points.size(), 5);
  // Both drift to the left through the wall, the run a sixteenth of a cell behind.
  const auto drifting = [&](float behind) {
    ParticleRun run = make_run(points, type, 6, [&, behind](const Vec3f& x, std::size_t f) {
      const float at = x[0] - 0.03125f * static_cast<float>(f) + (f > 0 ? behind : 0);
      return Vec3f{at < low ? at + high - low : at, x[1], x[2]};
    });
    run.volume.assign(points.size(), 0.125 * 0.125 * 0.125 / 216);
    return run;
  };
  const float d = 1.0f / 512;
  const auto e = evaluate_rollout(scene, {}, drifting(0), drifting(d));
  EXPECT_NEAR(e.values.at("position_mse_all"), d * d, 1e-8);
  EXPECT_LT(e.values.at("sinkhorn"), 4 * d * d);
  EXPECT_LT(e.values.at("density_error"), 0.1);
  EXPECT_LT(e.values.at("kinetic_energy_error"), 0.05);
  EXPECT_EQ(e.values.at("center_of_mass_error"), 0);
  EXPECT_EQ(e.values.at("outside_walls_share"), 0);
  EXPECT_EQ(e.values.at("clumps"), 1);
  EXPECT_LT(e.values.at("local_density_error"), 0.03);
}

TEST(Evaluation, APlaneHasAreas) {
  Scene scene = unit_scene();
  scene.domain.dimensions = 2;
  const double dx = scene.domain.dx;
  std::vector<Vec3f> points;
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j)
      points.push_back({0.25f + (float(i) + 0.5f) / 64, 0.25f + (float(j) + 0.5f) / 64, float(scene.domain.plane())});
  auto truth = make_run(points, std::vector<int32_t>(points.size(), 5), 3, stay);
  truth.volume.assign(points.size(), dx * dx / 4);
  auto other = truth;
  for (std::size_t f = 1; f <= 3; ++f)
    for (Vec3f& x : other.trajectory.frames[f].position) x[0] += 0.125f;
  const auto e = evaluate_rollout(scene, {}, truth, other);
  EXPECT_NEAR(e.values.at("occupancy_iou"), 1.0 / 3, 0.15);  // half of each square
  EXPECT_NEAR(e.values.at("density_error"), 1, 0.01);
  EXPECT_NEAR(e.values.at("local_density_error"), 0, 0.01);
  auto thin = truth;
  for (std::size_t f = 1; f <= 3; ++f)
    for (Vec3f& x : thin.trajectory.frames[f].position) x[0] = 0.25f + 2 * (x[0] - 0.25f);
  // 8 x 8 cells on 9 x 9 nodes, and on 17 x 9.
  EXPECT_NEAR(evaluate_rollout(scene, {}, truth, thin).values.at("local_density_error"), 64.0 / 81 - 64.0 / 153, 0.01);
}

TEST(Evaluation, MovingObstaclesAreWhereTheyAreInTheFrame) {
  Scene scene = scene_with_sphere();
  scene.obstacles[0].motion.emplace();
  scene.obstacles[0].motion->velocity = {0, 6, 0};  // 0.1 m a frame
  const sparsegrid::ObstacleSet obstacles(scene);
  const auto inside = make_run({{0.5f, 0.3f, 0.5f}}, {5}, 1, [](const Vec3f& x, std::size_t f) {
    return x + Vec3f{0, 0.1f * static_cast<float>(f), 0};
  });
  const auto behind = make_run({{0.5f, 0.3f, 0.5f}}, {5}, 1, stay);
  EXPECT_NEAR(evaluate_rollout(scene, obstacles, inside, inside).values.at("penetration_max"), scene.band(), 0.051);
  EXPECT_NEAR(evaluate_rollout(scene, obstacles, inside, behind).values.at("penetration_max"), 0.05, 0.005);
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
  EXPECT_EQ(cost_values({}, 7, 0.05).count("speed_ratio"), 0u) << "a run without frames has no speed";
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

/// Two categories of two scenes each, with the ratios of a model and its opponent.
Comparison categories() {
  Comparison comparison;
  comparison.groups = {MetricGroup::rollout, MetricGroup::ratios};
  for (const double ratio : {0.5, 2.0, 0.1, 0.4}) {
    SceneResult scene;
    scene.opponent = "mpm:coarse:fast";
    scene.category = ratio < 0.45 ? "stream" : "dam_break";
    for (const std::string model : {"mpm", "mpm:fast", "mpm:coarse:fast"}) {
      ModelResult result;
      result.model = model;
      const double r = model == "mpm:fast" ? ratio : 1;
      result.values = {{"sinkhorn", r},
                       {"ratio_position_mse_all", r},
                       {"ratio_sinkhorn", r},
                       {"ratio_density_error", 1},
                       {"ratio_frame_ms", model == "mpm:fast" ? 6.4 : 1}};
      scene.models.push_back(result);
    }
    comparison.scenes.push_back(scene);
  }
  return comparison;
}

TEST(Comparison, CategoriesHaveGeometricMeansOfTheirOwn) {
  const Comparison comparison = categories();
  EXPECT_EQ(categories_of(comparison), (std::vector<std::string>{"dam_break", "stream"}));
  EXPECT_EQ(scenes_of_category(comparison, "stream"), 2u);
  const auto ratio = [&](const std::string& category) {
    return geometric_mean_over_scenes(comparison, "mpm:fast", category).at("ratio_sinkhorn");
  };
  EXPECT_NEAR(ratio("dam_break"), 1, 1e-12);
  EXPECT_NEAR(ratio("stream"), 0.2, 1e-12);
  EXPECT_NEAR(ratio(""), std::sqrt(0.2), 1e-12);
  EXPECT_FALSE(mean_over_scenes(comparison, "mpm:fast").contains("ratio_sinkhorn"));
}

TEST(Comparison, TheHeadlineSaysWhoWinsWhat) {
  Comparison comparison = categories();
  EXPECT_EQ(headline(comparison),
            "Against mpm:coarse:fast on 4 scenes, mpm:fast wins in position (0.447), Sinkhorn divergence (0.447), ties "
            "in density (1.00), loses in time (6.40).");
  comparison.groups = {MetricGroup::rollout};
  EXPECT_EQ(headline(comparison), "");
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
