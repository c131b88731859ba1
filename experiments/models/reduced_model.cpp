#include "experiments/models/reduced_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "rom/solver/material_difference.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::json;

/// Keys that a reduced run may have otherwise than the training.
const std::set<std::string> free_keys = {"/name",   "/description", "/seed",
                                         "/frames", "/frame_time",  "/time_step/substeps_per_frame"};

/// Loads: what acts on a body whose stress follows its deformation (CROM), and so may be other than in the training.
const std::set<std::string> load_keys = {"/gravity", "/obstacles"};

std::string pointer_of(std::string key) {
  std::replace(key.begin(), key.end(), '.', '/');
  return "/" + key;
}

/// `also`: more keys that are free.
Json without_free_keys(const std::string& scene_json, const rom::ReducedModel& model,
                       const std::set<std::string>& also) {
  Json scene = Json::parse(scene_json);
  std::set<std::string> keys = free_keys;
  keys.insert(also.begin(), also.end());
  for (const rom::ModelParameter& p : model.parameters)
    for (const std::string& key : p.keys) keys.insert(pointer_of(key));
  for (const std::string& key : keys) {
    const Json::json_pointer pointer(key);
    if (scene.contains(pointer)) scene[pointer] = nullptr;
  }
  return scene;
}

double number_at(const Json& scene, const rom::ModelParameter& parameter, const std::string& file) {
  const Json::json_pointer pointer(pointer_of(parameter.keys.front()));
  if (!scene.contains(pointer) || !scene.at(pointer).is_number())
    throw ConfigError("the scene has no number at '" + parameter.keys.front() + "', which '" + file +
                      "' was trained on. Use the scene that the model was trained with");
  return scene.at(pointer).get<double>();
}

/// How much of the body has other materials than in the scene of the training with the same parameters.
double foreign_share(const LoadedModel& loaded, const Scene& scene, const mpm::SampledParticles& particles) {
  const Json own = Json::parse(io::scene_to_json(scene));
  Json trained = Json::parse(loaded.model.scene_json);
  for (const rom::ModelParameter& p : loaded.model.parameters)
    for (const std::string& key : p.keys) {
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

/// What differs between a scene and the training's, apart from free keys and `also`.
Json differences(const LoadedModel& loaded, const std::string& text, const std::set<std::string>& also) {
  return Json::diff(without_free_keys(loaded.model.scene_json, loaded.model, also),
                    without_free_keys(text, loaded.model, also));
}

/// Models of the deformation alone run with other loads, which is told.
void check_same_scene(const LoadedModel& loaded, const std::string& text) {
  const bool any_load = loaded.model.fields->stress_follows_deformation();
  const Json difference = differences(loaded, text, any_load ? load_keys : std::set<std::string>());
  if (difference.empty()) {
    const Json loads = differences(loaded, text, {});
    if (!loads.empty())
      std::fprintf(stderr, "graupel: warning: loads differ from those that '%s' was trained on ('%s')\n",
                   loaded.file.c_str(), loads.front().at("path").get<std::string>().c_str());
    return;
  }
  const Json own = Json::parse(text), trained = Json::parse(loaded.model.scene_json);
  const std::string path = difference.front().at("path");
  const Json::json_pointer pointer(path);
  const auto text_at = [&](const Json& json) { return json.contains(pointer) ? json.at(pointer).dump() : "nothing"; };
  throw ConfigError(fmt::format(
      "'{}' is for another scene ('{}' has {} there, the scene of the training {}). Use that scene; 'graupel inspect' "
      "shows it",
      loaded.file, path, text_at(own), text_at(trained)));
}

}  // namespace

std::vector<double> parameters_of(const LoadedModel& loaded, const Scene& scene, ForeignScene foreign) {
  const std::string text = io::scene_to_json(scene);
  if (foreign == ForeignScene::refuse) check_same_scene(loaded, text);
  std::vector<double> parameters;
  const Json whole = Json::parse(text);
  for (const rom::ModelParameter& p : loaded.model.parameters) parameters.push_back(number_at(whole, p, loaded.file));
  return parameters;
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
  const auto lines =
      how.outside == OutsideRange::warn ? outside_range(loaded.model, parameters_) : std::vector<std::string>{};
  for (const std::string& line : lines)
    std::fprintf(stderr, "graupel: warning: %s is outside of what '%s' was trained on: %s\n", scene.name.c_str(),
                 loaded.file.c_str(), line.c_str());
  mpm::PreparedScene prepared(scene, {.device = Device::cpu, .seed = seed});
  for (const int32_t material : prepared.particles.material)
    particle_type_.push_back(particle_type_of(
        scene.materials.at(prepared.particles.material_names[static_cast<std::size_t>(material)]).model));
  record_.emplace(loaded.model.usual,
                  how.foreign == ForeignScene::run ? foreign_share(loaded, prepared.scene, prepared.particles) : 0.0);
  // A model that is no better than a body at rest on runs of its own training has failed before it starts.
  if (loaded.model.usual_error >= 1) record_->diverged();
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
}

std::string trust_line(const rom::ReducedModel& model, const rom::ErrorIndicatorRecord& record) {
  if (model.usual.empty()) return "trust unknown (the model was trained without calibration_runs)";
  return fmt::format("trust {:.2f}, {}; training runs were rolled out with errors up to {:.2g} % of the displacement",
                     record.number(), rom::verdict_text(record.verdict()), 100 * model.usual_error);
}

}  // namespace graupel::experiments
