#include "compare/report/plot_svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace graupel::compare {

const char* series_color(std::size_t k) {
  static constexpr const char* colors[] = {"#4e9af1", "#f08a3c", "#3fb57c", "#e05d6f",
                                           "#a883e8", "#c9a227", "#45b8c4", "#d178b8"};
  return colors[k % 8];
}

std::string escape_markup(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

namespace {

struct Bounds {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void include(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
  bool empty() const { return !(low <= high); }
};

/// 1, 2 or 5 times a power of ten that cuts `span` into about `parts`.
double nice_step(double span, int parts) {
  const double rough = span / parts, power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= rough) return factor * power;
  return 10 * power;
}

/// One axis: range in plotted units (log10 for logarithmic ones) and the values of its ticks.
struct Scale {
  Axis axis = Axis::linear;
  double low = 0, high = 1;
  std::vector<double> ticks;

  bool shows(double v) const { return std::isfinite(v) && (axis == Axis::linear || v > 0); }
  double plotted(double v) const { return axis == Axis::linear ? v : std::log10(v); }
  double fraction(double v) const { return (plotted(v) - low) / (high - low); }
};

Scale make_scale(Axis axis, const Bounds& data, bool from_zero) {
  Scale scale;
  scale.axis = axis;
  if (!data.empty()) {
    scale.low = from_zero ? std::min(0.0, data.low) : data.low;
    scale.high = data.high;
  }
  if (axis == Axis::logarithmic) {
    scale.low = std::floor(scale.low);
    scale.high = std::ceil(scale.high);
    if (scale.high <= scale.low) scale.high = scale.low + 1;
    const double step = std::max(1.0, std::ceil((scale.high - scale.low) / 6));
    for (double t = scale.low; t <= scale.high + 1e-9; t += step) scale.ticks.push_back(std::pow(10.0, t));
    return scale;
  }
  if (!(scale.high > scale.low)) scale.high = scale.low + 1;
  const double step = nice_step(scale.high - scale.low, 5);
  scale.high = std::ceil(scale.high / step - 1e-9) * step;
  for (double t = std::ceil(scale.low / step) * step; t <= scale.high + 1e-9 * step; t += step)
    scale.ticks.push_back(std::abs(t) < 1e-9 * step ? 0 : t);
  return scale;
}

constexpr int left = 62, right = 14, top = 30, bottom = 40;

class Painter {
 public:
  explicit Painter(const Plot& plot) : plot_(plot) {
    Bounds x, y;
    Scale raw;
    raw.axis = plot.y_axis;
    for (const PlotLine& line : plot.lines)
      for (std::size_t i = 0; i < line.x.size(); ++i)
        if (std::isfinite(line.x[i]) && raw.shows(line.y[i])) {
          x.include(line.x[i]);
          y.include(raw.plotted(line.y[i]));
        }
    x_ = make_scale(Axis::linear, x, true);
    y_ = make_scale(plot.y_axis, y, plot.y_axis == Axis::linear);
  }

  std::string paint() {
    out_ = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
        "font-family=\"sans-serif\" font-size=\"11\" fill=\"currentColor\" role=\"img\"{3}>\n<title>{2}</title>\n",
        plot_.width, plot_.height + legend_height(), escape_markup(plot_.title),
        plot_.standalone ? " style=\"background:#fff;color:#222\"" : "");
    axes();
    for (std::size_t k = 0; k < plot_.lines.size(); ++k) line(plot_.lines[k], k);
    legend();
    return out_ + "</svg>\n";
  }

 private:
  double px(double x) const { return left + x_.fraction(x) * (plot_.width - left - right); }
  double py(double y) const { return plot_.height - bottom - y_.fraction(y) * (plot_.height - top - bottom); }
  /// Two labels a row, or one where one is long.
  std::size_t legend_columns() const {
    const auto is_long = [&](const PlotLine& l) { return l.label.size() > (plot_.width > 400 ? 34u : 20u); };
    return std::any_of(plot_.lines.begin(), plot_.lines.end(), is_long) ? 1 : 2;
  }
  int legend_height() const {
    return 16 * static_cast<int>((plot_.lines.size() + legend_columns() - 1) / legend_columns());
  }
  static const char* dashes(const PlotLine& l) {
    return l.style == LineStyle::dotted ? " stroke-dasharray=\"2 3\"" : l.dashed ? " stroke-dasharray=\"5 4\"" : "";
  }

  void text(double x, double y, const char* anchor, const std::string& content, const char* more = "") {
    out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" {}>{}</text>\n", x, y, anchor, more,
                        escape_markup(content));
  }

  void axes() {
    text(left, 16, "start", plot_.title, "font-weight=\"bold\"");
    for (const double t : y_.ticks) {
      out_ += fmt::format(
          "<line x1=\"{}\" x2=\"{}\" y1=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"currentColor\" stroke-opacity=\"0.18\"/>\n",
          left, plot_.width - right, py(t), py(t));
      text(left - 6, py(t) + 4, "end", fmt::format("{:.4g}", t));
    }
    for (const double t : x_.ticks) text(px(t), plot_.height - bottom + 15, "middle", fmt::format("{:.4g}", t));
    out_ += fmt::format("<path d=\"M{} {}V{}H{}\" fill=\"none\" stroke=\"currentColor\" stroke-opacity=\"0.6\"/>\n",
                        left, top, plot_.height - bottom, plot_.width - right);
    text(0.5 * (left + plot_.width - right), plot_.height - 8, "middle", plot_.x_label);
    const double middle = 0.5 * (top + plot_.height - bottom);
    text(13, middle, "middle", plot_.y_label, fmt::format("transform=\"rotate(-90 13 {:.1f})\"", middle).c_str());
  }

  void points(const PlotLine& l, std::size_t k) {
    for (std::size_t i = 0; i < l.x.size(); ++i)
      if (std::isfinite(l.x[i]) && y_.shows(l.y[i]))
        out_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.2\" fill=\"{}\" fill-opacity=\"0.8\"/>\n",
                            px(l.x[i]), py(l.y[i]), series_color(k));
  }

  void line(const PlotLine& l, std::size_t k) {
    if (l.style == LineStyle::points) return points(l, k);
    std::string path;
    bool pen_down = false;
    for (std::size_t i = 0; i < l.x.size(); ++i) {
      const bool shown = std::isfinite(l.x[i]) && y_.shows(l.y[i]);
      if (shown) path += fmt::format("{}{:.1f} {:.1f}", pen_down ? 'L' : 'M', px(l.x[i]), py(l.y[i]));
      pen_down = shown;
    }
    if (path.empty()) return;
    if (l.style == LineStyle::area) return area(l, path);
    out_ +=
        fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\" stroke-linejoin=\"round\"{}/>\n",
                    path, series_color(k), dashes(l));
  }

  /// Down to the axis, from where the line begins to where it ends.
  void area(const PlotLine& l, const std::string& path) {
    Bounds shown;
    for (std::size_t i = 0; i < l.x.size(); ++i)
      if (std::isfinite(l.x[i]) && y_.shows(l.y[i])) shown.include(l.x[i]);
    out_ += fmt::format("<path d=\"{}V{}H{:.1f}Z\" fill=\"currentColor\" fill-opacity=\"0.13\" stroke=\"none\"/>\n",
                        path, plot_.height - bottom, px(shown.low));
  }

  void legend() {
    for (std::size_t k = 0; k < plot_.lines.size(); ++k) {
      const std::size_t row = k / legend_columns(), column = k % legend_columns();
      const double x = left + static_cast<double>(column) * 0.5 * (plot_.width - left - right);
      const double y = plot_.height + 16 * static_cast<double>(row) + 4;
      if (plot_.lines[k].style == LineStyle::area)
        out_ += fmt::format(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"20\" height=\"10\" fill=\"currentColor\" "
            "fill-opacity=\"0.25\"/>\n",
            x, y - 5);
      else
        out_ += fmt::format(
            "<line x1=\"{0:.1f}\" x2=\"{1:.1f}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\" stroke=\"{3}\" "
            "stroke-width=\"2.5\"{4}/>\n",
            x, x + 20, y, series_color(k), dashes(plot_.lines[k]));
      text(x + 26, y + 4, "start", plot_.lines[k].label);
    }
  }

  const Plot& plot_;
  Scale x_, y_;
  std::string out_;
};

}  // namespace

std::string plot_svg(const Plot& plot) { return Painter(plot).paint(); }

}  // namespace graupel::compare
