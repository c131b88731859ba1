#include "train/loop/provenance.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/scene/scene_reader.h"
#include "nn/trained_box.h"
#include "train/networks/network_module.h"

namespace graupel::train {

namespace {

/// Every field of the materials of a stored scene.
std::string resolved_materials(const std::string& scene_json, const std::string& file) {
  const Scene scene = io::parse_stored_scene(scene_json, file, file);
  return nlohmann::json::parse(io::scene_to_json(scene)).at("materials").dump();
}

}  // namespace

std::map<std::string, std::string> training_provenance(const TrainingOptions& options, const CheckpointState& state,
                                                       const DataSplit& data,
                                                       const std::optional<Validation>& validation,
                                                       const Teacher* teacher) {
  std::map<std::string, std::string> entries;
  entries["training.steps"] = std::to_string(state.step);
  entries["training.scene_samples"] = std::to_string(state.step * options.config.batch_scenes);
  entries["training.seconds"] = std::to_string(state.seconds);
  entries["training.seed"] = std::to_string(options.config.seed);
  entries["training.noise_std"] = std::to_string(options.config.noise_std);
  entries["training.device"] =
      options.device == Device::cuda ? cuda_device_name() : std::string(name_of(options.device));
  entries["training.torch"] = torch_version();
  entries["training.ranks"] = std::to_string(options.comm->size());
  entries["training.data"] = std::filesystem::path(options.data).filename();
  entries["training.data_trajectories"] = std::to_string(data.count());
  if (teacher) {
    entries["training.teacher"] = std::filesystem::path(teacher->file).filename();
    entries["training.teacher_hash"] = teacher->hash;
    entries["training.teacher_share"] = std::to_string(options.config.teacher_share);
  }
  // What a network has not seen it does not know: users must know what that was.
  entries["training.materials"] = resolved_materials(data.scene_json(0), data.file());
  bool tells_constants = true;
  nn::TrainedBox box;
  for (int i = 0; i < data.count(); ++i) {
    box.widen(data.trajectory(i).context->scene);
    tells_constants = tells_constants && !data.trajectory(i).converted;  // other programs' data need not tell them
  }
  if (tells_constants) box.store(entries);
  for (const char* name : {"recipe", "recipe_seed"})
    if (const std::string value = data.attribute(name); !value.empty())
      entries[std::string("training.data_") + name] = value;
  if (validation) {
    const SquaredErrors all = validation->one_step.all();
    entries["training.validation_one_step_normalized"] = std::to_string(all.normalized_mse(Predictor::network));
    char text[32];
    std::snprintf(text, sizeof(text), "%.6e", all.raw_mse(Predictor::network));
    entries["training.validation_one_step_raw"] = text;
    if (std::isfinite(validation->rollout_mse)) {
      std::snprintf(text, sizeof(text), "%.6e", validation->rollout_mse);
      entries["training.validation_rollout_mse"] = text;
    }
  }
  return entries;
}

}  // namespace graupel::train
