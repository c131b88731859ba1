// graupel-bench validate: the solver against theory and experiments, as a Markdown table, with plots.
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "bench/commands.h"
#include "compare/report/plot_svg.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/output_files.h"
#include "core/system/stopwatch.h"
#include "experiments/process/common_options.h"
#include "experiments/process/process.h"
#include "validation/case.h"

namespace graupel::bench {

using namespace experiments;

namespace {

using validation::Check;
using validation::Measure;

struct BenchValidateOptions {
  CommonOptions common;
  std::vector<std::string> cases;
  bool full = false, list = false;
  std::string plots;
};

const char* word_of_measure(Measure measure) {
  switch (measure) {
    case Measure::relative:
      return "relative";
    case Measure::absolute:
      return "absolute";
    case Measure::at_most:
      return "at most";
    default:
      return "at least";
  }
}

std::string tolerance_text(const Check& check) {
  if (check.measure == Measure::relative) return fmt::format("{:.3g} %", 100 * check.tolerance);
  if (check.measure == Measure::absolute) return fmt::format("{:.3g}", check.tolerance);
  return word_of_measure(check.measure);
}

std::string error_text(const Check& check) {
  if (check.measure == Measure::relative) return fmt::format("{:+.2g} %", 100 * check.error());
  return check.measure == Measure::absolute ? fmt::format("{:+.2g}", check.error()) : "";
}

void print_row(const std::string& name, const Check& check) {
  std::printf("| %s | %s | %.5g | %.5g | %s | %s | %s |\n", name.c_str(), check.quantity.c_str(), check.measured,
              check.reference, error_text(check).c_str(), tolerance_text(check).c_str(),
              check.passed() ? "yes" : "**NO**");
}

nlohmann::ordered_json json_of(const Check& check) {
  return {{"quantity", check.quantity}, {"measured", check.measured},   {"reference", check.reference},
          {"error", check.error()},     {"tolerance", check.tolerance}, {"measure", word_of_measure(check.measure)},
          {"passed", check.passed()}};
}

compare::Plot plot_of(const validation::Figure& figure) {
  compare::Plot plot;
  plot.title = figure.title;
  plot.x_label = figure.x_label;
  plot.y_label = figure.y_label;
  plot.standalone = true;
  if (figure.y_scale == validation::Scale::logarithmic) plot.y_axis = compare::Axis::logarithmic;
  for (const validation::Curve& curve : figure.curves)
    plot.lines.push_back({curve.label, curve.x, curve.y, curve.role == validation::CurveRole::reference});
  return plot;
}

void write_plots(const std::string& folder, const std::string& name, const std::vector<validation::Figure>& figures) {
  make_folder(folder);
  for (std::size_t i = 0; i < figures.size(); ++i) {
    const std::string number = i == 0 ? "" : fmt::format("-{}", i + 1);
    write_file_atomically(fmt::format("{}/{}{}.svg", folder, name, number), compare::plot_svg(plot_of(figures[i])));
  }
}

/// Runs one case and prints its rows. A run that diverges is a failed case.
nlohmann::ordered_json run_case(const BenchValidateOptions& options, const validation::Case& c) {
  validation::RunOptions run;
  run.form = options.full ? validation::Form::full : validation::Form::quick;
  run.between_frames = [] { stop_if_interrupted(); };
  const Stopwatch watch;
  validation::Outcome outcome;
  std::string trouble;
  try {
    outcome = c.run(run);
  } catch (const DivergedError& error) {
    trouble = error.what();
    std::printf("| %s | %s | | | | | **NO** |\n", c.name.c_str(), trouble.c_str());
  }
  for (const Check& check : outcome.checks) print_row(c.name, check);
  std::fflush(stdout);
  if (!options.plots.empty()) write_plots(options.plots, c.name, outcome.figures);
  nlohmann::ordered_json checks = nlohmann::ordered_json::array();
  for (const Check& check : outcome.checks) checks.push_back(json_of(check));
  return {{"name", c.name},   {"title", c.title},           {"reference", c.reference}, {"passed", outcome.passed()},
          {"error", trouble}, {"seconds", watch.seconds()}, {"checks", checks}};
}

void list_cases() {
  for (const validation::Case& c : validation::cases())
    std::printf("%-18s %s (%s)\n", c.name.c_str(), c.title.c_str(), c.reference.c_str());
}

void bench_validate(BenchValidateOptions& options) {
  if (options.list) return list_cases();
  options.common.apply();
  if (options.common.device == "cuda")
    throw ConfigError("--device cuda is not usable here (the cases run in f64 on the CPU). Use --device cpu");
  if (options.common.seed_given)
    throw ConfigError("--seed has no effect here (every case places its particles itself). Leave it out");
  check_output_folder(options.plots);
  std::vector<validation::Case> chosen;
  for (const std::string& name : options.cases) chosen.push_back(validation::case_named(name));
  if (chosen.empty()) chosen = validation::cases();
  std::printf(
      "| case | quantity | measured | reference | error | tolerance | passed |\n|---|---|---|---|---|---|---|\n");
  nlohmann::ordered_json results = nlohmann::ordered_json::array();
  std::string failed;
  for (const validation::Case& c : chosen) {
    results.push_back(run_case(options, c));
    if (!results.back()["passed"].get<bool>()) failed += (failed.empty() ? "" : ", ") + c.name;
  }
  options.common.write_json({{"version", version_text()},
                             {"command", command_line()},
                             {"form", options.full ? "long" : "short"},
                             {"cases", results}});
  if (!failed.empty()) throw Error(ExitCode::failed, "outside the tolerance: " + failed);
}

}  // namespace

void add_validate(const Command& program) {
  auto options = std::make_shared<BenchValidateOptions>();
  const Command verb = program.command("validate", "Figures of the solver beside those of theory and experiments");
  verb.option("--case", options->cases, "Names of cases (repeatable; default: all)");
  verb.flag("--list", options->list, "List the cases and end");
  verb.flag("--long", options->full, "The long forms, at the references' resolution: minutes a case");
  verb.option("--plots", options->plots, "Write a plot of every case as SVG into this folder").names_folder();
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel bench validate\n"
      "  graupel bench validate --long --case dam_break --plots plots --json dam_break.json");
  verb.callback([options] { bench_validate(*options); });
}

}  // namespace graupel::bench
