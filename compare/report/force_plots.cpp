#include "compare/report/force_plots.h"

#include <algorithm>
#include <numeric>

namespace graupel::compare {

namespace {

constexpr std::size_t most_lines = 8;     ///< colours repeat after as many
constexpr std::size_t most_plots = 4;     ///< of one quantity
constexpr std::size_t most_points = 200;  ///< of a line

struct Quantity {
  const char *title, *unit;
  Vec3d ContactForce::*value;
};
constexpr Quantity quantities[] = {{"Force on ", "mean of the frame [N]", &ContactForce::force},
                                   {"Torque on ", "mean of the frame [N m]", &ContactForce::torque}};

/// Places of the obstacles and walls with the largest peaks of a quantity, the largest first.
std::vector<std::size_t> most_loaded(const ContactForces& forces, Vec3d ContactForce::*quantity, std::size_t most) {
  std::vector<double> peak(forces.names.size(), 0.0);
  for (const std::vector<ContactForce>& frame : forces.frames)
    for (std::size_t i = 0; i < peak.size(); ++i) peak[i] = std::max(peak[i], norm(frame[i].*quantity));
  std::vector<std::size_t> order(peak.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return peak[a] > peak[b]; });
  std::erase_if(order, [&](std::size_t i) { return !(peak[i] > 0); });
  order.resize(std::min(order.size(), most));
  return order;
}

PlotLine line_of(const std::string& label, const ContactForces& forces, std::size_t i, Vec3d ContactForce::*quantity) {
  PlotLine line;
  line.label = label;
  const std::size_t stride = std::max<std::size_t>(1, forces.frames.size() / most_points);
  for (std::size_t frame = 1; frame < forces.frames.size(); frame += stride) {
    line.x.push_back(static_cast<double>(frame));
    line.y.push_back(norm(forces.frames[frame][i].*quantity));
  }
  return line;
}

Plot empty_plot(const std::string& title, const char* unit) {
  return {.title = title, .x_label = "frame", .y_label = unit, .lines = {}};
}

std::vector<Plot> plots_of_one(const NamedForces& run) {
  std::vector<Plot> plots;
  for (const Quantity& q : quantities) {
    Plot plot = empty_plot(q.title + std::string("obstacles and walls (") + run.first + ")", q.unit);
    for (const std::size_t i : most_loaded(run.second, q.value, most_lines))
      plot.lines.push_back(line_of(run.second.names[i], run.second, i, q.value));
    if (!plot.lines.empty()) plots.push_back(std::move(plot));
  }
  return plots;
}

}  // namespace

std::vector<Plot> force_plots(const std::vector<NamedForces>& runs) {
  std::vector<NamedForces> known;
  std::copy_if(runs.begin(), runs.end(), std::back_inserter(known),
               [](const NamedForces& run) { return !run.second.names.empty(); });
  if (known.empty()) return {};
  if (known.size() == 1) return plots_of_one(known.front());
  std::vector<Plot> plots;
  const ContactForces& first = known.front().second;
  for (const Quantity& q : quantities)
    for (const std::size_t i : most_loaded(first, q.value, most_plots)) {
      Plot plot = empty_plot(q.title + first.names[i], q.unit);
      for (const auto& [name, forces] : known) plot.lines.push_back(line_of(name, forces, i, q.value));
      plots.push_back(std::move(plot));
    }
  return plots;
}

}  // namespace graupel::compare
