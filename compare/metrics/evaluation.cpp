#include "compare/metrics/evaluation.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "compare/metrics/clumps.h"
#include "compare/metrics/containment.h"
#include "compare/metrics/density_grid.h"
#include "compare/metrics/displacement_error.h"
#include "compare/metrics/kinetic_energy.h"
#include "compare/metrics/local_density.h"
#include "compare/metrics/material_shape.h"
#include "compare/metrics/optimal_transport.h"
#include "compare/metrics/position_error.h"
#include "compare/metrics/space.h"
#include "core/parallel/parallel_for.h"
#include "core/scene/material_config.h"
#include "core/system/error.h"

namespace graupel::compare {

namespace {

constexpr std::size_t transport_points = 500;
constexpr std::size_t sampled_frames = 5;  ///< of Sinkhorn divergence and clumps

double mean(const std::vector<double>& values) { return mean_of_first(values, values.size()); }

double mass_of(const ParticleRun& run, int32_t type) {
  double mass = 0;
  for (std::size_t i = 0; i < run.size(); ++i)
    if (run.trajectory.particle_type[i] == type) mass += run.mass[i];
  return mass;
}

/// Those of the frames 1..frames in which both runs have a material.
std::vector<std::size_t> common_frames(const ParticleRun& truth, const ParticleRun& run, std::size_t frames,
                                       int32_t type) {
  std::vector<std::size_t> common;
  for (std::size_t f = 1; f <= frames; ++f)
    if (truth.has_type(f, type) && run.has_type(f, type)) common.push_back(f);
  return common;
}

/// Evenly spaced ones of these, the last one among them.
std::vector<std::size_t> sample_of(const std::vector<std::size_t>& frames) {
  const std::size_t count = std::min(sampled_frames, frames.size());
  std::vector<std::size_t> sample;
  for (std::size_t k = 1; k <= count; ++k) sample.push_back(frames[k * frames.size() / count - 1]);
  return sample;
}

/// Particles of a material that are in the run in a frame.
struct MaterialFrame {
  std::vector<Vec3f> position;
  std::vector<double> mass, volume;
};

MaterialFrame material_frame(const ParticleRun& run, std::size_t frame, int32_t type) {
  MaterialFrame material;
  for (std::size_t i = 0; i < run.size(); ++i) {
    if (run.trajectory.particle_type[i] != type || !run.is_active(frame, i)) continue;
    material.position.push_back(run.position(frame)[i]);
    material.mass.push_back(run.mass[i]);
    material.volume.push_back(run.volume[i]);
  }
  return material;
}

std::vector<Vec3d> in_f64(const std::vector<Vec3f>& position) {
  std::vector<Vec3d> exact;
  exact.reserve(position.size());
  for (const Vec3f& x : position) exact.push_back(x.cast<double>());
  return exact;
}

/// Mean over the sampled frames.
double sinkhorn_of_material(const Scene& scene, const ParticleRun& truth, const ParticleRun& run,
                            const std::vector<std::size_t>& sample, int32_t type) {
  const Space space(scene.domain);
  std::vector<double> divergence(sample.size());
  const auto one_frame = [&](int64_t k) {
    const std::size_t frame = sample[static_cast<std::size_t>(k)];
    const MaterialFrame x = material_frame(truth, frame, type), y = material_frame(run, frame, type);
    WeightedPoints a, b;
    const double cell =
        bin_together(in_f64(x.position), x.mass, in_f64(y.position), y.mass, scene.domain.dx, transport_points, a, b);
    divergence[k] = sinkhorn_divergence(a, b, 4 * cell * cell, space);
  };
  parallel_for(Device::cpu, static_cast<int64_t>(sample.size()), one_frame, Grain{1});
  return mean(divergence);
}

/// Clumps and local density, means over the sampled frames.
void distribution_values(const Scene& scene, const ParticleRun& truth, const ParticleRun& run,
                         const std::vector<std::size_t>& sample, int32_t type, MetricValues& values) {
  const std::size_t count = sample.size();
  std::vector<double> size_error(count), clumps(count), true_clumps(count), density_error(count);
  const double dx = scene.domain.dx, unit = mass_of(truth, type);
  const Space space(scene.domain);
  const auto one_frame = [&](int64_t k) {
    const std::size_t frame = sample[static_cast<std::size_t>(k)];
    const MaterialFrame a = material_frame(truth, frame, type), b = material_frame(run, frame, type);
    const auto expected = clump_masses(a.position, a.mass, clump_radius * dx, space),
               got = clump_masses(b.position, b.mass, clump_radius * dx, space);
    size_error[k] = wasserstein_1(clump_sizes(expected, unit), clump_sizes(got, unit));
    true_clumps[k] = static_cast<double>(expected.size());
    clumps[k] = static_cast<double>(got.size());
    density_error[k] =
        wasserstein_1(local_density(a.position, a.volume, dx, space), local_density(b.position, b.volume, dx, space));
  };
  parallel_for(Device::cpu, static_cast<int64_t>(count), one_frame, Grain{1});
  values["local_density_error"] = mean(density_error);
  values["clump_size_error"] = mean(size_error);
  values["clumps"] = mean(clumps);
  values["clumps_truth"] = mean(true_clumps);
}

/// Where the fronts of a material are measured from: its centre in the first frame in which the truth has some.
Vec3d front_origin(const ParticleRun& truth, int32_t type, const Space& space) {
  for (std::size_t f = 0; f <= truth.predicted(); ++f)
    if (truth.has_type(f, type)) return center_of_mass(truth, f, type, space);
  return Vec3d::zero();
}

MetricValues material_values(const Scene& scene, const ParticleRun& truth, const ParticleRun& run, std::size_t frames,
                             int32_t type) {
  const int vertical = vertical_axis(scene.gravity);
  const Space space(scene.domain);
  const Vec3d start = front_origin(truth, type, space);
  const auto common = common_frames(truth, run, frames, type), sample = sample_of(common);
  std::vector<double> center, front;
  for (const std::size_t f : common) {
    center.push_back(norm(center_of_mass(run, f, type, space) - center_of_mass(truth, f, type, space)));
    front.push_back(std::abs(front_distance(run, f, type, start, vertical, space) -
                             front_distance(truth, f, type, start, vertical, space)));
  }
  const auto& types = run.trajectory.particle_type;
  MetricValues values = {{"particles", static_cast<double>(std::count(types.begin(), types.end(), type))},
                         {"sinkhorn", sinkhorn_of_material(scene, truth, run, sample, type)},
                         {"center_of_mass_error", mean(center)},
                         {"front_error", mean(front)},
                         {"front_final", front_distance(run, frames, type, start, vertical, space)},
                         {"front_final_truth", front_distance(truth, frames, type, start, vertical, space)}};
  distribution_values(scene, truth, run, sample, type, values);
  return values;
}

/// [n], 1 for the particles that are in both runs in a frame; empty: all.
std::vector<uint8_t> in_both(const ParticleRun& truth, const ParticleRun& run, std::size_t f) {
  if (truth.trajectory.frames[f].active.empty() && run.trajectory.frames[f].active.empty()) return {};
  std::vector<uint8_t> both(truth.size());
  for (std::size_t i = 0; i < both.size(); ++i) both[i] = truth.is_active(f, i) && run.is_active(f, i) ? 1 : 0;
  return both;
}

void displacement_values(const ParticleRun& truth, const ParticleRun& run, std::size_t frames, const Space& space,
                         MetricValues& values) {
  DisplacementError error(truth.position(0), space);
  for (std::size_t f = 1; f <= frames; ++f) error.add(truth.position(f), run.position(f), in_both(truth, run, f));
  values["delta"] = error.delta();
  values["displacement_relative_error"] = error.displacement_relative();
}

/// Of runs of the same particles.
void position_values(const Scene& scene, const ParticleRun& truth, const ParticleRun& run, std::size_t frames,
                     Evaluation& evaluation) {
  const Space space(scene.domain);
  evaluation.curves.position = position_error_curve(truth, run, -1, space);
  MetricValues& values = evaluation.values;
  values["position_mse_20"] = mean_of_first(evaluation.curves.position, 20);
  values["position_mse_100"] = mean_of_first(evaluation.curves.position, 100);
  values["position_mse_all"] = mean(evaluation.curves.position);
  displacement_values(truth, run, frames, space, values);
  for (const int32_t type : types_of(truth.trajectory))
    evaluation.materials[particle_type_name(type)]["position_mse_all"] =
        mean(position_error_curve(truth, run, type, space));
}

void density_values(const Scene& scene, const ParticleRun& truth, const ParticleRun& run, std::size_t frames,
                    Evaluation& evaluation) {
  const DensityGrid grid(scene.domain);
  const auto types = types_of(truth.trajectory);
  double overlap = 0;
  std::vector<double> own_overlap(types.size());
  for (std::size_t f = 1; f <= frames; ++f) {
    const auto expected = grid.spread(truth, f, types), got = grid.spread(run, f, types);
    evaluation.curves.density.push_back(DensityGrid::relative_l1(expected, got));
    overlap += DensityGrid::occupancy_iou(expected, got);
    for (std::size_t t = 0; t < types.size(); ++t) own_overlap[t] += DensityGrid::occupancy_iou(expected, got, t);
  }
  const auto n = static_cast<double>(frames);
  evaluation.values["density_error"] = mean(evaluation.curves.density);
  evaluation.values["occupancy_iou"] = overlap / n;
  for (std::size_t t = 0; t < types.size(); ++t)
    evaluation.materials[particle_type_name(types[t])]["occupancy_iou"] = own_overlap[t] / n;
}

/// Metrics of a run that are means of its materials', weighted by true mass, under the same or another name.
constexpr std::pair<const char*, const char*> means_of_materials[] = {{"sinkhorn", "sinkhorn"},
                                                                      {"center_of_mass_error", "center_of_mass_error"},
                                                                      {"front_error", "front_error"},
                                                                      {"material_occupancy_iou", "occupancy_iou"},
                                                                      {"local_density_error", "local_density_error"},
                                                                      {"clump_size_error", "clump_size_error"}};

void average_materials(const ParticleRun& truth, Evaluation& evaluation) {
  MetricValues& values = evaluation.values;
  const double total_mass = std::accumulate(truth.mass.begin(), truth.mass.end(), 0.0);
  for (const auto& [key, of_material] : means_of_materials) values[key] = 0;
  for (const char* key : {"clumps", "clumps_truth"}) values[key] = 0;
  for (const int32_t type : types_of(truth.trajectory)) {
    const MetricValues& material = evaluation.materials.at(particle_type_name(type));
    const double mass_fraction = mass_of(truth, type) / total_mass;
    for (const auto& [key, of_material] : means_of_materials) values[key] += mass_fraction * material.at(of_material);
    for (const char* key : {"clumps", "clumps_truth"}) values[key] += material.at(key);
  }
}

void energy_values(const Scene& scene, const ParticleRun& truth, const ParticleRun& run, Evaluation& evaluation) {
  const double mass = std::accumulate(truth.mass.begin(), truth.mass.end(), 0.0);
  const double smallest = std::max(1e-12, mass * norm(scene.gravity) * scene.domain.dx);
  const Space space(scene.domain);
  evaluation.curves.kinetic_energy = kinetic_energy_curve(run, space);
  const auto error =
      kinetic_energy_error(kinetic_energy_curve(truth, space), evaluation.curves.kinetic_energy, smallest);
  evaluation.values["kinetic_energy_error"] = error.relative;
  evaluation.values["kinetic_energy_mse"] = error.mean_squared;
}

}  // namespace

Evaluation evaluate_rollout(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, const ParticleRun& truth,
                            const ParticleRun& run) {
  const std::size_t frames = std::min(truth.predicted(), run.predicted());
  if (frames == 0) throw InputError("nothing to compare (a run has no frame after its start). Use --frames 1 or more");
  Evaluation evaluation;
  const auto types = types_of(truth.trajectory), run_types = types_of(run.trajectory);
  for (const int32_t type : types)
    if (std::find(run_types.begin(), run_types.end(), type) == run_types.end())
      throw InputError("the runs cannot be compared (one has no particle of type " + particle_type_name(type) +
                       "). Use runs of the same scene");
  for (const int32_t type : types)
    evaluation.materials[particle_type_name(type)] = material_values(scene, truth, run, frames, type);
  if (same_particles(truth, run)) position_values(scene, truth, run, frames, evaluation);
  density_values(scene, truth, run, frames, evaluation);
  average_materials(truth, evaluation);
  energy_values(scene, truth, run, evaluation);

  MetricValues& values = evaluation.values;
  const Containment inside = containment(scene, obstacles, run);
  values["penetration_mean"] = inside.mean_depth;
  values["penetration_max"] = inside.max_depth;
  values["inside_share"] = inside.inside_share;
  values["outside_walls_share"] = inside.outside_walls;
  values["outside_domain_max"] = static_cast<double>(inside.most_outside_domain);
  return evaluation;
}

MetricValues one_step_values(const OneStepError& error) {
  return {{"one_step_mse", error.model},
          {"one_step_mse_zero", error.zero},
          {"one_step_mse_ballistic", error.ballistic},
          {"one_step_normalized", error.model / error.variance},
          {"one_step_normalized_zero", error.zero / error.variance},
          {"one_step_normalized_ballistic", error.ballistic / error.variance},
          {"one_step_mse_airborne", error.model_by_state[0]},
          {"one_step_mse_near_obstacle", error.model_by_state[1]},
          {"one_step_mse_bulk", error.model_by_state[2]},
          {"one_step_share_airborne", error.share[0]},
          {"one_step_share_near_obstacle", error.share[1]},
          {"one_step_share_bulk", error.share[2]}};
}

MetricValues cost_values(const RunCost& cost, std::size_t particles, double mpm_frame) {
  constexpr double mib = 1024.0 * 1024.0;
  const double on_host = std::max(0.0, cost.added_bytes - cost.kept_bytes) + cost.weights_bytes;
  MetricValues values = {{"particles", static_cast<double>(particles)},
                         {"gpu_events_ms", 1e3 * cost.events},
                         {"network_ms", 1e3 * cost.network},
                         {"grid_build_ms", 1e3 * cost.grid_build},
                         {"features_ms", 1e3 * cost.features},
                         {"projection_ms", 1e3 * cost.projection},
                         {"output_ms", 1e3 * cost.output},
                         {"substeps_per_frame", cost.substeps},
                         {"bundle", cost.bundle},
                         {"step_search_s", cost.search},
                         {"peak_memory_mib", cost.peak_bytes / mib},
                         {"added_memory_mib", cost.added_bytes / mib},
                         {"model_memory_mib", (cost.device_bytes > 0 ? cost.device_bytes : on_host) / mib}};
  if (cost.frame > 0) {  // none where the first frame diverged
    values["frame_ms"] = 1e3 * cost.frame;
    values["speed_ratio"] = mpm_frame / cost.frame;
  }
  return values;
}

MetricValues floor_values(const Evaluation& moved, const Evaluation& reseeded) {
  MetricValues floors;
  for (const char* key : {"position_mse_20", "position_mse_100", "position_mse_all"})
    floors[std::string("floor_") + key] = moved.values.at(key);
  for (const char* key : {"sinkhorn", "density_error", "occupancy_iou", "material_occupancy_iou", "local_density_error",
                          "clump_size_error", "kinetic_energy_error", "center_of_mass_error", "front_error"})
    floors[std::string("floor_") + key] = reseeded.values.at(key);
  return floors;
}

}  // namespace graupel::compare
