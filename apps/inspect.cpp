// graupel inspect: what is in a scene, a sweep, a trajectory, a saved state, a weights file, a .vdb grid or folders of
// training runs; recovers a trajectory after a kill.
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/system/error.h"
#include "experiments/process/progress.h"
#include "experiments/inspection/training_curves.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_reader.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"
#include "nn/weights.h"
#include "sparsegrid/cell_normals.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::apps {

using namespace experiments;

namespace {

using Json = nlohmann::ordered_json;

struct InspectOptions {
  CommonOptions common;
  std::vector<std::string> files;
  std::string plots;
  bool recover = false;
};

Json grid_json(const sparsegrid::GridFacts& g) {
  return {{"name", g.name},
          {"class", g.grid_class},
          {"voxel_m", g.voxel},
          {"active_voxels", g.active_voxels},
          {"bytes", g.bytes},
          {"index_low", {g.index_low[0], g.index_low[1], g.index_low[2]}},
          {"index_high", {g.index_high[0], g.index_high[1], g.index_high[2]}},
          {"world_low_m", {g.world_low[0], g.world_low[1], g.world_low[2]}},
          {"world_high_m", {g.world_high[0], g.world_high[1], g.world_high[2]}},
          {"background_m", g.background},
          {"min_m", g.min_value},
          {"max_m", g.max_value}};
}

Json inspect_scene(const std::string& file) {
  const Scene scene = io::read_scene(file);
  const sparsegrid::ObstacleSet obstacles(scene);
  const sparsegrid::CellNormals normals(scene, obstacles);
  Json grids = Json::array();
  for (int i = 0; i < obstacles.count(); ++i) grids.push_back(grid_json(obstacles.facts(i)));
  return {{"kind", "scene"},
          {"name", scene.name},
          {"description", scene.description},
          {"materials", scene.materials.size()},
          {"sources", scene.sources.size()},
          {"frames", scene.frames},
          {"frame_time_s", scene.frame_time},
          {"dx_m", scene.domain.dx},
          {"obstacle_grids", grids},
          {"normal_cells", normals.active_cells()},
          {"normal_bytes", normals.bytes()}};
}

Json inspect_sweep(const std::string& file) {
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

Json inspect_trajectory(const std::string& file) {
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
    if (const FieldSet fields = reader.fields(i); !fields.empty()) list.back()["fields"] = fields.names();
    for (const io::NamedValue& parameter : reader.parameters(i)) {
      Json& entry = list.back()["parameters"][parameter.name];
      entry["value"] = parameter.value;
      if (!parameter.unit.empty()) entry["unit"] = parameter.unit;
    }
    if (!reader.attribute(i, "recovered").empty()) list.back()["recovered"] = true;
  }
  return {{"kind", "trajectory"}, {"complete", reader.complete()}, {"trajectories", list}};
}

Json inspect_state(const std::string& file) {
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

Json inspect_weights(const std::string& file) {
  const nn::Weights weights = nn::read_safetensors(file);
  int64_t parameters = 0;
  Json tensors = Json::object();
  for (const auto& [name, tensor] : weights.tensors) {
    parameters += tensor.count();
    tensors[name] = tensor.shape;
  }
  return {{"kind", "weights"}, {"parameters", parameters}, {"metadata", weights.metadata}, {"tensors", tensors}};
}

Json inspect_grids(const std::string& file) {
  Json grids = Json::array();
  for (const auto& g : sparsegrid::inspect_vdb(file)) grids.push_back(grid_json(g));
  return {{"kind", "vdb"}, {"grids", grids}};
}

/// `file` is the finished name; what is on disk is `file`.part.
Json recover(const std::string& file) {
  const std::string whole = file.ends_with(".part") ? file.substr(0, file.size() - 5) : file;
  const int64_t frames = io::recover_part_file(whole, true);
  if (frames == 0)
    throw InputError("no frame of '" + whole +
                     ".part' could be recovered (the run was ended before its first flush). Run it again");
  return {{"kind", "recovered"}, {"file", whole}, {"frames", frames}};
}

/// Plain text: one "key: value" a line, nested values indented; long lists of tensors stay in the JSON.
void print(const Json& value, int indent) {
  for (const auto& [key, item] : value.items()) {
    if (key == "tensors") continue;
    if (item.is_object() || (item.is_array() && !item.empty() && item.front().is_object())) {
      std::printf("%*s%s:\n", indent, "", key.c_str());
      print(item, indent + 2);
    } else {
      std::printf("%*s%s: %s\n", indent, "", key.c_str(),
                  item.is_string() ? item.get<std::string>().c_str() : item.dump().c_str());
    }
  }
}

void print(const TrainingCurve& curve) {
  std::printf("%s\n%10s %10s %28s %22s\n", curve.name.c_str(), "step", "minutes", "one-step, of the baseline's",
              "rollout MSE [m^2]");
  for (const Validation& v : curve.validations)
    std::printf("%10.0f %10.2f %28.4g %22.4g\n", v.step, v.seconds / 60, v.one_step, v.rollout_mse);
}

Json inspect_runs(const InspectOptions& options) {
  std::vector<TrainingCurve> curves;
  Json runs = Json::array();
  for (const std::string& folder : options.files) {
    if (!is_run_folder(folder))
      throw ConfigError("'" + folder +
                        "' is no folder of a training run (it has no metrics.csv), and several files can be inspected "
                        "only where all are. Name run folders");
    curves.push_back(read_training_curve(folder));
    print(curves.back());
    runs.push_back(to_json(curves.back()));
  }
  Json result = {{"kind", "training runs"}, {"runs", runs}};
  if (options.plots.empty()) return result;
  const std::vector<std::string> plots = write_training_plots(curves, options.plots);
  result["plots"] = plots;
  for (const std::string& file : plots) std::printf("%s\n", file.c_str());
  return result;
}

Json inspect_file(const std::string& file) {
  if (io::is_state_file(file)) return inspect_state(file);
  if (file.ends_with(".json")) return io::is_sweep(file) ? inspect_sweep(file) : inspect_scene(file);
  if (file.ends_with(".h5")) return inspect_trajectory(file);
  if (file.ends_with(".safetensors")) return inspect_weights(file);
  if (file.ends_with(".vdb")) return inspect_grids(file);
  throw ConfigError(
      "'" + file +
      "' is no saved state, no folder of a training run and has no known ending (allowed: .json scene or sweep, .h5 "
      "trajectory, .safetensors weights, .vdb grids). Name one of these");
}

void inspect(InspectOptions& options) {
  options.common.apply();
  const std::string& first = options.files.front();
  const bool runs = options.files.size() > 1 || is_run_folder(first);
  if (runs && options.recover)
    throw ConfigError(
        "--recover is for one trajectory ('" + first +
        (options.files.size() > 1 ? "' and others were named). Name one FILE" : "' is a training run). Leave it out"));
  if (!runs && !options.plots.empty())
    throw ConfigError("--plots is for folders of training runs ('" + first + "' is none). Leave it out");
  const Json result = runs ? inspect_runs(options) : options.recover ? recover(first) : inspect_file(first);
  if (!runs) print(result, 0);
  options.common.write_json(result);
}

}  // namespace

void add_inspect(CLI::App& app) {
  auto options = std::make_shared<InspectOptions>();
  CLI::App* verb = app.add_subcommand(
      "inspect", "Look into a scene, sweep, trajectory, saved state, weights, .vdb file or training runs");
  verb->add_option("file", options->files, "A .json, .h5, .safetensors or .vdb file, a saved state; or run folders")
      ->required();
  verb->add_option("--plots", options->plots, "Plot what training runs measured over time, into this folder (.svg)");
  verb->add_flag("--recover", options->recover,
                 "Make FILE from FILE.part, which a killed run left: every frame whose checksums pass");
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel inspect models/hgn.safetensors\n  graupel inspect --recover steps.h5\n"
      "  graupel inspect runs/hgn runs/gns --plots curves");
  verb->callback([options] { inspect(*options); });
}

}  // namespace graupel::apps
