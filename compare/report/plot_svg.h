// Line plots as SVG text, for the report: linear or logarithmic axes, grid lines, legend.
#pragma once

#include <string>
#include <vector>

namespace graupel::compare {

enum class Axis { linear, logarithmic };
/// `dotted` is for what must be read with care, `area` for a noise floor: grey below the line.
enum class LineStyle { line, points, dotted, area };

struct PlotLine {
  std::string label;
  std::vector<double> x, y;  ///< same length; points that the axes cannot show are left out
  bool dashed = false;       ///< for references
  LineStyle style = LineStyle::line;
};

struct Plot {
  std::string title, x_label, y_label;
  Axis y_axis = Axis::linear;
  std::vector<PlotLine> lines;
  int width = 390, height = 280;  ///< [pixels]
  bool standalone = false;        ///< a file of its own: dark on white, whatever shows it
};

/// One without lines for a file of its own, with a logarithmic axis.
inline Plot file_plot(const std::string& title, const std::string& x_label, const std::string& y_label, int height) {
  return {title, x_label, y_label, Axis::logarithmic, {}, 560, height, true};
}

/// An <svg> element. Text and axes take the page's colour (currentColor), so that it reads on dark and light pages.
std::string plot_svg(const Plot& plot);

/// Text for HTML and XML: & < > " ' replaced by entities.
std::string escape_markup(const std::string& text);

/// Colour of series k as "#rrggbb"; they repeat after eight.
const char* series_color(std::size_t k);

}  // namespace graupel::compare
