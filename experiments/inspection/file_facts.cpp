#include "experiments/inspection/file_facts.h"

#include <map>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/comparison/floor_file.h"
#include "experiments/process/input_file.h"
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_reader.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/simulation.h"
#include "nn/offline_cost.h"
#include "nn/weights.h"
#include "sparsegrid/cell_normals.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::ordered_json;

/// What a grid has not is null: an empty one has no box, one of vectors or points no numbers.
Json grid_json(const sparsegrid::GridFacts& g) {
  const bool any = g.active_voxels > 0;
  const auto corner = [any](const auto& x) { return any ? Json({x[0], x[1], x[2]}) : Json(); };
  const auto number = [](double value, bool there) { return there ? Json(value) : Json(); };
  return {{"name", g.name},
          {"class", g.grid_class},
          {"voxel_m", g.voxel},
          {"active_voxels", g.active_voxels},
          {"bytes", g.bytes},
          {"index_low", corner(g.index_low)},
          {"index_high", corner(g.index_high)},
          {"world_low_m", corner(g.world_low)},
          {"world_high_m", corner(g.world_high)},
          {"background_m", number(g.background, g.holds_numbers)},
          {"min_m", number(g.min_value, any && g.holds_numbers)},
          {"max_m", number(g.max_value, any && g.holds_numbers)}};
}

Json scene_facts(const std::string& file) {
  const Scene scene = io::read_scene(file);
  const sparsegrid::ObstacleSet obstacles(scene);
  const sparsegrid::CellNormals normals(scene, obstacles);
  const mpm::Estimate run = mpm::estimate(scene, {.seed = scene.seed});  // refuses what simulate refuses
  Json grids = Json::array();
  for (int i = 0; i < obstacles.count(); ++i) grids.push_back(grid_json(obstacles.facts(i)));
  return {{"kind", "scene"},
          {"name", scene.name},
          {"description", scene.description},
          {"materials", scene.materials.size()},
          {"sources", scene.sources.size()},
          {"particles", run.particles},
          {"substeps", run.substeps},
          {"frames", scene.frames},
          {"frame_time_s", scene.frame_time},
          {"dx_m", scene.domain.dx},
          {"obstacle_grids", grids},
          {"normal_cells", normals.active_cells()},
          {"normal_bytes", normals.bytes()}};
}

Json sweep_facts(const std::string& file) {
  const io::Sweep sweep = io::read_sweep(file);
  Json parameters = Json::object();
  for (const SweepParameter& parameter : sweep.recipe.parameters) {
    Json& entry = parameters[parameter.name] = {{"key", parameter.key}, {"values", parameter.values}};
    if (!parameter.unit.empty()) entry["unit"] = parameter.unit;
  }
  return {{"kind", "sweep"},
          {"name", sweep.recipe.name},
          {"description", sweep.recipe.description},
          {"scene", sweep.recipe.scene},
          {"runs", sweep.run_count()},
          {"test", sweep.recipe.test},
          {"valid", sweep.recipe.valid},
          {"frames", sweep.scenes.front().frames},
          {"fields", sweep.recipe.fields_stored},
          {"parameters", parameters}};
}

template <typename Recipe>
Json recipe_facts(const Recipe& recipe) {
  return {{"kind", "recipe"},
          {"name", recipe.name},
          {"description", recipe.description},
          {"train", recipe.counts.train},
          {"valid", recipe.counts.valid},
          {"test", recipe.counts.test},
          {"frames", recipe.frames},
          {"frame_time_s", recipe.frame_time}};
}

Json floor_facts(const std::string& file) {
  const FloorFile floor_file(file);
  Json scenes = Json::object();
  for (const auto& [name, floors] : floor_file.scenes()) scenes[name] = {{"frames", floors.frames}};
  return {{"kind", "chaos floors"}, {"scenes", scenes}};
}

Json document_facts(const std::string& file) {
  if (is_floor_file(file)) return floor_facts(file);
  if (io::is_sweep(file)) return sweep_facts(file);
  if (io::is_category_recipe(file)) return recipe_facts(io::read_category_recipe(file));
  return io::is_recipe(file) ? recipe_facts(io::read_recipe(file)) : scene_facts(file);
}

/// Of 'generate' and 'convert'.
Json data_set_facts(const std::string& folder) {
  const Json card = Json::parse(read_file(folder + "/dataset.json"), nullptr, false);
  Json splits = Json::object();
  for (const char* split : {"train", "valid", "test"}) {
    const std::string file = folder + "/" + split + ".h5";
    if (!is_there(file)) continue;
    const io::TrajectoryReader reader(file);
    splits[split] = {{"trajectories", reader.count()}, {"complete", reader.complete()}};
    if (reader.count() > 0) splits[split]["frames"] = reader.header(0).frame_count();
  }
  Json facts = {{"kind", "data set"}, {"folder", folder}, {"splits", splits}};
  for (const char* key : {"seed", "device", "fields", "made_by"})
    if (card.is_object() && card.contains(key)) facts[key] = card[key];
  return facts;
}

Json trajectory_facts(const std::string& file) {
  const io::TrajectoryReader reader(file);
  Json list = Json::array();
  for (int i = 0; i < reader.count(); ++i) {
    const Trajectory t = reader.header(i);
    std::map<std::string, int64_t> types;
    for (const int32_t type : t.particle_type) ++types[particle_type_name(type)];
    list.push_back({{"index", i},
                    {"particles", t.particle_count()},
                    {"types", types},
                    {"frames", t.frame_count()},
                    {"frame_time_s", t.frame_time},
                    {"seed", t.seed},
                    {"made_by", t.made_by},
                    {"diverged_at_frame", t.diverged_at_frame},
                    {"has_scene", !t.scene_json.empty()}});
    if (!t.materials.empty()) list.back()["materials"] = t.materials.names;
    if (const FieldSet fields = reader.fields(i); !fields.empty()) list.back()["fields"] = fields.names();
    if (const auto names = reader.contact_names(i); !names.empty()) list.back()["forces_on"] = names;
    for (const io::NamedValue& parameter : reader.parameters(i)) {
      Json& entry = list.back()["parameters"][parameter.name];
      entry["value"] = parameter.value;
      if (!parameter.unit.empty()) entry["unit"] = parameter.unit;
    }
    if (!reader.attribute(i, "recovered").empty()) list.back()["recovered"] = true;
  }
  return {{"kind", "trajectory"}, {"complete", reader.complete()}, {"trajectories", list}};
}

Json state_facts(const std::string& file) {
  const io::SavedRun run = io::read_state_file(file);
  const Json scene = Json::parse(run.scene_json, nullptr, false);
  return {{"kind", "saved state"},
          {"scene", scene.is_object() ? scene.value("name", "") : ""},
          {"frame", run.frame},
          {"of_frames", scene.is_object() ? scene.value("frames", Scene().frames) : 0},
          {"time_s", run.time},
          {"particles", run.particles},
          {"precision", run.precision},
          {"device", run.device},
          {"seed", run.seed},
          {"made_by", run.version},
          {"trajectory", run.output},
          {"fields", run.fields.names()},
          {"state_bytes", run.state.size()},
          {"recent_frames", run.recent.size()}};
}

Json weights_facts(const std::string& file) {
  const nn::Weights weights = nn::read_safetensors(file);
  nn::offline_cost_of(weights.metadata, file);  // refuses what compare refuses
  int64_t parameters = 0;
  Json tensors = Json::object();
  for (const auto& [name, tensor] : weights.tensors) {
    parameters += tensor.count();
    tensors[name] = tensor.shape;
  }
  return {{"kind", "weights"}, {"parameters", parameters}, {"metadata", weights.metadata}, {"tensors", tensors}};
}

Json vdb_facts(const std::string& file) {
  Json grids = Json::array();
  for (const auto& g : sparsegrid::inspect_vdb(file)) grids.push_back(grid_json(g));
  return {{"kind", "vdb"}, {"grids", grids}};
}

}  // namespace

nlohmann::ordered_json file_facts(const std::string& file) {
  check_readable(file);
  if (is_there(file + "/dataset.json")) return data_set_facts(file);
  if (is_folder(file))
    throw InputError("'" + file +
                     "' is a folder without a data set (dataset.json) and without a training run (metrics.csv). Name "
                     "a file in it");
  if (io::is_state_file(file)) return state_facts(file);
  if (file.ends_with(".json")) return document_facts(file);
  if (file.ends_with(".h5")) return trajectory_facts(file);
  if (file.ends_with(".safetensors")) return weights_facts(file);
  if (file.ends_with(".vdb")) return vdb_facts(file);
  throw InputError("'" + file +
                   "' is no saved state and has no known ending (allowed: .json scene or recipe, .h5 "
                   "trajectory, .safetensors weights, .vdb grids). Name one of these");
}

}  // namespace graupel::experiments
