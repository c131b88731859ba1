// graupel bench rom: naive answers, its flags, and what it writes.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "bench/reduced/baselines.h"
#include "core/system/atomic_file.h"
#include "tests/apps/falling_model.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

/// Runs whose positions are linear in the parameter: x = X + t (mu e_x + e_z), and one that is not.
class LinearRuns : public ::testing::Test {
 protected:
  static constexpr int frames = 4;

  std::string write(const std::string& name, const std::vector<double>& parameters, double bend = 0) const {
    std::vector<std::string> parts;
    for (const double mu : parameters) {
      Trajectory run;
      run.particle_type = {0, 0};
      run.frame_time = 0.1;
      for (int f = 0; f < frames; ++f) {
        const auto t = static_cast<float>(f), way = static_cast<float>(mu + bend * mu * mu);
        ParticleFrame frame;
        frame.time = 0.1 * f;
        frame.position = {{1 + t * way, 2, t}, {3 + t * way, 4, t}};
        frame.velocity = {{way, 0, 1}, {way, 0, 1}};
        run.frames.push_back(frame);
      }
      parts.push_back(folder_.file(name + std::to_string(parts.size())));
      io::TrajectoryWriter writer(parts.back(), run);
      writer.parameters({{"mu", "", mu, {"key"}}});
      for (const ParticleFrame& frame : run.frames) writer.append(frame);
      writer.finish();
    }
    io::merge_trajectories(parts, folder_.file(name));
    return folder_.file(name);
  }

  Folder folder_;
};

TEST_F(LinearRuns, InterpolationIsExactForRunsThatAreLinear) {
  const experiments::TrainingRuns train(write("train.h5", {4, 1, 2, 8}));
  const io::TrajectoryReader test(write("test.h5", {2.5, 1, 9}));
  const bench::Baselines inside = bench::baselines_of_run(train, test, 0);
  ASSERT_TRUE(inside.linear);
  EXPECT_LT(inside.linear->displacement_relative, 1e-6);
  EXPECT_NEAR(inside.nearest.displacement_relative, 0.5 / std::sqrt(1 + 2.5 * 2.5), 1e-6);
  EXPECT_NEAR(inside.nothing_moves.displacement_relative, 1, 1e-9);
  EXPECT_LT(inside.nothing_moves.delta, 1);
  const bench::Baselines known = bench::baselines_of_run(train, test, 1);
  EXPECT_EQ(known.nearest.delta, 0);
  EXPECT_EQ(known.linear->delta, 0);
  const bench::Baselines outside = bench::baselines_of_run(train, test, 2);
  EXPECT_FALSE(outside.linear);
  EXPECT_GT(outside.nearest.delta, 0);
}

TEST_F(LinearRuns, InterpolationOfOtherRunsHasAnError) {
  const experiments::TrainingRuns train(write("train.h5", {1, 3}, 0.5));
  const io::TrajectoryReader test(write("test.h5", {2}, 0.5));
  EXPECT_GT(bench::baselines_of_run(train, test, 0).linear->displacement_relative, 0.05);
}

TEST_F(LinearRuns, BeyondTheRunsTheLineIsExtended) {
  const experiments::TrainingRuns train(write("train.h5", {4, 1, 2, 8}));
  EXPECT_FALSE(experiments::runs_around(train.parameters(), {9}));
  const auto beyond = experiments::runs_beyond(train.parameters(), {9});
  ASSERT_TRUE(beyond);
  EXPECT_EQ(beyond->runs, (std::vector<int>{3, 0})) << "8 and 4";
  EXPECT_NEAR(beyond->weights[0], 1.25, 1e-12);
  EXPECT_NEAR(train.positions(*beyond, 2).front()[0], 1 + 2 * 9, 1e-5);
  EXPECT_EQ(train.text(*beyond), "mu 1.25 x 8 + -0.25 x 4");
  EXPECT_FALSE(experiments::runs_beyond({{1}}, {2})) << "one run spans no line";
}

TEST(NaiveRuns, EveryParameterCountsOverItsRange) {
  const std::vector<std::vector<double>> runs = {{0, 0}, {1, 1000}, {0.4, 900}};
  EXPECT_EQ(experiments::nearest_run(runs, {0.5, 800}).runs, std::vector<int>{2});
  EXPECT_EQ(experiments::nearest_run(runs, {0.9, 950}).runs, std::vector<int>{1});
}

/// Of the triangles that hold a point, the one without another run in its circle.
TEST(NaiveRuns, TheSimplexAroundIsThatOfDelaunay) {
  const std::vector<std::vector<double>> runs = {{0, 0}, {2, 0}, {0, 20}, {2, 20}, {0.9, 9}, {1, 1}};
  const std::vector<double> own = {0.9, 5};
  const auto mix = experiments::runs_around(runs, own);
  ASSERT_TRUE(mix);
  double sum = 0, first = 0, second = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    sum += mix->weights[i];
    first += mix->weights[i] * runs[static_cast<std::size_t>(mix->runs[i])][0];
    second += mix->weights[i] * runs[static_cast<std::size_t>(mix->runs[i])][1];
  }
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_NEAR(first, own[0], 1e-12);
  EXPECT_NEAR(second, own[1], 1e-11);
  EXPECT_EQ(std::set<int>(mix->runs.begin(), mix->runs.end()), (std::set<int>{0, 4, 5}));
  EXPECT_FALSE(experiments::runs_around(runs, {2.1, 5})) << "outside";
  EXPECT_FALSE(experiments::runs_around({{0, 0}, {1, 1}, {2, 2}}, {1, 1.5})) << "the runs lie on a line";
  const auto known = experiments::runs_around(runs, {1, 1});
  ASSERT_TRUE(known);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(known->weights[i], known->runs[i] == 5 ? 1 : 0, 1e-12);
}

TEST(NaiveRuns, TheSimplexMayHaveRunsBeyondMoreThanSixteenNearerOnes) {
  std::vector<std::vector<double>> runs = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
  for (int i = 0; i < 20; ++i) runs.push_back({0.6, 0.4 + 0.01 * i});
  const auto mix = experiments::runs_around(runs, {0.5, 0.5});
  ASSERT_TRUE(mix);
  EXPECT_LT(*std::min_element(mix->runs.begin(), mix->runs.end()), 4) << "a corner";
  for (const double weight : mix->weights) EXPECT_GE(weight, -1e-9);
}

/// The model of falling sand and a stored run of it.
class BenchRom : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string scene = folder_.write("falling.json", falling_scene());
    model_ = folder_.file("falling.safetensors");
    rom::ReducedModel model = falling_model(io::read_scene(scene));
    model.usual.assign(8, {1, 1, 100});
    model.singular_values["deformation"] = {4, 2, 1};
    nn::write_safetensors(model_, model.store(nn::DType::f32));
    ASSERT_EQ(graupel("simulate " + scene + " --fields stress -o " + folder_.file("test.h5")).exit_code, 0);
  }
  Outcome bench(const std::string& flags) const {
    return graupel("bench rom " + model_ + " " + folder_.file("") + " --threads 1 " + flags);
  }
  nlohmann::json result() const { return nlohmann::json::parse(read_file(folder_.file("out.json"))); }

  Folder folder_;
  std::string model_;
};

TEST_F(BenchRom, MeasuresEveryNumberOfSamplesAndStep) {
  const Outcome outcome = bench("--samples 40,80 --step-factor 1,2 --against mpm --f64 --plot " +
                                folder_.file("plots") + " --json " + folder_.file("out.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const auto rows = result()["rows"];
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0]["samples"], 40);
  EXPECT_EQ(rows[3]["samples"], 80);
  EXPECT_EQ(rows[1]["steps"], rows[0]["steps"].get<int>() / 2);
  EXPECT_LT(rows[0]["displacement_relative_error"], 1e-3);
  EXPECT_GT(rows[1]["displacement_relative_error"], rows[0]["displacement_relative_error"]);
  EXPECT_EQ(rows[0]["trust"]["verdict"], "ok");
  EXPECT_EQ(rows[0]["trust"]["frames"]["number"].size(), 8u);
  EXPECT_GT(rows[0]["speed"][0]["speedup"], 0);
  for (const char* plot : {"trust.svg", "errors-samples.svg", "errors-step_factor.svg"})
    EXPECT_NE(read_file(folder_.file(std::string("plots/") + plot)).find("</svg>"), std::string::npos) << plot;
  const Outcome again = graupel("bench rom --from " + folder_.file("out.json") + " --plot " + folder_.file("again"));
  ASSERT_EQ(again.exit_code, 0) << again.output;
  EXPECT_EQ(read_file(folder_.file("again/trust.svg")), read_file(folder_.file("plots/trust.svg")));
}

TEST_F(BenchRom, AForeignSceneRunsWhenAskedAndIsNotTrusted) {
  const std::string heavy = folder_.write("heavy.json", falling_scene());
  ASSERT_EQ(graupel("simulate " + heavy + " --set materials.sand.density=4000 -o " + folder_.file("test.h5")).exit_code,
            0);
  const Outcome refused = bench("");
  EXPECT_EQ(refused.exit_code, 2) << refused.output;
  EXPECT_TRUE(refused.says("is for another scene")) << refused.output;
  const Outcome outcome = bench("--other-scene --json " + folder_.file("out.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_EQ(result()["rows"][0]["trust"]["verdict"], "do not trust");
}

TEST_F(BenchRom, SeveralInstancesAreOfTheGpu) {
  const Outcome outcome = bench("--instances 2");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
  EXPECT_TRUE(outcome.says("--instances")) << outcome.output;
}

TEST_F(BenchRom, RefusesWhatMakesNoSense) {
  const std::pair<const char*, const char*> bad[] = {{"--step-factor 1,0", "--step-factor"},
                                                     {"--samples 0", "--samples"},
                                                     {"--against hgn", "--against"},
                                                     {"--from a.json --plot b", "not both"}};
  for (const auto& [flags, says] : bad) {
    const Outcome outcome = bench(flags);
    EXPECT_EQ(outcome.exit_code, 2) << flags << outcome.output;
    EXPECT_TRUE(outcome.says(says)) << flags << outcome.output;
  }
  const Outcome nothing = graupel("bench rom");
  EXPECT_EQ(nothing.exit_code, 2) << nothing.output;
  EXPECT_TRUE(nothing.says("needs a model and its data set")) << nothing.output;
  const std::string other = folder_.write("other.json", "{}");
  const Outcome no_plot = graupel("bench rom --from " + other);
  EXPECT_TRUE(no_plot.exit_code == 2 && no_plot.says("--plot")) << no_plot.output;
  const Outcome foreign = graupel("bench rom --from " + other + " --plot " + folder_.file("p"));
  EXPECT_TRUE(foreign.exit_code == 3 && foreign.says("bench rom --json")) << foreign.output;
}

}  // namespace
}  // namespace graupel::test
