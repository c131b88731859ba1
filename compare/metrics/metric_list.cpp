#include "compare/metrics/metric_list.h"

#include <algorithm>
#include <cmath>

namespace graupel::compare {

const std::vector<MetricInfo>& metric_list() {
  using enum MetricGroup;
  static const std::vector<MetricInfo> list = {
      {"position_mse_20", "m^2", "mean squared distance to the true particle, first 20 frames", rollout},
      {"position_mse_100", "m^2", "the same, first 100 frames", rollout},
      {"position_mse_all", "m^2", "the same, all frames", rollout},
      {"delta", "", "distances to the true particles over their positions (Neural Stress Fields, eq. 11)", rollout},
      {"displacement_relative_error", "", "distances to the true particles over their displacements", rollout},
      {"sinkhorn", "m^2", "Sinkhorn divergence of the particle clouds", rollout},
      {"density_error", "", "relative L1 error of the density grid", rollout},
      {"occupancy_iou", "", "overlap of the occupied grid nodes, 1 is best", rollout},
      {"material_occupancy_iou", "", "the same of each material's own nodes, mean over the materials", rollout},
      {"local_density_error", "", "distance of the distributions of local density over that at rest", rollout},
      {"clump_size_error", "decades", "distance of the distributions of clump sizes", rollout},
      {"clumps", "", "clumps of all materials", rollout},
      {"clumps_truth", "", "the same of the truth", rollout},
      {"kinetic_energy_error", "", "mean error of the kinetic energy over its true maximum", rollout},
      {"kinetic_energy_mse", "J^2", "mean squared error of the kinetic energy", rollout},
      {"center_of_mass_error", "m", "distance of the materials' centres of mass", rollout},
      {"front_error", "m", "error of the materials' fronts", rollout},
      {"penetration_mean", "m", "mean depth inside obstacles", rollout},
      {"penetration_max", "m", "largest depth inside an obstacle", rollout},
      {"inside_share", "", "share of particles inside obstacles", rollout},
      {"outside_walls_share", "", "share of particles beyond the walls", rollout},
      {"outside_domain_max", "particles", "most particles outside the domain in a frame", rollout},
      {"one_step_mse", "m^2", "squared error of the next frame's acceleration", one_step},
      {"one_step_mse_zero", "m^2", "the same for acceleration 0", one_step},
      {"one_step_mse_ballistic", "m^2", "the same for gravity alone", one_step},
      {"one_step_normalized", "", "one_step_mse over the variance of the true acceleration", one_step},
      {"one_step_normalized_zero", "", "the same for acceleration 0", one_step},
      {"one_step_normalized_ballistic", "", "the same for gravity alone", one_step},
      {"one_step_mse_airborne", "m^2", "one_step_mse of airborne particles", one_step},
      {"one_step_mse_near_obstacle", "m^2", "one_step_mse of particles near obstacles and walls", one_step},
      {"one_step_mse_bulk", "m^2", "one_step_mse of the other particles", one_step},
      {"one_step_share_airborne", "", "share of airborne particles", one_step},
      {"one_step_share_near_obstacle", "", "share of particles near obstacles and walls", one_step},
      {"one_step_share_bulk", "", "share of the other particles", one_step},
      {"particles", "", "particles that the model moves", cost},
      {"frame_ms", "ms", "median time of a frame by the caller's clock", cost},
      {"gpu_events_ms", "ms", "median time of a network's frame by events on the GPU; 0 elsewhere", cost},
      {"network_ms", "ms", "of it the network, or decoding and inverting the fields", cost},
      {"grid_build_ms", "ms", "of it the grid hierarchy, or the grid's step of a reduced-order model", cost},
      {"features_ms", "ms", "of it the features, or the search for integration points", cost},
      {"projection_ms", "ms", "of it integration and projection", cost},
      {"output_ms", "ms", "median time of handing out a frame, not in frame_ms", cost},
      {"speed_ratio", "", "frame_ms of mpm over frame_ms", cost},
      {"substeps_per_frame", "", "mean number of steps a frame", cost},
      {"bundle", "", "frames that a graph network predicts at once; their cost is spread over them", cost},
      {"step_search_s", "s", "wall time of the search for the largest stable step, not in frame_ms", cost},
      {"peak_memory_mib", "MiB", "largest resident memory of the process during the run", cost},
      {"added_memory_mib", "MiB", "of it more than before the run", cost},
      {"model_memory_mib", "MiB", "what the model takes: that without the kept frames, with the weights; a GPU's there",
       cost},
      {"loses_to_coarse", "",
       "1 when worse than the coarse grid in two of position MSE, Sinkhorn divergence and density error", cost},
      {"floor_position_mse_20", "m^2", "position_mse_20 of MPM with particles moved by 1e-4 dx", floors},
      {"floor_position_mse_100", "m^2", "position_mse_100 of the same", floors},
      {"floor_position_mse_all", "m^2", "position_mse_all of the same", floors},
      {"floor_sinkhorn", "m^2", "sinkhorn of MPM with another sampling seed", floors},
      {"floor_density_error", "", "density_error of the same", floors},
      {"floor_occupancy_iou", "", "occupancy_iou of the same", floors},
      {"floor_material_occupancy_iou", "", "material_occupancy_iou of the same", floors},
      {"floor_local_density_error", "", "local_density_error of the same", floors},
      {"floor_clump_size_error", "decades", "clump_size_error of the same", floors},
      {"floor_kinetic_energy_error", "", "kinetic_energy_error of the same", floors},
      {"floor_center_of_mass_error", "m", "center_of_mass_error of the same", floors},
      {"floor_front_error", "m", "front_error of the same", floors},
      {"ratio_position_mse_all", "", "position_mse_all beyond its floor over the opponent's", ratios},
      {"ratio_sinkhorn", "", "sinkhorn beyond its floor over the opponent's", ratios},
      {"ratio_density_error", "", "density_error beyond its floor over the opponent's", ratios},
      {"ratio_frame_ms", "", "frame_ms over the opponent's", ratios},
  };
  return list;
}

const std::vector<MetricInfo>& material_metric_list() {
  using enum MetricGroup;
  static const std::vector<MetricInfo> list = {
      {"particles", "", "particles of the material", rollout},
      {"position_mse_all", "m^2", "mean squared distance to the true particle, all frames", rollout},
      {"sinkhorn", "m^2", "Sinkhorn divergence of the particle clouds", rollout},
      {"center_of_mass_error", "m", "distance of the centres of mass", rollout},
      {"front_error", "m", "error of the front", rollout},
      {"front_final", "m", "front in the last frame", rollout},
      {"front_final_truth", "m", "front of the truth in the last frame", rollout},
      {"occupancy_iou", "", "overlap of the grid nodes that the material occupies, 1 is best", rollout},
      {"local_density_error", "", "distance of the distributions of its local density over that at rest", rollout},
      {"clump_size_error", "decades", "distance of the distributions of its clumps' sizes", rollout},
      {"clumps", "", "its clumps", rollout},
      {"clumps_truth", "", "the same of the truth", rollout},
  };
  return list;
}

std::vector<std::string> missing_metrics(const std::vector<MetricInfo>& list, const std::vector<MetricGroup>& groups,
                                         const MetricValues& values) {
  std::vector<std::string> missing;
  for (const MetricInfo& metric : list) {
    if (std::find(groups.begin(), groups.end(), metric.group) == groups.end()) continue;
    const auto value = values.find(metric.key);
    if (value == values.end() || !std::isfinite(value->second)) missing.push_back(metric.key);
  }
  return missing;
}

}  // namespace graupel::compare
