// From how many scenes on a model takes less time than MPM: numbers by hand.
#include "compare/break_even.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "compare/comparison_files.h"
#include "compare/report/report.h"
#include "tests/compare/synthetic_comparison.h"

namespace graupel::compare {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const std::string network = "models/<net>.safetensors";

TEST(BreakEven, IsTheOfflineTimeOverWhatASceneSaves) {
  const OfflineTime offline{.data = 100, .training = 500, .devices = {"a GPU"}};
  const RivalBreakEven pays = break_even(offline, 1, "mpm", 3.5);  // 600 / 2.5
  EXPECT_EQ(pays.verdict, BreakEvenVerdict::pays);
  EXPECT_EQ(pays.scenes, 240);
  EXPECT_EQ(break_even(offline, 1, "mpm", 1.7).scenes, 858);  // 857.1
  EXPECT_EQ(break_even({.data = 0, .training = 0, .devices = {}}, 1, "mpm", 2).scenes, 1);
}

TEST(BreakEven, NeverWhereTheModelIsNotFaster) {
  for (const OfflineTime& offline : {OfflineTime{.data = 1, .training = 1, .devices = {}}, OfflineTime()})
    for (const double rival : {2.0, 1.9}) {
      const RivalBreakEven result = break_even(offline, 2, "mpm", rival);
      EXPECT_EQ(result.verdict, BreakEvenVerdict::never);
      EXPECT_FALSE(result.scenes);
    }
}

TEST(BreakEven, IsABoundOrUnknownWhereTheWeightsDoNotSay) {
  const RivalBreakEven bound = break_even({.data = {}, .training = 500, .devices = {}}, 1, "mpm", 3.5);
  EXPECT_EQ(bound.verdict, BreakEvenVerdict::later);
  EXPECT_EQ(bound.scenes, 200);
  EXPECT_EQ(break_even({.data = 100, .training = {}, .devices = {}}, 1, "mpm", 3.5).scenes, 40);
  const RivalBreakEven unknown = break_even({}, 1, "mpm", 3.5);
  EXPECT_EQ(unknown.verdict, BreakEvenVerdict::unknown);
  EXPECT_FALSE(unknown.scenes);
}

/// Two scenes of 20 frames: a rollout takes 1 s and 2 s, mpm 3 s and 5 s, mpm:coarse:fast 1 s in both.
Comparison timed_comparison(const OfflineTime& offline) {
  Comparison comparison = synthetic_comparison(2);
  const double frame_ms[] = {50, 100}, mpm_ms[] = {150, 250};
  for (std::size_t s = 0; s < 2; ++s) {
    comparison.scenes[s].models[1].values["frame_ms"] = frame_ms[s];
    comparison.scenes[s].mpm_frame_ms = mpm_ms[s];
    comparison.scenes[s].opponent_frame_ms = 50;
  }
  comparison.hardware = "a GPU";
  comparison.offline[network] = offline;
  return comparison;
}

TEST(BreakEven, TakesMeansOverTheScenesOfTheModel) {
  const Comparison comparison = timed_comparison({.data = 100, .training = 500, .devices = {"a GPU"}});
  const std::vector<BreakEven> results = break_evens(comparison);
  ASSERT_EQ(results.size(), 1u);  // mpm has no offline time
  EXPECT_EQ(results[0].model, network);
  EXPECT_EQ(results[0].scenes, 2u);
  EXPECT_DOUBLE_EQ(results[0].scene_seconds, 1.5);
  EXPECT_FALSE(results[0].estimate);
  ASSERT_EQ(results[0].rivals.size(), 2u);
  EXPECT_EQ(results[0].rivals[0].rival, "mpm:coarse:fast");
  EXPECT_EQ(results[0].rivals[0].verdict, BreakEvenVerdict::never);
  EXPECT_EQ(results[0].rivals[1].rival, "mpm");
  EXPECT_DOUBLE_EQ(results[0].rivals[1].rival_seconds, 4);
  EXPECT_EQ(results[0].rivals[1].scenes, 240);
  Comparison one_step = comparison;
  one_step.groups = {MetricGroup::one_step};
  EXPECT_TRUE(break_evens(one_step).empty());
}

TEST(BreakEven, LeavesOutScenesWhereARunHasNoTime) {
  const Comparison timed = timed_comparison({.data = 100, .training = 500, .devices = {"a GPU"}});
  const auto without_time = [&](std::size_t scene, const std::string& run) {
    Comparison comparison = timed;
    SceneResult& result = comparison.scenes[scene];
    (run == "mpm"     ? result.mpm_frame_ms
     : run == "rival" ? result.opponent_frame_ms
                      : result.models[1].values["frame_ms"]) = 0;
    return comparison;
  };
  for (const std::string run : {"model", "mpm", "rival"}) {  // diverged in its first frame
    const std::vector<BreakEven> results = break_evens(without_time(0, run));
    ASSERT_EQ(results.size(), 1u) << run;
    EXPECT_EQ(results[0].scenes, 1u) << run;
    EXPECT_DOUBLE_EQ(results[0].scene_seconds, 2) << run;
    EXPECT_DOUBLE_EQ(results[0].rivals[1].rival_seconds, 5) << run;
    EXPECT_EQ(results[0].rivals[1].scenes, 200) << run;
  }
  Comparison none = without_time(0, "model");
  none.scenes[1].models[1].values["frame_ms"] = 0;
  EXPECT_TRUE(break_evens(none).empty());
}

TEST(BreakEven, IsInTableReportAndJson) {
  const Comparison comparison = timed_comparison({.data = 100, .training = 500, .devices = {"a GPU"}});
  const std::string sentence =
      "Break-even of <net>.safetensors in time, errors aside: never against mpm:coarse:fast (1.00 s), after 240 scenes "
      "against mpm (4.00 s). A scene takes it 1.50 s (mean of 2 here, on a GPU). Data took 1 min 40 s, training 8 min "
      "20 s; on a GPU.";
  const auto json = comparison_json(comparison);
  ASSERT_EQ(json["break_even"].size(), 1u);
  EXPECT_EQ(json["break_even"][0]["sentence"], sentence);
  EXPECT_EQ(json["break_even"][0]["data_s"], 100);
  EXPECT_EQ(json["break_even"][0]["rivals"][0]["verdict"], "never");
  EXPECT_TRUE(json["break_even"][0]["rivals"][0]["scenes"].is_null());
  EXPECT_EQ(json["break_even"][0]["rivals"][1]["scenes"], 240);
  EXPECT_EQ(json["scenes"][1]["mpm_frame_ms"], 250);
  std::string table = comparison_table(comparison);
  for (std::size_t start = 0; start < table.size(); start = table.find('\n', start) + 1)
    EXPECT_LE(table.find('\n', start) - start, 120u);
  std::replace(table.begin(), table.end(), '\n', ' ');
  EXPECT_THAT(table, HasSubstr(sentence));
  EXPECT_THAT(report_html(comparison), HasSubstr(sentence.substr(sentence.find(" in time"))));
}

TEST(BreakEven, SaysWhatIsAnEstimateAndWhatIsNotTold) {
  const auto sentence = [](const OfflineTime& offline) {
    const Comparison comparison = timed_comparison(offline);
    return break_even_sentence(break_evens(comparison).front(), comparison);
  };
  EXPECT_THAT(sentence({.data = 100, .training = 500, .devices = {"a GPU", "2 threads of a CPU"}}),
              HasSubstr("; on a GPU, 2 threads of a CPU. That is not the hardware of the rollouts: the number of "
                        "scenes is an estimate."));
  EXPECT_THAT(sentence({.data = {}, .training = 500, .devices = {"a GPU"}}),
              ::testing::AllOf(HasSubstr("after at least 200 scenes against mpm"),
                               HasSubstr("the weights do not say how long the data took; on a GPU."),
                               Not(HasSubstr("estimate"))));
  EXPECT_THAT(sentence({}), ::testing::AllOf(HasSubstr("not known against mpm (4.00 s)"),
                                             HasSubstr("The weights do not say how long data and training took."),
                                             Not(HasSubstr("estimate"))));
}

}  // namespace
}  // namespace graupel::compare
