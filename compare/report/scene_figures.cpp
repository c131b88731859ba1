#include "compare/report/scene_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compare/report/base64.h"
#include "compare/report/force_plots.h"
#include "compare/report/plot_svg.h"

namespace graupel::compare {

namespace {

/// A curve over the frames 1.., at most 200 points of it.
PlotLine curve_line(const std::string& label, const std::vector<double>& curve, LineStyle style = LineStyle::line) {
  PlotLine line;
  line.label = label;
  line.style = style;
  const std::size_t stride = std::max<std::size_t>(1, curve.size() / 200);
  for (std::size_t k = 0; k < curve.size(); k += stride) {
    line.x.push_back(static_cast<double>(k + 1));
    line.y.push_back(curve[k]);
  }
  return line;
}

std::vector<double> roots(std::vector<double> curve) {
  for (double& v : curve) v = std::sqrt(v);
  return curve;
}

std::string force_figures(const SceneResult& scene, const std::vector<std::string>& models) {
  std::vector<NamedForces> runs = {{"truth", scene.true_forces}};
  bool others = false;  // that record none
  for (const ModelResult& result : scene.models) {
    if (is_truth(scene, result)) continue;
    runs.emplace_back(short_name(result.model, models), result.forces);
    others = others || result.forces.names.empty();
  }
  const std::vector<Plot> plots = force_plots(runs);
  if (plots.empty()) return "";
  const bool truth_alone =
      std::all_of(runs.begin() + 1, runs.end(), [](const NamedForces& run) { return run.second.names.empty(); });
  std::string html = "<figure class=\"plots\">\n";
  for (const Plot& plot : plots) html += plot_svg(plot);
  html += "<figcaption class=\"soft\">What the matter does to obstacles and walls.";
  if (truth_alone) html += " <code>--forces</code> records that of the compared runs of MPM too.";
  if (others)
    html += " Networks, reduced-order models and baselines move particles without forces, so they have no line.";
  return html + "</figcaption></figure>\n";
}

std::string picture(const std::string& png, const std::string& description) {
  if (png.empty()) return "";
  return fmt::format("<img alt=\"{}\" src=\"data:image/png;base64,{}\">\n", escape_markup(description),
                     encode_base64(png));
}

}  // namespace

std::string scene_plots(const SceneResult& scene, const std::vector<std::string>& models) {
  Plot position{.title = "Position error (lower is better)",
                .x_label = "frame",
                .y_label = "root mean square [m]",
                .y_axis = Axis::logarithmic,
                .lines = {}};
  Plot density{.title = "Density error (lower is better)", .x_label = "frame", .y_label = "relative L1", .lines = {}};
  Plot energy{.title = "Kinetic energy", .x_label = "frame", .y_label = "kinetic energy [J]", .lines = {}};
  for (const ModelResult& result : scene.models) {
    if (is_truth(scene, result)) continue;
    const bool outside = !result.remarks.empty();
    const std::string name = short_name(result.model, models) + (outside ? " (outside its training)" : "");
    const LineStyle style = outside ? LineStyle::dotted : LineStyle::line;
    position.lines.push_back(curve_line(name, roots(result.curves.position), style));
    density.lines.push_back(curve_line(name, result.curves.density, style));
    energy.lines.push_back(curve_line(name, result.curves.kinetic_energy, style));
  }
  if (!scene.floor_position.empty()) {
    position.lines.push_back(curve_line("noise floor: moved by 1e-4 dx", roots(scene.floor_position), LineStyle::area));
    density.lines.push_back(curve_line("noise floor: another seed", scene.floor_density, LineStyle::area));
  }
  energy.lines.push_back(curve_line("truth", scene.true_energy));
  energy.lines.back().dashed = true;
  return "<div class=\"plots\">\n" + plot_svg(position) + plot_svg(density) + plot_svg(energy) + "</div>\n" +
         force_figures(scene, models);
}

std::string scene_pictures(const SceneResult& scene, const std::vector<std::string>& models) {
  if (scene.picture.empty()) return "<p class=\"soft\">Pictures left out to keep the file small.</p>\n";
  std::string html = "<div class=\"scroll pictures\">\n" + picture(scene.picture, scene.name + ", truth");
  for (const ModelResult& result : scene.models)
    if (!is_truth(scene, result)) html += picture(result.picture, scene.name + ", " + short_name(result.model, models));
  return html + "</div>\n";
}

}  // namespace graupel::compare
