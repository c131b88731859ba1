// Reduced-order models and their baselines in table, sentence, JSON, CSV and report.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "compare/comparison_files.h"
#include "compare/reduced_rows.h"
#include "compare/report/report.h"
#include "tests/compare/synthetic_comparison.h"

namespace graupel::compare {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

ModelResult row(const Comparison& comparison, const std::string& name, ModelRole role, double error, double frame_ms,
                double memory) {
  ModelResult result = comparison.scenes[0].models[1];
  result.model = name;
  result.role = role;
  result.values["displacement_relative_error"] = error;
  result.values["frame_ms"] = frame_ms;
  result.values["model_memory_mib"] = memory;
  return result;
}

/// A model with 2 % beside the truth, a faster and smaller coarse grid, and baselines at 100, 4 and 1 %.
Comparison reduced_comparison() {
  Comparison comparison = synthetic_comparison();
  std::vector<ModelResult>& models = comparison.scenes[0].models;
  const ModelResult model = row(comparison, "runs/nsf.safetensors", ModelRole::reduced, 0.02, 3, 12);
  models = {row(comparison, "mpm", ModelRole::mpm, 0, 30, 40),
            row(comparison, "mpm:coarse", ModelRole::mpm, 0.05, 2, 10),
            model,
            row(comparison, "nothing-moves", ModelRole::baseline, 1, 0.1, 0),
            row(comparison, "nearest-run", ModelRole::baseline, 0.04, 0.1, 0),
            row(comparison, "between-runs", ModelRole::baseline, 0.01, 0.2, 0)};
  models[2].trust = {"doubtful", 2.25, 0.03};
  models[5].note = "side 0.5 x 30 + 0.5 x 60";
  comparison.training_runs = "data/side";
  return comparison;
}

TEST(ReducedRows, TheSentenceSaysWhoWinsWhat) {
  const auto sentences = reduced_sentences(reduced_comparison());
  ASSERT_EQ(sentences.size(), 1u);
  EXPECT_EQ(sentences[0],
            "nsf.safetensors on falling 0: error 2.00 % of the displacement (less than mpm:coarse 5.00, nothing-moves "
            "100, nearest-run 4.00; not less than between-runs 1.00); 3.00 ms a frame (less than mpm 30.0; not less "
            "than mpm:coarse 2.00); 12.0 MiB (less than mpm 40.0; not less than mpm:coarse 10.0); its verdict on "
            "itself: doubtful (errors up to 3 % on training runs).");
}

TEST(ReducedRows, SeveralScenesGiveMeansAndCountVerdicts) {
  Comparison comparison = reduced_comparison();
  comparison.scenes.push_back(comparison.scenes[0]);
  comparison.scenes[1].models[2].values["displacement_relative_error"] = 0.04;
  comparison.scenes[1].models[2].trust->verdict = "ok";
  comparison.scenes[1].models.pop_back();  // no interpolation there
  const std::string sentence = reduced_sentences(comparison).at(0);
  EXPECT_THAT(sentence, HasSubstr("on 2 scenes: error 3.00 % of the displacement"));
  EXPECT_THAT(sentence, Not(HasSubstr("between-runs"))) << "which is not in all of its scenes";
  EXPECT_THAT(sentence, HasSubstr("doubtful in 1, ok in 1 of 2 scenes (errors up to 3 %"));
}

TEST(ReducedRows, AreInTableJsonCsvAndReport) {
  const Comparison comparison = reduced_comparison();
  const std::string table = comparison_table(comparison), html = report_html(comparison),
                    csv = comparison_csv(comparison);
  for (const std::string& text : {table, html}) {
    EXPECT_THAT(text, HasSubstr("doubtful (2.25; 3 %)"));
    EXPECT_THAT(text, HasSubstr("side 0.5 x 30 + 0.5 x 60"));
    EXPECT_THAT(text, HasSubstr("error 2.00 % of the displacement"));
    EXPECT_THAT(text, Not(HasSubstr("Left out:")));
  }
  for (std::size_t start = 0; start < table.size(); start = table.find('\n', start) + 1)
    EXPECT_LE(table.find('\n', start) - start, 120u);
  const auto json = comparison_json(comparison);
  EXPECT_EQ(json["results"][2]["role"], "reduced");
  EXPECT_EQ(json["results"][2]["trust"]["verdict"], "doubtful");
  EXPECT_EQ(json["results"][5]["note"], "side 0.5 x 30 + 0.5 x 60");
  EXPECT_EQ(json["training_runs"], "data/side");
  EXPECT_EQ(json["reduced_models"].size(), 1u);
  EXPECT_THAT(csv, HasSubstr("scene,model,role,verdict,trust_number,error_bound,"));
  EXPECT_THAT(csv, HasSubstr(",runs/nsf.safetensors,reduced,doubtful,2.25,,"));
  EXPECT_THAT(headline(comparison), Not(HasSubstr("nearest-run"))) << "baselines are no opponents of MPM";
}

TEST(ReducedRows, AnUnknownVerdictHasNoNumbers) {
  ModelResult result;
  EXPECT_EQ(trust_text(result), "");
  result.trust = {"unknown", 0, 0};
  EXPECT_EQ(trust_text(result), "unknown");
  result.trust = {"ok", 0, 0.03, 0.024};
  EXPECT_EQ(trust_text(result), "ok (bound 2.4 %)");
}

TEST(ReducedRows, SayThatTheTrainingRunsAreLeftOut) {
  Comparison comparison = reduced_comparison();
  comparison.training_runs.clear();
  EXPECT_THAT(reduced_legend(comparison), HasSubstr("--training-runs FOLDER names"));
  EXPECT_TRUE(comparison_json(comparison)["training_runs"].is_null());
  const Comparison other = synthetic_comparison();
  EXPECT_FALSE(has_reduced_model(other.scenes[0]));
  EXPECT_THAT(comparison_table(other), Not(HasSubstr("reduced-order")))
      << "without a reduced-order model nothing is said";
  EXPECT_FALSE(comparison_json(other).contains("training_runs"));
}

}  // namespace
}  // namespace graupel::compare
