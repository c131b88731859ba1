// graupel generate: recipe + seed -> data set. Each scene is one file until all are there; then each split becomes one.
#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/common_options.h"
#include "apps/scene_batches.h"
#include "apps/verbs.h"
#include "core/atomic_file.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/file_lock.h"
#include "io/recipe_reader.h"
#include "io/trajectory_file.h"
#include "mpm/scene_recipe.h"

namespace graupel::apps {

namespace fs = std::filesystem;

namespace {

struct GenerateOptions {
  CommonOptions common;
  std::string recipe, output, shard = "0/1", fields;
  std::vector<std::string> set;
  int64_t minutes = 0, batch = 0;
  double connectivity_radius = 0.035;
};

struct Shard {
  int64_t i = 0, n = 1;
};

Shard parse_shard(const std::string& text) {
  Shard shard;
  char tail = 0;
  long long i = 0, n = 0;
  if (std::sscanf(text.c_str(), "%lld/%lld%c", &i, &n, &tail) != 2 || n < 1 || i < 0 || i >= n)
    throw ConfigError("--shard '" + text + "' is not I/N with 0 <= I < N. Example: --shard 2/8");
  shard.i = i;
  shard.n = n;
  return shard;
}

int64_t count_of(const SceneRecipe& recipe, mpm::Split split) {
  switch (split) {
    case mpm::Split::train:
      return recipe.counts.train;
    case mpm::Split::valid:
      return recipe.counts.valid;
    case mpm::Split::test:
      return recipe.counts.test;
  }
  return 0;
}

constexpr mpm::Split all_splits[] = {mpm::Split::test, mpm::Split::valid, mpm::Split::train};

/// Makes a data set in a folder: which scenes are missing, running them, merging the splits.
class DataSet {
 public:
  DataSet(const GenerateOptions& options, const SceneRecipe& recipe, Device device)
      : options_(options),
        recipe_(recipe),
        device_(device),
        folder_(options.output),
        shard_(parse_shard(options.shard)),
        fields_(FieldSet::parse(options.fields)) {
    recipe_json_ = io::recipe_to_json(recipe);
  }

  void run() {
    make_folder(folder_);
    run_jobs(missing_scenes());
    merge();
  }

 private:
  /// Shards may run at once: one at a time looks at what is there, and merges.
  FileLock lock() const { return FileLock::wait(folder_ / ".lock"); }

  /// The scenes of this shard that the folder lacks.
  std::vector<SceneJob> missing_scenes() const {
    const FileLock hold = lock();
    make_folder(folder_ / "parts");
    check_or_write_card();
    std::vector<SceneJob> jobs;
    int64_t number = 0, present = 0;
    for (const mpm::Split split : all_splits) {
      const bool merged = is_complete(split_file(split));
      for (int64_t i = 0; i < count_of(recipe_, split); ++i, ++number) {
        if (number % shard_.n != shard_.i) continue;
        if (merged || is_complete(part_file({split, i})))
          ++present;
        else
          jobs.push_back({split, i});
      }
    }
    if (present > 0) std::fprintf(stderr, "generate: %lld scenes are there already\n", static_cast<long long>(present));
    return jobs;
  }

  fs::path split_file(mpm::Split split) const { return folder_ / (std::string(mpm::name_of(split)) + ".h5"); }
  fs::path part_file(const SceneJob& job) const {
    return folder_ / "parts" / fmt::format("{}-{:05d}.h5", mpm::name_of(job.split), job.index);
  }

  static bool is_complete(const fs::path& file) {
    if (!fs::exists(file)) return false;
    try {
      const io::TrajectoryReader reader(file);
      return reader.complete() && reader.attribute(0, "recovered").empty();  // a recovered one lacks frames
    } catch (const InputError&) {
      return false;  // a damaged part is made again
    }
  }

  /// dataset.json says what the folder holds; a folder of another recipe or seed is refused, and one of another device,
  /// on which the same scene gives other bytes.
  void check_or_write_card() const {
    const fs::path card = folder_ / "dataset.json";
    nlohmann::ordered_json facts = {{"recipe", nlohmann::ordered_json::parse(recipe_json_)},
                                    {"seed", options_.common.seed},
                                    {"device", name_of(device_)},
                                    {"fields", fields_.names()},
                                    {"made_by", version_text()}};
    if (fs::exists(card)) {
      const auto old = nlohmann::ordered_json::parse(read_file(card), nullptr, false);
      if (old.is_discarded() || old.value("recipe", nlohmann::ordered_json()) != facts["recipe"] ||
          old.value("seed", uint64_t(0)) != options_.common.seed)
        throw ConfigError(
            "'" + folder_.string() +
            "' holds a data set of another recipe or seed. Choose another --output, or remove that folder");
      const std::string device = old.value("device", std::string(name_of(device_)));
      if (device != name_of(device_))
        throw ConfigError("'" + folder_.string() + "' holds a data set of another device (there " + device + ", here " +
                          name_of(device_) + "). Use --device " + device + ", or choose another --output");
      if (const std::string fields = old.value("fields", std::string()); fields != fields_.names())
        throw ConfigError("'" + folder_.string() + "' holds a data set with other fields (there '" + fields +
                          "', here '" + fields_.names() + "'). Use the same --fields, or choose another --output");
      return;
    }
    write_file_atomically(card, facts.dump(2) + "\n");
  }

  void run_jobs(const std::vector<SceneJob>& jobs) const {
    SceneBatchOptions batches;
    batches.seed = options_.common.seed;
    batches.device = device_;
    batches.fields = fields_;
    batches.batch = options_.batch > 0 ? options_.batch : default_batch(device_);
    batches.minutes = options_.minutes;
    batches.file = [this](const SceneJob& job) { return part_file(job).string(); };
    batches.log_redraw = [this](const SceneJob& job, const std::string& reason) { log_redraw(job, reason); };
    run_scenes(recipe_, jobs, batches);
    stop_if_interrupted("; run the same command again to go on");
  }

  void log_redraw(const SceneJob& job, const std::string& reason) const {
    const nlohmann::ordered_json line = {{"split", mpm::name_of(job.split)},
                                         {"index", job.index},
                                         {"attempt", job.attempt},
                                         {"redrawn_because", reason}};
    const std::string path = folder_ / "redrawn.jsonl";
    std::FILE* log = std::fopen(path.c_str(), "a");
    const bool written = log != nullptr && std::fprintf(log, "%s\n", line.dump().c_str()) > 0;
    const bool closed = log != nullptr && std::fclose(log) == 0;
    if (!written || !closed)
      throw IoError("cannot write to '" + path + "' (" + std::strerror(errno) +
                    "). Free space on that disk, or choose a folder you may write to");
    std::fprintf(stderr, "generate: %s scene %lld diverged and is redrawn (%s)\n", mpm::name_of(job.split),
                 static_cast<long long>(job.index), reason.c_str());
  }

  void merge() {
    const FileLock hold = lock();
    nlohmann::ordered_json result = {{"folder", folder_.string()}};
    bool whole = true;
    for (const mpm::Split split : all_splits) {
      const int64_t count = count_of(recipe_, split);
      if (count == 0 || is_complete(split_file(split))) {
        remove_parts(split);  // of a run that was killed after the merge
        result[mpm::name_of(split)] = count;
        continue;
      }
      std::vector<std::string> parts;
      for (int64_t i = 0; i < count; ++i)
        if (is_complete(part_file({split, i}))) parts.push_back(part_file({split, i}));
      if (static_cast<int64_t>(parts.size()) < count) {
        std::fprintf(stderr,
                     "generate: %s has %zu of %lld scenes; run the same command (or the other shards) for the rest\n",
                     mpm::name_of(split), parts.size(), static_cast<long long>(count));
        whole = false;
        continue;
      }
      io::merge_trajectories(parts, split_file(split));
      remove_parts(split);
      result[mpm::name_of(split)] = count;
    }
    result["complete"] = whole;
    if (whole) {
      std::error_code not_empty;  // while another run of the same shard is at work
      fs::remove(folder_ / "parts", not_empty);
      if (recipe_.counts.train > 0)
        io::write_data_set_metadata(folder_, mpm::draw_scene(recipe_, options_.common.seed, mpm::Split::train, 0),
                                    options_.connectivity_radius);
      std::fprintf(stderr, "generate: '%s' is complete\n", folder_.c_str());
    }
    options_.common.write_json(result);
    if (whole) fs::remove(folder_ / ".lock");
  }

  void remove_parts(mpm::Split split) const {
    for (int64_t i = 0; i < count_of(recipe_, split); ++i) fs::remove(part_file({split, i}));
  }

  const GenerateOptions& options_;
  const SceneRecipe& recipe_;
  Device device_;
  fs::path folder_;
  Shard shard_;
  FieldSet fields_;
  std::string recipe_json_;
};

void generate(GenerateOptions& options) {
  const Device device = options.common.apply();
  const SceneRecipe recipe = io::read_recipe(options.recipe, options.set);
  DataSet(options, recipe, device).run();
}

}  // namespace

void add_generate(CLI::App& app) {
  auto options = std::make_shared<GenerateOptions>();
  CLI::App* verb = app.add_subcommand("generate", "Make a data set of random scenes");
  verb->add_option("recipe", options->recipe, "Recipe file (scenes/recipes/*.json)")->required();
  verb->add_option("-o,--output", options->output, "Folder of the data set")->required();
  verb->add_option("--set", options->set, "Change a recipe key: --set counts.train=100 (repeatable)")
      ->allow_extra_args(false);
  verb->add_option("--fields", options->fields,
                   "Store these of every frame too: stress,affine,deformation_gradient,plastic");
  verb->add_option("--shard", options->shard, "Make every N-th scene, from I on: I/N")->capture_default_str();
  verb->add_option(
          "--batch", options->batch,
          "Scenes that advance together (0: 64 on a GPU, 1 a thread on the CPU); the bytes do not depend on it")
      ->check(whole_number(0))
      ->capture_default_str();
  verb->add_option("--minutes", options->minutes, "Start no scene after this time (0: no limit)")
      ->check(real_number(LowerBound::zero));
  verb->add_option("--connectivity-radius", options->connectivity_radius,
                   "Written to metadata.json for graph networks [m]")
      ->check(real_number(LowerBound::above_zero))
      ->capture_default_str();
  options->common.add_to(*verb);
  verb->footer(
      "Complete scenes are skipped, so an interrupted run goes on; a scene that diverges is redrawn and logged in "
      "redrawn.jsonl.\n"
      "A scene's bytes depend on the recipe, the seed, its index and the kind of device alone: not on the batch, the\n"
      "shard or the threads.\n\nExamples:\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --set counts.train=100\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --shard 3/8\n"
      "  graupel generate scenes/recipes/hgn.json -o data/hgn --device cuda --batch 128");
  verb->callback([options] { generate(*options); });
}

}  // namespace graupel::apps
