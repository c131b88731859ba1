#include "rom/reduced_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "rom/fields/deformation_fields.h"
#include "rom/fields/factored_fields.h"
#include "rom/fields/mlp_fields.h"
#include "rom/networks/tensors.h"

namespace graupel::rom {

namespace {

using Json = nlohmann::ordered_json;

/// Metadata keys of the file that the model itself reads; the others are provenance.
constexpr const char* own_keys[] = {"architecture", "field", "branch", "scene", "settings"};

const std::string& metadata(const nn::Weights& weights, const std::string& key) {
  const auto at = weights.metadata.find(key);
  if (at == weights.metadata.end())
    throw InputError("'" + weights.file + "' is no reduced-order model (it lacks '" + key +
                     "'). 'graupel train nsf' and 'graupel train crom' make some");
  return at->second;
}

std::vector<float> floats(const std::vector<double>& values) { return {values.begin(), values.end()}; }
std::vector<double> doubles(const std::vector<float>& values) { return {values.begin(), values.end()}; }

void check_indices(const nn::Weights& weights, const std::vector<int32_t>& indices, int64_t count, const char* what) {
  for (const int32_t i : indices)
    if (i >= count)
      throw InputError(fmt::format("'{}' names particle {} among its {} (allowed: 0 to {}). Train the model again",
                                   weights.file, i, what, count - 1));
}

/// The settings of a file, a JSON object; files of earlier versions lack some, which keep their default.
class Settings {
 public:
  Settings(const nn::Weights& weights, const Json& json) : file_(weights.file), json_(json) {}

  double number(const char* key, double low, double high) const { return number(json_.at(key), key, low, high); }
  double number_or(const char* key, double otherwise, double low, double high) const {
    return json_.contains(key) ? number(key, low, high) : otherwise;
  }
  double number(const Json& value, const std::string& name, double low, double high) const {
    const double found = value.get<double>();
    if (!(found >= low && found <= high))
      throw InputError(fmt::format("'{}' has {} {} in its settings (allowed: {} to {}). Train the model again", file_,
                                   name, found, low, high));
    return found;
  }
  template <typename E>
  void word(const char* key, E& value) const {
    if (!json_.contains(key)) return;
    const std::string stored = json_.at(key);
    std::string allowed;
    for (const auto& [word, kind] : EnumWords<E>::words) {
      if (stored == word) {
        value = kind;
        return;
      }
      allowed += (allowed.empty() ? "" : ", ") + std::string(word);
    }
    throw InputError(
        fmt::format("'{}' has {} '{}' in its settings (allowed: {}). Use the version of Graupel that it "
                    "was trained with",
                    file_, key, stored, allowed));
  }
  void refuse_others(std::initializer_list<std::string_view> known) const {
    for (const auto& [key, value] : json_.items())
      if (std::find(known.begin(), known.end(), key) == known.end())
        throw InputError(
            fmt::format("'{}' has '{}' in its settings, which is not known. Use the version of Graupel that "
                        "it was trained with",
                        file_, key));
  }

 private:
  const std::string& file_;
  const Json& json_;
};

void read_settings(const nn::Weights& weights, const Json& json, ReducedModel& model) {
  constexpr double smallest = 1e-30, largest = 1e30;  // what an f32 holds with room to spare
  const Settings settings(weights, json);
  settings.refuse_others({"parameters", "substeps_per_frame", "frame_time", "affine", "latent_reach", "usual_error",
                          "interpolation", "step_factor", "contact_weight", "manifold_pull", "projection", "quadrature",
                          "gradient", "outlier_factor"});
  for (const Json& p : json.at("parameters")) {
    const std::string name = p.at("name");
    const double low = settings.number(p.at("low"), "the low end of " + name, -largest, largest),
                 high = settings.number(p.at("high"), "the high end of " + name, low, largest);
    model.parameters.push_back({name, p.at("unit"), p.at("keys"), low, high});
    if (model.parameters.back().keys.empty())
      throw InputError(fmt::format("'{}' has no keys of its parameter '{}' (allowed: 1 or more). Train the model again",
                                   weights.file, name));
  }
  model.substeps_per_frame = static_cast<int64_t>(settings.number("substeps_per_frame", 1, 1e6));
  model.frame_time = settings.number("frame_time", 1e-9, 1e3);
  settings.word("affine", model.affine_kind);
  model.latent_reach = settings.number("latent_reach", smallest, largest);
  model.usual_error = settings.number_or("usual_error", 0, 0, largest);
  if (json.contains("interpolation")) {
    const Settings errors(weights, json.at("interpolation"));
    model.interpolation = {errors.number("reconstruction", 0, largest), errors.number("curvature", 0, largest)};
  }
  model.step_factor = settings.number_or("step_factor", 1, 1e-3, 1e3);
  model.contact_weight = settings.number_or("contact_weight", 1, 0, 1e6);
  model.manifold_pull = settings.number_or("manifold_pull", 0, 0, 1);
  settings.word("projection", model.projection);
  settings.word("quadrature", model.quadrature);
  settings.word("gradient", model.gradient);
}

/// Files that need what was removed; their results would be others.
void refuse_removed(const nn::Weights& weights, const Json& settings) {
  const char* what = settings.value("outlier_factor", 0.0) != 0   ? "samples that count less (outlier_factor)"
                     : weights.tensors.count("quadrature") > 0    ? "fitted weights (quadrature)"
                     : weights.tensors.count("samples.later") > 0 ? "samples of later times (sample_windows)"
                                                                  : nullptr;
  if (what != nullptr)
    throw InputError(fmt::format(
        "'{}' has {}, which reduced models no longer have. Train the model again without, or use the version of "
        "Graupel that it was trained with",
        weights.file, what));
}

FactoredFields read_factored(const nn::Weights& weights, const ReducedModel& model, int latents, int64_t particles) {
  ModeTable deformation = ModeTable::load(weights, "deformation", 3);
  if (deformation.modes < latents)
    throw InputError(fmt::format("'{}' has {} latents but {} modes of the deformation. Train the model again",
                                 weights.file, latents, deformation.modes));
  if (deformation.rows() != particles)
    throw InputError("'" + weights.file + "' has clusters of other particles than its own. Train the model again");
  for (std::size_t i = 0; i < deformation.points.size(); ++i)
    if (deformation.points[i] != static_cast<int32_t>(i))
      throw InputError("'" + weights.file + "' lacks the deformation of some particles. Train the model again");
  const auto map = [&, kind = read_branch_kind(weights)](const char* prefix, int from, int outputs) {
    return load_branch_map(weights, prefix, kind, from, outputs);
  };
  ClosureBranch closure(latents, map("deformation.branch", latents, deformation.modes - latents));
  if (model.gradient == GradientKind::integrated) return {std::move(deformation), std::move(closure)};
  const int inputs = latents + static_cast<int>(model.parameters.size());
  ModeTable stress = ModeTable::load(weights, "stress", 6), affine = ModeTable::load(weights, "affine", 9);
  MapBranch stress_branch(map("stress.branch", inputs, stress.modes));
  std::shared_ptr<const Branch> affine_branch;
  if (model.affine_kind == AffineKind::rate)
    affine_branch = std::make_shared<const RateBranch>(latents, map("affine.branch", inputs, affine.modes * latents));
  else
    affine_branch = std::make_shared<const MapBranch>(map("affine.branch", inputs, affine.modes));
  return {std::move(deformation),   std::move(closure), std::move(stress),
          std::move(stress_branch), std::move(affine),  std::move(affine_branch)};
}

ReducedKind read_reduced_kind(const nn::Weights& weights) {
  const std::string architecture = metadata(weights, "architecture");
  for (const auto& [word, kind] : EnumWords<ReducedKind>::words)
    if (architecture == word) return kind;
  throw InputError("'" + weights.file + "' is no reduced-order model (architecture '" + architecture +
                   "', allowed: nsf, crom)");
}

/// Files of the first version say nothing: their fields are factored.
FieldKind read_kind(const nn::Weights& weights) {
  const auto at = weights.metadata.find("field");
  if (at == weights.metadata.end()) return FieldKind::factored;
  for (const auto& [word, kind] : EnumWords<FieldKind>::words)
    if (at->second == word) return kind;
  throw InputError("'" + weights.file + "' has fields of an unknown kind ('" + at->second +
                   "', allowed: factored, mlp). Use the version of Graupel that it was trained with");
}

Clusters read_clusters(const nn::Weights& weights) {
  Clusters clusters;
  clusters.of_particle = get_indices(weights, "clusters");
  check_indices(weights, clusters.of_particle, static_cast<int64_t>(clusters.of_particle.size()), "clusters");
  for (const int32_t c : clusters.of_particle) clusters.count = std::max<int64_t>(clusters.count, c + 1);
  const std::vector<int32_t> chosen = clusters.representatives();
  if (std::find(chosen.begin(), chosen.end(), -1) != chosen.end())
    throw InputError("'" + weights.file + "' has a cluster without particles. Train the model again");
  if (weights.tensors.count("cluster_points") > 0) clusters.points = get_indices(weights, "cluster_points");
  for (std::size_t c = 0; c < clusters.points.size(); ++c) {
    const auto p = static_cast<std::size_t>(clusters.points[c]);
    if (clusters.points.size() != chosen.size() || p >= clusters.of_particle.size() ||
        clusters.of_particle[p] != static_cast<int32_t>(c))
      throw InputError(fmt::format(
          "'{}' has particle {} as the point of cluster {}, to which it does not belong. Train the model again",
          weights.file, p, c));
  }
  return clusters;
}

constexpr const char* field_names[] = {"deformation", "stress", "affine"};

/// What older files may lack.
void read_judgement(const nn::Weights& weights, ReducedModel& model) {
  if (weights.tensors.count("trust.usual") > 0) {
    const int64_t frames = extent(weights, "trust.usual", 0);
    const std::vector<float> levels = weights.get("trust.usual", {frames, 3});
    for (std::size_t i = 0; i < levels.size(); i += 3) model.usual.push_back({levels[i], levels[i + 1], levels[i + 2]});
  }
  for (const std::string field : field_names)
    if (weights.tensors.count(field + ".singular") > 0)
      model.singular_values[field] = weights.get(field + ".singular", {extent(weights, field + ".singular", 0)});
}

void store_judgement(const ReducedModel& model, nn::Weights& weights) {
  std::vector<double> levels;
  for (const ErrorIndicator& frame : model.usual)
    levels.insert(levels.end(), {frame.residual, frame.down_weighted, frame.latent_distance});
  if (!levels.empty())
    weights.tensors["trust.usual"] =
        nn::Tensor::from_float(floats(levels), {static_cast<int64_t>(model.usual.size()), 3});
  for (const auto& [field, values] : model.singular_values)
    weights.tensors[field + ".singular"] = nn::Tensor::from_float(values, {static_cast<int64_t>(values.size())});
}

/// A tensor under another name would be one that is missing.
void refuse_unknown_tensors(const nn::Weights& weights, const ReducedModel& model) {
  const nn::Weights known = model.store(nn::DType::f32);
  for (const auto& [name, tensor] : weights.tensors)
    if (known.tensors.count(name) == 0)
      throw InputError(
          fmt::format("'{}' has the tensor '{}', which no such model has. It is damaged or of another version; "
                      "train the model again",
                      weights.file, name));
}

}  // namespace

bool is_reduced_model(const nn::Weights& weights) {
  const auto at = weights.metadata.find("architecture");
  if (at == weights.metadata.end()) return false;
  for (const auto& [word, kind] : EnumWords<ReducedKind>::words)
    if (at->second == word) return true;
  return false;
}

ReducedModel ReducedModel::load(const nn::Weights& weights) {
  ReducedModel model;
  model.kind = read_reduced_kind(weights);
  model.scene_json = metadata(weights, "scene");
  try {
    const Json settings = Json::parse(metadata(weights, "settings"));
    refuse_removed(weights, settings);
    read_settings(weights, settings, model);
  } catch (const Json::exception& error) {
    throw InputError("the settings of '" + weights.file + "' cannot be read (" + error.what() +
                     "). Train the model again");
  }
  const auto latents = static_cast<int>(extent(weights, "latent.start", 0));
  if (latents < 1) throw InputError("'" + weights.file + "' has no latent. Train the model again");
  model.clusters = read_clusters(weights);
  const auto n = static_cast<int64_t>(model.clusters.of_particle.size());
  model.reference = weights.get("reference", {n, 3});
  model.start_latent = doubles(weights.get("latent.start", {latents}));
  if (model.kind == ReducedKind::crom)
    model.fields = DeformationFields::load(weights, latents, model.reference, model.start_latent);
  else if (read_kind(weights) == FieldKind::mlp)
    model.fields = MlpFields::load(weights, latents, static_cast<int>(model.parameters.size()), model.reference);
  else
    model.fields = std::make_shared<const FactoredFields>(read_factored(weights, model, latents, n));
  model.samples = get_indices(weights, "samples");
  model.encoder = get_indices(weights, "encoder");
  if (model.samples.empty()) throw InputError("'" + weights.file + "' has no samples. Train the model again");
  check_indices(weights, model.samples, n, "samples");
  check_indices(weights, model.encoder, n, "encoder's particles");
  if (weights.tensors.count("encoder.latent.weight") > 0)
    model.conv_encoder = ConvEncoder::load(weights, "encoder", n, latents);
  model.training_latents = weights.get("latent.training", {extent(weights, "latent.training", 0), latents});
  if (weights.tensors.count("latent.run") > 0) {
    model.training_run = get_indices(weights, "latent.run");
    if (model.training_run.size() * static_cast<std::size_t>(latents) != model.training_latents.size() ||
        !std::is_sorted(model.training_run.begin(), model.training_run.end()))
      throw InputError("'" + weights.file +
                       "' has runs of other snapshots than its latents ('latent.run'). Train the model again");
  }
  if (weights.tensors.count("latent.parameters") > 0)
    model.run_parameters = weights.get(
        "latent.parameters", {extent(weights, "latent.parameters", 0), static_cast<int64_t>(model.parameters.size())});
  model.latent_scale = weights.get("latent.scale", {latents});
  read_judgement(weights, model);
  refuse_unknown_tensors(weights, model);
  for (const auto& [key, value] : weights.metadata)
    if (std::find(std::begin(own_keys), std::end(own_keys), key) == std::end(own_keys)) model.provenance[key] = value;
  return model;
}

nn::Weights ReducedModel::store(nn::DType modes) const {
  nn::Weights weights;
  weights.metadata = provenance;
  weights.metadata["architecture"] = word_of(kind);
  weights.metadata["field"] = fields->kind();
  weights.metadata["scene"] = scene_json;
  Json settings = {
      {"parameters", Json::array()},       {"substeps_per_frame", substeps_per_frame},
      {"frame_time", frame_time},          {"affine", affine_kind == AffineKind::rate ? "rate" : "position"},
      {"latent_reach", latent_reach},      {"usual_error", usual_error},
      {"step_factor", step_factor},        {"manifold_pull", manifold_pull},
      {"projection", word_of(projection)}, {"quadrature", word_of(quadrature)},
      {"gradient", word_of(gradient)},     {"contact_weight", contact_weight}};
  if (interpolation)
    settings["interpolation"] = {{"reconstruction", interpolation->reconstruction},
                                 {"curvature", interpolation->curvature}};
  for (const ModelParameter& p : parameters)
    settings["parameters"].push_back(
        {{"name", p.name}, {"unit", p.unit}, {"keys", p.keys}, {"low", p.low}, {"high", p.high}});
  weights.metadata["settings"] = settings.dump();
  fields->store(weights, modes);
  store_judgement(*this, weights);
  const int r = latents();
  weights.tensors["reference"] = nn::Tensor::from_float(reference, {fields->particles(), 3});
  weights.tensors["samples"] = index_tensor(samples);
  weights.tensors["encoder"] = index_tensor(encoder);
  if (conv_encoder) conv_encoder->store(weights, "encoder");
  weights.tensors["clusters"] = index_tensor(clusters.of_particle);
  if (!clusters.points.empty()) weights.tensors["cluster_points"] = index_tensor(clusters.points);
  weights.tensors["latent.start"] = nn::Tensor::from_float(floats(start_latent), {r});
  weights.tensors["latent.training"] =
      nn::Tensor::from_float(training_latents, {static_cast<int64_t>(training_latents.size()) / r, r});
  if (!training_run.empty()) weights.tensors["latent.run"] = index_tensor(training_run);
  if (!run_parameters.empty()) {
    const auto width = static_cast<int64_t>(parameters.size());
    weights.tensors["latent.parameters"] =
        nn::Tensor::from_float(run_parameters, {static_cast<int64_t>(run_parameters.size()) / width, width});
  }
  weights.tensors["latent.scale"] = nn::Tensor::from_float(latent_scale, {r});
  return weights;
}

GridParticles ReducedModel::integration_points(const std::vector<double>& volume) const {
  GridParticles all;
  all.particles = clusters.representatives();
  all.weight.assign(all.particles.size(), 0.0);
  for (std::size_t p = 0; p < volume.size(); ++p)
    all.weight[static_cast<std::size_t>(clusters.of_particle[p])] += volume[p];
  for (std::size_t i = 0; i < all.particles.size(); ++i)
    all.weight[i] /= volume[static_cast<std::size_t>(all.particles[i])];
  return all;
}

void ReducedModel::take_clusters(Clusters made) {
  if (clusters.count != fields->particles())
    throw ConfigError(fmt::format(
        "the model has {} clusters of particles as integration points, which cannot be divided anew. Train it with "
        "cluster=1",
        clusters.count));
  clusters = std::move(made);
  if (clusters.count < fields->particles()) fields = fields->with_clusters(clusters);
}

double scaled_norm(const ReducedModel& model, const std::vector<double>& change) {
  double sum = 0;
  for (std::size_t k = 0; k < change.size(); ++k) {
    const double scaled = change[k] / static_cast<double>(model.latent_scale[k]);
    sum += scaled * scaled;
  }
  return std::sqrt(sum);
}

double fastest_of_training(const ReducedModel& model) {
  const auto r = static_cast<std::size_t>(model.latents());
  double fastest = 0;
  std::vector<double> change(r);
  for (std::size_t i = 1; i < model.training_run.size(); ++i) {
    if (model.training_run[i] != model.training_run[i - 1]) continue;
    for (std::size_t k = 0; k < r; ++k)
      change[k] = static_cast<double>(model.training_latents[i * r + k]) -
                  static_cast<double>(model.training_latents[(i - 1) * r + k]);
    fastest = std::max(fastest, scaled_norm(model, change) / model.frame_time);
  }
  return fastest;
}

double latent_distance(const ReducedModel& model, const std::vector<double>& latent) {
  const auto r = static_cast<std::size_t>(model.latents());
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + r <= model.training_latents.size(); i += r) {
    double distance2 = 0;
    for (std::size_t j = 0; j < r; ++j) {
      const double d =
          (latent[j] - static_cast<double>(model.training_latents[i + j])) / static_cast<double>(model.latent_scale[j]);
      distance2 += d * d;
    }
    least = std::min(least, distance2);
  }
  return std::sqrt(least);
}

}  // namespace graupel::rom
