// Who wins against the strongest cheap rival, what is a tie, and where a model falls behind.
#include "compare/contest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "compare/comparison_files.h"
#include "compare/report/report.h"
#include "tests/compare/synthetic_comparison.h"

namespace graupel::compare {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

MetricValues errors(double error, double frame_ms) {
  return {{"position_mse_all", error}, {"sinkhorn", error}, {"density_error", error}, {"frame_ms", frame_ms}};
}

ErrorCurves flat_curves(double error) {
  return {std::vector<double>(10, error), std::vector<double>(10, error), std::vector<double>(10, 1.0)};
}

/// A network of the given error beside mpm, the truth, and a coarse grid of error 1; nothing moves has 4.
Comparison contest_of(double error, double floor = -1) {
  Comparison comparison;
  comparison.groups = {MetricGroup::rollout, MetricGroup::cost};
  SceneResult scene;
  scene.name = "heap";
  scene.frames = 10;
  scene.dx = 0.01;
  scene.mpm_frame_ms = 20;
  scene.opponent = "mpm:coarse:fast";
  scene.rivals = {{"mpm:coarse:fast", errors(1, 2), flat_curves(1)}, {"nothing-moves", errors(4, 0), flat_curves(4)}};
  ModelResult mpm, network;
  mpm.model = "mpm";
  mpm.values = errors(0, 20);
  network.model = "models/net.safetensors";
  network.role = ModelRole::learned;
  network.values = errors(error, 4);
  network.curves = flat_curves(error);
  if (floor >= 0) {
    comparison.groups.push_back(MetricGroup::floors);
    for (ModelResult* result : {&mpm, &network})
      for (const char* key : {"position_mse_all", "sinkhorn", "density_error"})
        result->values[std::string("floor_") + key] = floor;
    scene.floor_position = scene.floor_density = std::vector<double>(10, floor);
  }
  scene.models = {mpm, network};
  comparison.scenes = {scene};
  return comparison;
}

std::string sentence_of(const Comparison& comparison) {
  const std::vector<Contest> decisive = decisive_contests(comparison);
  return decisive.size() == 1 ? contest_sentence(decisive.front(), comparison) : "not one contest";
}

TEST(Contest, SaysWhoWinsByHowMuchAtWhichTime) {
  EXPECT_EQ(
      sentence_of(contest_of(0.25)),
      "net.safetensors wins against mpm:coarse:fast, the strongest cheap rival, with 0.250 times its position MSE, "
      "0.250 times its Sinkhorn divergence, 0.250 times its density error. It takes 2.00 times its time, 0.200 "
      "times that of mpm and falls behind nowhere.");
  EXPECT_THAT(floor_sentence(contest_of(0.25)), HasSubstr("not measured"));
}

TEST(Contest, TheLoserFallsBehindInANamedSceneAndFrame) {
  Comparison comparison = contest_of(2);
  std::vector<double>& position = comparison.scenes[0].models[1].curves.position;
  std::fill(position.begin(), position.begin() + 4, 0.5);
  position[1] = 9;  // one frame is no failure
  EXPECT_THAT(sentence_of(comparison), HasSubstr("net.safetensors loses to mpm:coarse:fast"));
  EXPECT_THAT(sentence_of(comparison), HasSubstr("falls behind first in heap, frame 5."));
  comparison.scenes.push_back(comparison.scenes[0]);
  comparison.scenes[1].name = "bowl";
  comparison.scenes[1].models[1].diverged_at_frame = 3;
  EXPECT_THAT(sentence_of(comparison), HasSubstr("on 2 scenes (won 0, lost 2)"));
  EXPECT_THAT(sentence_of(comparison), HasSubstr("fails first in bowl, diverged at frame 3."));
}

TEST(Contest, NoDifferenceBelowTheNoiseFloorIsClaimed) {
  for (const double error : {0.5, 1.0, 1.5}) {
    const std::string sentence = sentence_of(contest_of(error, 0.6));
    EXPECT_THAT(sentence, HasSubstr("net.safetensors ties with mpm:coarse:fast")) << error;
    EXPECT_THAT(sentence, HasSubstr("no clear difference in position MSE, Sinkhorn divergence, density error"));
    EXPECT_THAT(sentence, Not(HasSubstr("times its position"))) << error;
    EXPECT_THAT(sentence, HasSubstr("falls behind nowhere")) << error;
  }
  EXPECT_THAT(sentence_of(contest_of(0.3, 0.6)), HasSubstr("wins against"));
  EXPECT_THAT(sentence_of(contest_of(1.7, 0.6)), HasSubstr("loses to"));
}

TEST(Contest, AMeanThatRunsAgainstTheScenesDecidesNothing) {
  Comparison comparison = contest_of(0.9);  // barely better twice, far worse once
  comparison.scenes.push_back(comparison.scenes[0]);
  comparison.scenes.push_back(contest_of(50).scenes[0]);
  const Contest contest = decisive_contests(comparison).front();
  EXPECT_EQ(contest.won, 2u);
  EXPECT_EQ(contest.lost, 1u);
  EXPECT_EQ(contest.outcome, Outcome::level);
}

/// Beaten by half in three scenes; in the first the network's Sinkhorn divergence is exactly 0.
Comparison with_an_error_of_zero(double rivals) {
  Comparison comparison = contest_of(1.5);
  comparison.scenes.resize(3, comparison.scenes[0]);
  for (std::size_t s = 0; s < 3; ++s) comparison.scenes[s].name += std::to_string(s);
  comparison.scenes[0].models[1].values["sinkhorn"] = 0;
  comparison.scenes[0].rivals[0].values["sinkhorn"] = rivals;
  return comparison;
}

TEST(Contest, AnErrorOfZeroDecidesNoMeanThatAnotherSceneDoes) {
  const Comparison comparison = with_an_error_of_zero(1e-13);  // told from 0 from (1e-4 dx)^2 = 1e-12 on
  const Contest contest = decisive_contests(comparison).front();
  EXPECT_NEAR(contest.metrics.at("sinkhorn").ratio, std::pow(1.5, 2.0 / 3), 1e-12);  // the first scene is a tie
  EXPECT_EQ(contest.metrics.at("sinkhorn").outcome, Outcome::loses);
  EXPECT_THAT(comparison_table(comparison), HasSubstr("1.31 times its Sinkhorn"));
  EXPECT_THAT(report_html(comparison), HasSubstr("<td class=\"loses\">1.31</td>"));
  const auto json = comparison_json(comparison);
  EXPECT_EQ(json["verdicts"][0]["ratios"]["sinkhorn"]["ratio"], contest.metrics.at("sinkhorn").ratio);
  EXPECT_NEAR(json["geometric_mean"]["models/net.safetensors"]["sinkhorn"], std::cbrt(1e-12 * 1.5 * 1.5), 1e-9);
  EXPECT_FALSE(json["geometric_mean"]["mpm"].contains("sinkhorn"));  // the truth
}

TEST(Contest, AnErrorOfZeroCountsAsWhatIsToldFromIt) {
  const double ratio = decisive_contests(with_an_error_of_zero(1)).front().metrics.at("sinkhorn").ratio;
  EXPECT_NEAR(ratio, std::cbrt(1e-12 * 1.5 * 1.5), 1e-12);
}

TEST(Contest, BehindIsMoreThanTheResolution) {
  Comparison comparison = contest_of(0.25);
  comparison.scenes[0].rivals[0].curves = flat_curves(0);
  for (const double error : {1e-14, 1e-3}) {
    comparison.scenes[0].models[1].curves = flat_curves(error);
    EXPECT_EQ(decisive_contests(comparison).front().failure.has_value(), error > 1e-4) << error;
  }
}

TEST(Contest, TheRivalIsTheStrongestOfTheCheap) {
  Comparison comparison = contest_of(0.25);
  comparison.scenes[0].rivals[1].values = errors(0.1, 0);  // a scene in which nothing happens
  EXPECT_THAT(sentence_of(comparison), HasSubstr("loses to nothing-moves"));
  EXPECT_THAT(sentence_of(comparison), HasSubstr("2.50 times its position MSE"));
  EXPECT_THAT(sentence_of(comparison), HasSubstr("It takes 0.200 times that of mpm"));  // nothing takes no time
  ModelResult coarse;
  coarse.model = "mpm:coarse";
  coarse.values = errors(0.05, 3);
  coarse.curves = flat_curves(0.05);
  comparison.scenes[0].models.push_back(coarse);
  EXPECT_THAT(sentence_of(comparison), HasSubstr("loses to mpm:coarse, "));
}

TEST(Contest, MpmIsNoContestantButAgainstTheTruthOfAFile) {
  Comparison comparison = contest_of(0.25);
  comparison.scenes[0].models.pop_back();
  EXPECT_THAT(decisive_contests(comparison), ::testing::IsEmpty());
  comparison.scenes[0].stored_truth = true;
  comparison.scenes[0].models[0].curves = flat_curves(0);
  EXPECT_THAT(sentence_of(comparison), HasSubstr("mpm wins against mpm:coarse:fast"));
  EXPECT_THAT(sentence_of(comparison), HasSubstr("with 1.00e-12 times its position MSE"));
}

TEST(Contest, CoarseGridsAloneAreHeldAgainstTheNext) {
  Comparison comparison = contest_of(0.25);
  ModelResult& coarse = comparison.scenes[0].models[1];
  coarse.model = "mpm:coarse:fast";
  coarse.role = ModelRole::mpm;
  EXPECT_THAT(sentence_of(comparison), HasSubstr("mpm:coarse:fast wins against nothing-moves"));
}

TEST(Contest, AReportOnTheTruthOfAFileSaysWhoWon) {
  Comparison comparison = synthetic_comparison();
  comparison.groups = {MetricGroup::rollout, MetricGroup::cost};  // without floors
  comparison.scenes[0].stored_truth = true;
  const std::string html = report_html(comparison);
  EXPECT_THAT(html, HasSubstr("&lt;net&gt;.safetensors loses to mpm:coarse:fast, the strongest cheap rival"));
  EXPECT_THAT(html, HasSubstr("whose frames are the truth"));
  EXPECT_THAT(html, HasSubstr("Noise floors were not measured"));
}

}  // namespace
}  // namespace graupel::compare
