#include "compare/report/force_plots.h"

#include <algorithm>
#include <numeric>

namespace graupel::compare {

namespace {

constexpr std::size_t most_lines = 8;     ///< colours repeat after as many
constexpr std::size_t most_points = 200;  ///< of a line

/// Places of the obstacles and walls with the largest peaks of a quantity, the largest first.
std::vector<std::size_t> most_loaded(const ContactForces& forces, Vec3d ContactForce::*quantity) {
  std::vector<double> peak(forces.names.size(), 0.0);
  for (const std::vector<ContactForce>& frame : forces.frames)
    for (std::size_t i = 0; i < peak.size(); ++i) peak[i] = std::max(peak[i], norm(frame[i].*quantity));
  std::vector<std::size_t> order(peak.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return peak[a] > peak[b]; });
  std::erase_if(order, [&](std::size_t i) { return !(peak[i] > 0); });
  order.resize(std::min(order.size(), most_lines));
  return order;
}

}  // namespace

std::vector<Plot> force_plots(const ContactForces& forces) {
  std::vector<Plot> plots;
  const auto add = [&](const char* title, const char* unit, Vec3d ContactForce::*quantity) {
    Plot plot{.title = title, .x_label = "frame", .y_label = unit, .lines = {}};
    const std::size_t stride = std::max<std::size_t>(1, forces.frames.size() / most_points);
    for (const std::size_t i : most_loaded(forces, quantity)) {
      PlotLine line;
      line.label = forces.names[i];
      for (std::size_t frame = 1; frame < forces.frames.size(); frame += stride) {
        line.x.push_back(static_cast<double>(frame));
        line.y.push_back(norm(forces.frames[frame][i].*quantity));
      }
      plot.lines.push_back(std::move(line));
    }
    if (!plot.lines.empty()) plots.push_back(std::move(plot));
  };
  add("Force on obstacles and walls (truth)", "mean of the frame [N]", &ContactForce::force);
  add("Torque on obstacles and walls (truth)", "mean of the frame [N m]", &ContactForce::torque);
  return plots;
}

}  // namespace graupel::compare
