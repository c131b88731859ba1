#include "hybrid/coarse_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "mpm/materials/material_parameters.h"
#include "mpm/scene_variants.h"

namespace graupel::hybrid {

namespace {

using Json = nlohmann::ordered_json;

/// Laws whose Courant number is trained.
constexpr MaterialModel trained_laws[] = {MaterialModel::water, MaterialModel::sand, MaterialModel::snow,
                                          MaterialModel::jelly};
constexpr double untrained_courant = 0.4;

std::string law_name(MaterialModel model) { return particle_type_name(particle_type_of(model)); }

/// Speed that matter reaches [m/s]: its start and the fall through the domain, v^2 = v0^2 + 2 g h.
double expected_speed(const Scene& scene) {
  double start = 0;
  for (const Source& source : scene.sources) {
    const double reach = norm(source.size) / 2;
    start = std::max(start, norm(source.velocity) + norm(source.angular_velocity) * std::min(reach, 0.2));
  }
  for (const Emitter& emitter : scene.emitters) start = std::max(start, norm(emitter.velocity));
  double fall = 0;
  for (int d = 0; d < 3; ++d) {
    double largest = std::abs(scene.gravity[d]);
    for (const GravityKey& key : scene.gravity_keyframes) largest = std::max(largest, std::abs(key.gravity[d]));
    fall += largest * scene.domain.size[d];
  }
  return std::sqrt(start * start + 2 * fall);
}

/// At least the speed of any point of a scripted body [m/s], which may not cross over a cell in a substep.
double scripted_speed(const Scene& scene) {
  const double reach = norm(scene.wall_high() - scene.wall_low());
  double fastest = 0;
  const auto add = [&](const Motion& motion) {
    double speed, spin;
    motion.fastest(0, std::numeric_limits<double>::infinity(), speed, spin);
    fastest = std::max(fastest, speed + spin * reach);
  };
  for (const Obstacle& obstacle : scene.obstacles)
    if (obstacle.motion) add(*obstacle.motion);
  for (const Source& source : scene.sources)
    if (source.motion) add(*source.motion);
  for (const KinematicRegion& region : scene.kinematic_regions) add(region.motion);
  return fastest;
}

double of_law(const std::map<MaterialModel, double>& numbers, MaterialModel law, double otherwise) {
  const auto found = numbers.find(law);
  return found == numbers.end() ? otherwise : found->second;
}

/// c T / (C dx) of a material's elastic waves at rest, or of the slowest that count.
double substeps_of_waves(const Scene& scene, const MaterialConfig& config, const CourantNumbers& log_courant) {
  const double limit = std::exp(of_law(log_courant.waves, config.model, std::log(untrained_courant)));
  const double speed = std::max(mpm::material_parameters<double>(config).elastic_speed,
                                of_law(log_courant.least_speed, config.model, 0));
  return speed * scene.frame_time / (scene.domain.dx * limit);
}

/// The least of the numbers of the laws in use, `otherwise` where nothing is.
double least_of_laws(const Scene& scene, const std::map<MaterialModel, double>& numbers, double otherwise) {
  std::optional<double> least;
  for (const auto& [name, config] : materials_in_use(scene)) {
    const double own = of_law(numbers, config.model, otherwise);
    least = std::min(own, least.value_or(own));
  }
  return least.value_or(otherwise);
}

/// The scene on that spacing over its own, in all that sets a step.
Scene with_spacing(Scene scene, double resolution) {
  scene.domain.dx *= mpm::ratio_of_whole_cells(scene.domain, resolution);
  return scene;
}

int64_t whole_substeps(double substeps) { return std::max<int64_t>(1, static_cast<int64_t>(std::ceil(substeps))); }

/// Of the scene's own constants, with e^log_factor times as many for the waves of each law.
int64_t substeps_of_largest_step(const Scene& scene, const CourantNumbers& log_courant,
                                 const std::map<MaterialModel, double>& log_factor) {
  const double frame = scene.frame_time / scene.domain.dx;
  double substeps =
      std::max(expected_speed(scene) * frame / std::exp(log_courant.speed), scripted_speed(scene) * frame);
  for (const auto& [name, config] : materials_in_use(scene))
    substeps = std::max(substeps,
                        substeps_of_waves(scene, config, log_courant) * std::exp(of_law(log_factor, config.model, 0)));
  return whole_substeps(substeps);
}

}  // namespace

CourantNumbers::CourantNumbers()
    : waves({{MaterialModel::water, std::log(0.6)},
             {MaterialModel::sand, std::log(1.5)},
             {MaterialModel::snow, std::log(1.2)},
             {MaterialModel::jelly, std::log(0.6)}}),
      speed(std::log(0.25)) {}

const std::vector<std::string>& CoarseModel::parameter_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const ConstantRule& rule : constant_rules()) {
      all.push_back(law_name(rule.model) + "." + rule.constant + ".offset");
      if (rule.has_slope) all.push_back(law_name(rule.model) + "." + rule.constant + ".slope");
    }
    all.emplace_back("walls.friction.offset");
    return all;
  }();
  return names;
}

std::vector<double> CoarseModel::parameters() const {
  std::vector<double> values;
  for (std::size_t r = 0; r < constant_rules().size(); ++r) {
    values.push_back(constants.offset[r]);
    if (constant_rules()[r].has_slope) values.push_back(constants.slope[r]);
  }
  values.push_back(constants.wall_friction);
  return values;
}

void CoarseModel::set_parameters(const std::vector<double>& values) {
  GRAUPEL_ASSERT(values.size() == parameter_names().size());
  const double* next = values.data();
  for (std::size_t r = 0; r < constant_rules().size(); ++r) {
    constants.offset[r] = *next++;
    if (constant_rules()[r].has_slope) constants.slope[r] = *next++;
  }
  constants.wall_friction = *next++;
}

Scene CoarseModel::scene(const Scene& of, double resolution) const {
  Scene coarse = constants.scene(resolution == 1 ? of : mpm::on_coarser_grid(of, resolution, share(of, resolution)));
  coarse.time_step.policy = StepPolicy::per_frame;
  coarse.time_step.substeps_per_frame = wave_substeps(coarse);
  coarse.time_step.courant = std::min(1.0, std::exp(log_courant.speed));
  return coarse;
}

double CoarseModel::share(const Scene& scene, double resolution) const {
  if (resolution == 1) return 1;
  // on_coarser_grid takes no more particles than the scene has.
  const double ratio = mpm::ratio_of_whole_cells(scene.domain, resolution);
  return std::min(least_of_laws(scene, particle_share, 1), std::pow(ratio, 3));
}

double CoarseModel::cost(const Scene& of, double resolution, Device device) const {
  return cost(of, resolution, device, opponent_substeps(of));
}

double CoarseModel::cost(const Scene& of, double resolution, Device device, int64_t opponent_substeps) const {
  const FrameCost& of_frame = frame_cost.at(device);
  const Scene coarse = with_spacing(constants.scene(of), resolution), opponent = with_spacing(of, 2);
  return (static_cast<double>(wave_substeps(coarse)) + of_frame.frame) /
         (static_cast<double>(opponent_substeps) + of_frame.frame) * std::pow(share(of, resolution), of_frame.share) *
         std::pow(opponent.domain.dx / coarse.domain.dx, of_frame.spacing);
}

double CoarseModel::resolution(const Scene& of, Device device) const {
  const double least = least_of_laws(of, finest, 1);
  const int64_t opponent = opponent_substeps(of);
  for (const double resolution : resolutions)
    if (resolution >= least && cost(of, resolution, device, opponent) <= 1) return resolution;
  return resolutions.back();
}

int64_t CoarseModel::largest_step_substeps(const Scene& scene) const {
  return substeps_of_largest_step(scene, log_courant, {});
}

int64_t CoarseModel::opponent_substeps(const Scene& of) const {
  return substeps_of_largest_step(with_spacing(of, 2), log_courant, log_opponent);
}

int64_t CoarseModel::wave_substeps(const Scene& scene) const {
  double substeps = 0;
  for (const auto& [name, config] : materials_in_use(scene))
    substeps = std::max(substeps,
                        substeps_of_waves(scene, config, log_courant) * std::exp(of_law(log_safety, config.model, 0)));
  return whole_substeps(substeps);
}

std::vector<std::string> CoarseModel::unlike_training(const Scene& scene) const {
  std::vector<std::string> lines = trained.unlike_materials(scene);
  for (std::string& line : trained.unlike_contacts(scene)) lines.push_back(std::move(line));
  return lines;
}

namespace {

void add(nn::Weights& weights, const char* name, const std::vector<double>& values) {
  weights.tensors[name] = nn::Tensor::from_float({values.begin(), values.end()}, {static_cast<int64_t>(values.size())});
}

std::vector<double> values_by_law(const std::map<MaterialModel, double>& of, double otherwise = 0) {
  std::vector<double> values;
  for (const MaterialModel law : trained_laws) values.push_back(of_law(of, law, otherwise));
  return values;
}

std::vector<double> courant_values(const CourantNumbers& numbers) {
  std::vector<double> values = values_by_law(numbers.waves);
  values.push_back(numbers.speed);
  return values;
}

}  // namespace

nn::Weights CoarseModel::store() const {
  nn::Weights weights;
  weights.metadata = metadata;
  weights.metadata["architecture"] = coarse_architecture;
  weights.metadata["parameter_names"] = Json(parameter_names()).dump();
  trained.store(weights.metadata);
  add(weights, "parameters", parameters());
  add(weights, "log_courant", courant_values(log_courant));
  add(weights, "log_safety", values_by_law(log_safety));
  add(weights, "log_opponent", values_by_law(log_opponent));
  add(weights, "least_wave_speeds", values_by_law(log_courant.least_speed));
  add(weights, "particle_shares", values_by_law(particle_share, 1));
  add(weights, "finest_spacings", values_by_law(finest, 1));
  add(weights, "resolutions", resolutions);
  const FrameCost &cpu = frame_cost.at(Device::cpu), &gpu = frame_cost.at(Device::cuda);
  add(weights, "frame_costs", {cpu.frame, gpu.frame});
  add(weights, "cost_exponents", {cpu.share, cpu.spacing, gpu.share, gpu.spacing});
  return weights;
}

bool is_coarse_model(const nn::Weights& weights) {
  const auto found = weights.metadata.find("architecture");
  return found != weights.metadata.end() && found->second == coarse_architecture;
}

CoarseModel CoarseModel::load(const nn::Weights& weights) {
  const auto bad = [&](const std::string& what) {
    return InputError(fmt::format("'{}': {}. Train the model again with `graupel train coarse`", weights.file, what));
  };
  if (!is_coarse_model(weights)) throw bad("it holds no coarse MPM model (metadata architecture)");
  CoarseModel model;
  model.metadata = weights.metadata;
  try {
    const auto names = Json::parse(weights.metadata.at("parameter_names")).get<std::vector<std::string>>();
    if (names != parameter_names()) throw bad("its parameters are of another version (metadata parameter_names)");
  } catch (const Json::exception& error) {
    throw bad(std::string("its metadata are no JSON (") + error.what() + ")");
  } catch (const std::out_of_range&) {
    throw bad("metadata parameter_names are missing");
  }
  if (!weights.metadata.contains("training.ranges") || !weights.metadata.contains("training.contacts"))
    throw bad("metadata training.ranges or training.contacts are missing");
  model.trained = nn::TrainedBox::load(weights);
  const auto numbers = [&](const char* name, std::size_t count, double low, double high) {
    const std::vector<float> stored = weights.get(name, {static_cast<int64_t>(count)});
    for (std::size_t i = 0; i < count; ++i)
      if (!(static_cast<double>(stored[i]) >= low && static_cast<double>(stored[i]) <= high))
        throw bad(fmt::format("{}[{}] is {} (allowed {} to {})", name, i, stored[i], low, high));
    return std::vector<double>(stored.begin(), stored.end());
  };
  model.set_parameters(numbers("parameters", parameter_names().size(), -12, 12));
  const std::vector<double> courant = numbers("log_courant", std::size(trained_laws) + 1, -6, 6);
  for (std::size_t l = 0; l < std::size(trained_laws); ++l) model.log_courant.waves[trained_laws[l]] = courant[l];
  model.log_courant.speed = courant.back();
  const auto by_law = [&](const char* name, double low, double high) {
    const std::vector<double> values = numbers(name, std::size(trained_laws), low, high);
    std::map<MaterialModel, double> all;
    for (std::size_t l = 0; l < std::size(trained_laws); ++l) all[trained_laws[l]] = values[l];
    return all;
  };
  model.log_safety = by_law("log_safety", -2, 6);
  model.log_opponent = by_law("log_opponent", -6, 6);
  model.log_courant.least_speed = by_law("least_wave_speeds", 0, 1e4);
  model.particle_share = by_law("particle_shares", 0.125, 8);
  model.finest = by_law("finest_spacings", 1, 8);
  const auto found = weights.tensors.find("resolutions");
  const std::size_t count = found == weights.tensors.end() ? 0 : static_cast<std::size_t>(found->second.count());
  if (count == 0) throw bad("tensor resolutions is missing or empty (allowed: 1 or more spacings)");
  model.resolutions = numbers("resolutions", count, 1, 8);
  if (!std::is_sorted(model.resolutions.begin(), model.resolutions.end()))
    throw bad("tensor resolutions is not ascending");
  const std::vector<double> frames = numbers("frame_costs", 2, 0, 100), exponents = numbers("cost_exponents", 4, 0, 4);
  model.frame_cost = {{Device::cpu, {frames[0], exponents[0], exponents[1]}},
                      {Device::cuda, {frames[1], exponents[2], exponents[3]}}};
  return model;
}

}  // namespace graupel::hybrid
