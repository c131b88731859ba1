#include "experiments/inspection/training_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "compare/report/plot_svg.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"

namespace graupel::experiments {

namespace {

namespace fs = std::filesystem;
constexpr double not_measured = std::numeric_limits<double>::quiet_NaN();

fs::path metrics_of(const std::string& run_folder) { return fs::path(run_folder) / "metrics.csv"; }

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',')
      cells.emplace_back();
    else if (c != '\r')
      cells.back() += c;
  }
  return cells;
}

/// A comma-separated file with a line of names.
class Table {
 public:
  explicit Table(const fs::path& file) : file_(file.string()), in_(file) {
    std::string line;
    if (!std::getline(in_, line)) throw InputError("'" + file_ + "' cannot be read or is empty. Name a run folder");
    names_ = split(line);
  }

  std::size_t column(const std::string& name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found == names_.end())
      throw InputError("'" + file_ + "' has no column '" + name + "'. Name a run folder of a graph network");
    return static_cast<std::size_t>(found - names_.begin());
  }

  /// The next row; false at the end. The row that a killed run was writing, which no line end follows, is left out.
  bool next() {
    std::string line;
    if (!std::getline(in_, line) || in_.eof()) return false;
    ++row_;
    cells_ = split(line);
    if (cells_.size() != names_.size())
      throw InputError(fmt::format("'{}' has {} values in row {} (allowed: {}). Take the folder as it was written",
                                   file_, cells_.size(), row_, names_.size()));
    return true;
  }

  /// NaN for an empty cell.
  double value(std::size_t column) const {
    const std::string& text = cells_[column];
    double number = not_measured;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (!text.empty() && (error != std::errc() || end != text.data() + text.size()))
      throw InputError(fmt::format("'{}' has no number in row {}, column '{}': '{}'. Take the folder as it was written",
                                   file_, row_, names_[column], text));
    return number;
  }

 private:
  std::string file_;
  std::ifstream in_;
  std::vector<std::string> names_, cells_;
  int64_t row_ = 0;
};

nlohmann::ordered_json number_or_null(double value) {
  return std::isnan(value) ? nlohmann::ordered_json() : nlohmann::ordered_json(value);
}

/// Empty without any value.
std::string write_plot(const std::vector<TrainingCurve>& curves, double Validation::*value, const std::string& title,
                       const std::string& y_label, const fs::path& file) {
  compare::Plot plot = compare::file_plot(title, "minutes of training", y_label, 380);
  for (const TrainingCurve& curve : curves) {
    compare::PlotLine line;
    line.label = curve.name;
    for (const Validation& v : curve.validations) {
      if (std::isnan(v.*value)) continue;
      line.x.push_back(v.seconds / 60);
      line.y.push_back(v.*value);
    }
    if (!line.x.empty()) plot.lines.push_back(std::move(line));
  }
  if (plot.lines.empty()) return {};
  fs::create_directories(file.parent_path());
  write_file_atomically(file.string(), plot_svg(plot));
  return file.string();
}

}  // namespace

bool is_run_folder(const std::string& path) {
  std::error_code no_access;
  return fs::is_regular_file(metrics_of(path), no_access);
}

TrainingCurve read_training_curve(const std::string& run_folder) {
  const fs::path folder = fs::path(run_folder).lexically_normal();
  TrainingCurve curve;
  curve.name = (folder.has_filename() ? folder : folder.parent_path()).filename().string();
  Table table(metrics_of(run_folder));
  const std::size_t step = table.column("step"), seconds = table.column("seconds");
  const std::size_t error = table.column("valid_one_step_raw"), zero = table.column("valid_zero_raw"),
                    ballistic = table.column("valid_ballistic_raw"), rollout = table.column("valid_rollout_mse");
  while (table.next()) {
    Validation v{.step = table.value(step),
                 .seconds = table.value(seconds),
                 .one_step = table.value(error) / std::min(table.value(zero), table.value(ballistic)),
                 .rollout_mse = table.value(rollout)};
    if (!std::isnan(v.one_step) || !std::isnan(v.rollout_mse)) curve.validations.push_back(v);
  }
  return curve;
}

nlohmann::ordered_json to_json(const TrainingCurve& curve) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Validation& v : curve.validations)
    rows.push_back({{"step", v.step},
                    {"minutes", v.seconds / 60},
                    {"one_step_of_baseline", number_or_null(v.one_step)},
                    {"rollout_mse_m2", number_or_null(v.rollout_mse)}});
  return {{"kind", "training run"}, {"name", curve.name}, {"validations", rows}};
}

std::vector<std::string> write_training_plots(const std::vector<TrainingCurve>& curves, const std::string& folder) {
  std::vector<std::string> files = {write_plot(curves, &Validation::one_step, "One-step error on validation data",
                                               "of the better baseline's", fs::path(folder) / "one-step.svg"),
                                    write_plot(curves, &Validation::rollout_mse, "Rollouts of validation data",
                                               "position MSE [m²]", fs::path(folder) / "rollout.svg")};
  std::erase(files, "");
  return files;
}

}  // namespace graupel::experiments
