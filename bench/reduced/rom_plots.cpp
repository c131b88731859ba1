#include "bench/reduced/rom_plots.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "compare/report/plot_svg.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"

namespace graupel::bench {

namespace {

using Json = nlohmann::ordered_json;

std::string name_of(const Json& result) {
  const std::filesystem::path data = result.at("data").get<std::string>();
  return (data.has_filename() ? data : data.parent_path()).filename();
}

/// Percent of the displacement; a run that diverged has no error.
double error_of(const Json& row) { return 100 * row.at("displacement_relative_error").get<double>(); }
bool finished(const Json& row) { return row.contains("displacement_relative_error"); }

compare::Plot trust_plot(const std::vector<Json>& results) {
  compare::Plot plot =
      compare::file_plot("Verdict number and true error of a run", "trust number (1: as in the training's roll-outs)",
                         "error, % of the displacement", 380);
  std::map<std::string, compare::PlotLine> sets;
  for (const Json& result : results)
    for (const Json& row : result.at("rows")) {
      if (!finished(row)) continue;
      compare::PlotLine& line = sets[name_of(result)];
      line.x.push_back(row.at("trust").at("number").get<double>());
      line.y.push_back(error_of(row));
    }
  for (auto& [name, line] : sets) {
    line.label = name;
    line.style = compare::LineStyle::points;
    plot.lines.push_back(std::move(line));
  }
  return plot;
}

compare::Plot modes_plot(const Json& result) {
  compare::Plot plot =
      compare::file_plot(name_of(result) + ": decay of the modes", "mode", "singular value over the first", 320);
  for (const auto& [field, values] : result.at("singular_values").items()) {
    compare::PlotLine line;
    line.label = field;
    for (std::size_t k = 0; k < std::min<std::size_t>(values.size(), 128); ++k) {
      line.x.push_back(static_cast<double>(k + 1));
      line.y.push_back(values[k].get<double>() / values[0].get<double>());
    }
    plot.lines.push_back(std::move(line));
  }
  return plot;
}

/// Numbers that a row was measured with: settings of the training, samples, step factor.
std::map<std::string, double> settings_of(const Json& result, const Json& row) {
  std::map<std::string, double> settings;
  for (const auto& [key, value] : result.at("settings").items())
    if (value.is_number()) settings[key] = value.get<double>();
  settings["samples"] = row.at("samples").get<double>();
  settings["step_factor"] = row.at("step_factor").get<double>();
  return settings;
}

struct SettingPoint {
  std::map<std::string, double> settings;
  double error = 0;
};

/// Errors over one setting while the others are those of most rows.
void add_setting_lines(const std::string& name, const std::vector<SettingPoint>& points,
                       std::map<std::string, compare::Plot>& plots) {
  std::map<std::string, std::map<double, int>> counts;
  for (const SettingPoint& point : points)
    for (const auto& [key, value] : point.settings) ++counts[key][value];
  std::map<std::string, double> usual;
  for (const auto& [key, of] : counts)
    usual[key] =
        std::max_element(of.begin(), of.end(), [](const auto& a, const auto& b) { return a.second < b.second; })->first;
  for (const auto& [key, of] : counts) {
    if (of.size() < 2) continue;
    std::map<double, std::vector<double>> errors;
    for (const SettingPoint& point : points) {
      auto others = point.settings;
      others[key] = usual[key];
      if (others == usual) errors[point.settings.at(key)].push_back(point.error);
    }
    if (errors.size() < 2) continue;
    compare::PlotLine line;
    line.label = name;
    for (const auto& [value, of_value] : errors) {
      double sum = 0;
      for (const double e : of_value) sum += e;
      line.x.push_back(value);
      line.y.push_back(sum / static_cast<double>(of_value.size()));
    }
    plots
        .try_emplace(key, compare::file_plot("Mean error of the test runs over " + key, key,
                                             "error, % of the displacement", 360))
        .first->second.lines.push_back(std::move(line));
  }
}

std::map<std::string, compare::Plot> setting_plots(const std::vector<Json>& results) {
  std::map<std::string, std::vector<SettingPoint>> points;
  for (const Json& result : results)
    for (const Json& row : result.at("rows"))
      if (finished(row)) points[name_of(result)].push_back({settings_of(result, row), error_of(row)});
  std::map<std::string, compare::Plot> plots;
  for (const auto& [name, of] : points) add_setting_lines(name, of, plots);
  return plots;
}

}  // namespace

std::vector<std::string> write_rom_plots(const std::vector<Json>& results, const std::string& folder) {
  std::vector<std::string> files;
  const auto write = [&](const std::string& name, const compare::Plot& plot) {
    files.push_back(folder + "/" + name + ".svg");
    write_file_atomically(files.back(), compare::plot_svg(plot));
  };
  make_folder(folder);
  try {
    write("trust", trust_plot(results));
    std::set<std::string> known;
    for (const Json& result : results)
      if (!result.at("singular_values").empty() && known.insert(name_of(result)).second)
        write("modes-" + name_of(result), modes_plot(result));
    for (const auto& [setting, plot] : setting_plots(results)) write("errors-" + setting, plot);
  } catch (const Json::exception& error) {
    throw InputError(std::string("the results cannot be plotted (") + error.what() +
                     "). Make them with 'graupel bench rom --json'");
  }
  return files;
}

}  // namespace graupel::bench
