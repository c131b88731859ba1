#include "experiments/models/reduced_model.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "core/system/error.h"
#include "experiments/models/body_points.h"
#include "experiments/models/scene_difference.h"
#include "experiments/process/process.h"
#include "io/scene/scene_reader.h"
#include "rom/solver/material_difference.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::json;

/// Loads: what acts on a body whose stress follows its deformation (CROM), and so may be other than in the training.
const std::set<std::string> load_keys = {"/gravity", "/gravity_keyframes", "/loads", "/obstacles"};

std::vector<std::string> parameter_keys(const rom::ReducedModel& model) {
  std::vector<std::string> keys;
  for (const rom::ModelParameter& p : model.parameters) keys.insert(keys.end(), p.keys.begin(), p.keys.end());
  return keys;
}

/// How much of the body has other materials than in the scene of the training with the same parameters.
double foreign_share(const LoadedModel& loaded, const Scene& scene, const mpm::SampledParticles& particles) {
  const Json own = Json::parse(io::scene_to_json(scene));
  Json trained = Json::parse(loaded.model.scene_json);
  for (const std::string& key : parameter_keys(loaded.model)) {
    const Json::json_pointer pointer(pointer_of(key));
    if (own.contains(pointer)) trained[pointer] = own.at(pointer);
  }
  const Scene before = io::parse_scene(trained.dump(), "the model's scene", "");
  const mpm::SampledParticles others = mpm::sample_sources(before, before.seed);
  return others.position.size() == particles.position.size()
             ? rom::material_difference(scene, particles, before, others)
             : 1;
}

}  // namespace

LoadedModel::LoadedModel(const std::string& path) : LoadedModel(nn::read_safetensors(path)) {}

LoadedModel::LoadedModel(const nn::Weights& weights) : file(weights.file), model(rom::ReducedModel::load(weights)) {
  // As the scene reader writes it, with every default of this version.
  model.scene_json = io::scene_to_json(io::parse_stored_scene(model.scene_json, file, file));
}

std::vector<int32_t> particle_kinds(const mpm::SampledParticles& particles) {
  const auto scripts = static_cast<int32_t>(particles.scripts.size()) + 1;
  std::vector<int32_t> kinds;
  for (std::size_t p = 0; p < particles.position.size(); ++p)
    kinds.push_back(particles.material[p] * scripts + (particles.script.empty() ? 0 : particles.script[p] + 1));
  return kinds;
}

std::vector<int32_t> particle_kinds(const rom::ReducedModel& model) {
  const Scene scene = io::parse_scene(model.scene_json, "the model's scene", "");
  return particle_kinds(mpm::sample_sources(scene, scene.seed));
}

namespace {

/// What may be other than in the training for a model of the deformation alone: loads, particles, grid.
std::set<std::string> keys_of_deformation_models(const LoadedModel& loaded) {
  std::set<std::string> keys = discretisation_keys(loaded.model.scene_json);
  keys.insert(load_keys.begin(), load_keys.end());
  return keys;
}

/// Throws ConfigError for a scene that the model is not for.
void check_same_scene(const LoadedModel& loaded, const std::string& text) {
  const auto difference = scene_difference(
      text, loaded.model.scene_json, parameter_keys(loaded.model),
      loaded.model.fields->stress_follows_deformation() ? keys_of_deformation_models(loaded) : std::set<std::string>());
  if (difference)
    throw ConfigError(fmt::format(
        "'{}' is for another scene ('{}' has {} there, the scene of the training {}). Use that scene; 'graupel "
        "inspect' shows it",
        loaded.file, difference->key, difference->own, difference->other));
}

}  // namespace

std::vector<double> parameters_of(const LoadedModel& loaded, const Scene& scene, ForeignScene foreign) {
  const std::string text = io::scene_to_json(scene);
  if (foreign == ForeignScene::refuse) check_same_scene(loaded, text);
  std::vector<double> parameters;
  for (const rom::ModelParameter& p : loaded.model.parameters)
    parameters.push_back(number_at(text, p.keys.front(), loaded.file));
  return parameters;
}

std::vector<std::string> unlike_training(const LoadedModel& loaded, const Scene& scene) {
  const std::string text = io::scene_to_json(scene);
  std::vector<std::string> lines;
  for (const std::string& line : outside_range(loaded.model, parameters_of(loaded, scene, ForeignScene::run)))
    lines.push_back("outside the training: " + line);
  const auto keys = parameter_keys(loaded.model);
  const std::string& trained = loaded.model.scene_json;
  if (scene_difference(text, trained, keys, keys_of_deformation_models(loaded))) return lines;
  if (const auto load = scene_difference(text, trained, keys, discretisation_keys(trained)))
    lines.push_back(
        fmt::format("loads differ from those of the training: {} is {}, there {}", load->key, load->own, load->other));
  if (const auto grid = scene_difference(text, trained, keys, load_keys))
    lines.push_back(fmt::format("particles or grid differ from those of the training: {} is {}, there {}", grid->key,
                                grid->own, grid->other));
  return lines;
}

std::vector<std::string> outside_range(const rom::ReducedModel& model, const std::vector<double>& parameters) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const rom::ModelParameter& p = model.parameters[i];
    const double tolerance = 1e-6 * (p.high - p.low);
    if (parameters[i] < p.low - tolerance || parameters[i] > p.high + tolerance)
      lines.push_back(
          fmt::format("{} = {:g} {}, trained on {:g} to {:g}", p.name, parameters[i], p.unit, p.low, p.high));
  }
  return lines;
}

Device device_of_reduced_models(const std::string& word) {
  const Device device = parse_device(word);
  return word == name_of(Device::cuda) ? device : Device::cpu;
}

ReducedRun::ReducedRun(const LoadedModel& loaded, const Scene& scene, uint64_t seed, const rom::ReducedOptions& options,
                       const ReducedRunOptions& how)
    : parameters_(parameters_of(loaded, scene, how.foreign)) {
  const auto lines = how.outside == OutsideRange::warn ? unlike_training(loaded, scene) : std::vector<std::string>{};
  for (const std::string& line : lines) warn(fmt::format("{}: '{}' {}", scene.name, loaded.file, line));
  mpm::PreparedScene prepared(scene, {.device = Device::cpu, .seed = seed});
  for (const int32_t material : prepared.particles.material)
    particle_type_.push_back(particle_type_of(
        scene.materials.at(prepared.particles.material_names[static_cast<std::size_t>(material)]).model));
  // The levels are of roll-outs with the model's own pull to its training runs.
  const bool as_calibrated = options.manifold_pull.value_or(loaded.model.manifold_pull) == loaded.model.manifold_pull;
  record_.emplace(as_calibrated ? loaded.model.usual : rom::TrustLevels{},
                  how.foreign == ForeignScene::run ? foreign_share(loaded, prepared.scene, prepared.particles) : 0.0,
                  loaded.model.usual_error);
  const bool same_scene =
      !scene_difference(io::scene_to_json(scene), loaded.model.scene_json, parameter_keys(loaded.model));
  if (same_scene && parameters_.size() == 1) bound_ = rom::InterpolationBound::of(loaded.model, parameters_.front());
  if (how.foreign == ForeignScene::run && !same_scene) record_->foreign_scene();
  const auto& position = prepared.particles.position;
  if (loaded.model.fields->stress_follows_deformation() &&
      !has_own_particles(loaded.model, prepared.particles, 1e-4 * scene.domain.dx)) {
    std::vector<float> reference;
    for (const Vec3d& x : position)
      for (int d = 0; d < 3; ++d) reference.push_back(static_cast<float>(x[d]));
    points_ = std::make_unique<PointFrames>(loaded.model.fields->bind_any_points(reference), position.size(),
                                            PointFrames::Content::positions_and_velocities);
    prepared.particles = own_particles(loaded.model, prepared.scene);
  }
  if (how.device == Device::cuda && how.arithmetic == Arithmetic::f64)
    throw ConfigError("reduced models run in single precision on the GPU (asked for: --f64). Use --device cpu");
  if (how.device == Device::cuda)
    gpu_ = std::make_unique<rom::ReducedDeviceSolver>(
        loaded.model, std::vector<rom::ReducedInstance>{{std::move(prepared), parameters_}}, options);
  else if (how.arithmetic == Arithmetic::f32)
    single_ = std::make_unique<rom::ReducedSolver<float>>(loaded.model, std::move(prepared), parameters_, options);
  else
    exact_ = std::make_unique<rom::ReducedSolver<double>>(loaded.model, std::move(prepared), parameters_, options);
}

rom::LoadResponse ReducedRun::apply(const Load& load) {
  if (gpu_) throw ConfigError("loads on reduced models act on the CPU alone. Use --device cpu");
  bound_.reset();  // no training run was pushed
  record_->set_bound({});
  return single_ ? single_->apply(load) : exact_->apply(load);
}

ReducedRun::ReducedRun(ReducedRun&&) noexcept = default;
ReducedRun::~ReducedRun() = default;

ParticleFrame ReducedRun::frame() const {
  if (points_) return points_->frame(state(), time());
  return gpu_ ? gpu_->frame(0) : single_ ? single_->frame() : exact_->frame();
}

void ReducedRun::advance_frame() {
  try {
    if (single_) single_->advance_frame();
    if (exact_) exact_->advance_frame();
    if (gpu_) gpu_->advance_frame();
    if (const auto why = gpu_ ? gpu_->divergence(0) : std::nullopt) throw DivergedError(*why);
  } catch (const DivergedError&) {
    record_->diverged();
    throw;
  }
  trust_number_ = record_->add(trust());
  if (!bound_) return;
  bound_->add(state().latent, time());
  record_->set_bound(bound_->value());
}

std::string trust_line(const rom::ReducedModel& model, const rom::ErrorIndicatorRecord& record) {
  if (record.bound())
    return fmt::format("trust {}: off by at most about {:.2g} % of the displacement",
                       rom::verdict_text(record.verdict()), 100 * *record.bound());
  if (model.usual.empty()) return "trust unknown (the model was trained without calibration_runs)";
  if (record.verdict() == rom::Verdict::unknown)
    return "trust unknown (its training was calibrated with another manifold_pull)";
  return fmt::format("trust {:.2f}, {}; training runs were rolled out with errors up to {:.2g} % of the displacement",
                     record.number(), rom::verdict_text(record.verdict()), 100 * model.usual_error);
}

}  // namespace graupel::experiments
