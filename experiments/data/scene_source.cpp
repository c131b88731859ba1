#include "experiments/data/scene_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "io/scene/category_reader.h"
#include "io/scene/recipe_reader.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_reader.h"
#include "mpm/memory_need.h"
#include "mpm/sampling.h"
#include "mpm/scene/categories/category_scene.h"

namespace graupel::experiments {

namespace {

constexpr int64_t most_scenes_at_once = 64;
/// Particles that fill a GPU several times over; more at once cost memory and gain nothing.
constexpr double particles_at_once = 4e6;

/// Scenes drawn at random from a SceneRecipe or a CategoryRecipe.
template <typename Recipe>
class RandomScenes : public SceneSource {
 public:
  /// `json`: the recipe's text.
  RandomScenes(Recipe recipe, std::string path, std::string json, const std::string& fields, uint64_t seed)
      : recipe_(std::move(recipe)),
        path_(std::move(path)),
        json_(std::move(json)),
        fields_(FieldSet::parse(fields)),
        seed_(seed) {}

  std::string name() const override { return recipe_.name; }
  int64_t count(mpm::Split split) const override {
    switch (split) {
      case mpm::Split::train:
        return recipe_.counts.train;
      case mpm::Split::valid:
        return recipe_.counts.valid;
      case mpm::Split::test:
        return recipe_.counts.test;
    }
    return 0;
  }
  int64_t frames() const override { return recipe_.frames; }
  uint64_t seed() const override { return seed_; }
  FieldSet fields() const override { return fields_; }
  int deflate() const override { return 1; }
  bool velocities() const override { return false; }
  OnDivergence on_divergence() const override { return OnDivergence::redraw; }
  int64_t default_batch(Device device) const override { return device == Device::cuda ? most_scenes_at_once : 1; }
  Scene scene(const SceneJob& job) const override {
    try {
      return mpm::draw_scene(recipe_, seed_, job.split, job.index, job.attempt);
    } catch (const ConfigError& error) {
      throw ConfigError("'" + path_ + "': " + error.what());
    }
  }
  std::vector<io::NamedValue> parameters(const SceneJob&) const override { return {}; }
  std::string text(const SceneJob& job) const override {
    return fmt::format("{} scene {}", mpm::name_of(job.split), job.index);
  }
  nlohmann::ordered_json card() const override { return {{"recipe", nlohmann::ordered_json::parse(json_)}}; }

 private:
  Recipe recipe_;
  std::string path_, json_;
  FieldSet fields_;
  uint64_t seed_;
};

/// The runs of a sweep (core/scene/recipes/sweep_recipe.h), which all start with the same particles.
class SweepScenes : public SceneSource {
 public:
  explicit SweepScenes(const SceneSourceOptions& options) : sweep_(io::read_sweep(options.recipe, options.set)) {
    if (!options.fields.empty()) sweep_.recipe.fields_stored = options.fields;
    fields_ = FieldSet::parse(sweep_.recipe.fields_stored);
    seed_ = options.seed_given ? options.seed : sweep_.scenes.front().seed;
    sort_runs();
    check_particles(options.recipe);
  }

  std::string name() const override { return sweep_.recipe.name; }
  int64_t count(mpm::Split split) const override { return static_cast<int64_t>(runs_of(split).size()); }
  int64_t frames() const override { return sweep_.scenes.front().frames; }
  uint64_t seed() const override { return seed_; }
  FieldSet fields() const override { return fields_; }
  int deflate() const override { return static_cast<int>(sweep_.recipe.deflate); }
  bool velocities() const override { return true; }
  OnDivergence on_divergence() const override { return OnDivergence::report; }
  int64_t default_batch(Device device) const override {
    if (device != Device::cuda) return 1;
    return std::clamp<int64_t>(static_cast<int64_t>(particles_at_once / particles_), 1, most_scenes_at_once);
  }
  Scene scene(const SceneJob& job) const override {
    const int64_t run = run_of(job);
    Scene scene = sweep_.scenes[static_cast<std::size_t>(run)];
    scene.name = fmt::format("{}-{:05d}", sweep_.recipe.name, run);
    scene.seed = seed_;
    return scene;
  }
  std::vector<io::NamedValue> parameters(const SceneJob& job) const override {
    std::vector<io::NamedValue> values;
    for (const SweepParameter& parameter : sweep_.recipe.parameters) {
      values.push_back(
          {parameter.name, parameter.unit, parameter.values[static_cast<std::size_t>(run_of(job))], {parameter.key}});
      for (const SweepFollower& follower : parameter.also) values.back().keys.push_back(follower.key);
    }
    return values;
  }
  std::string text(const SceneJob& job) const override { return sweep_.run_text(run_of(job)); }
  nlohmann::ordered_json card() const override {
    return {{"recipe", nlohmann::ordered_json::parse(io::sweep_to_json(sweep_.recipe))},
            {"scene", nlohmann::ordered_json::parse(sweep_.base_scene)}};
  }

 private:
  const std::vector<int64_t>& runs_of(mpm::Split split) const {
    return split == mpm::Split::train ? train_ : split == mpm::Split::valid ? sweep_.recipe.valid : sweep_.recipe.test;
  }
  int64_t run_of(const SceneJob& job) const { return runs_of(job.split)[static_cast<std::size_t>(job.index)]; }

  /// Runs that are for neither testing nor validation are for training.
  void sort_runs() {
    const auto is_in = [](const std::vector<int64_t>& list, int64_t run) {
      return std::find(list.begin(), list.end(), run) != list.end();
    };
    for (int64_t run = 0; run < sweep_.run_count(); ++run)
      if (!is_in(sweep_.recipe.test, run) && !is_in(sweep_.recipe.valid, run)) train_.push_back(run);
  }

  /// A reduced model has one set of reference points: that of the particles at the start, in every run.
  void check_particles(const std::string& file) {
    const Scene& first = sweep_.scenes.front();
    particles_ = std::max(1.0, mpm::least_memory(first, {}).particles);
    const std::string bodies = bodies_of(first);
    std::vector<Vec3d> expected;
    for (int64_t run = 1; run < sweep_.run_count(); ++run) {
      const Scene& scene = sweep_.scenes[static_cast<std::size_t>(run)];
      if (bodies_of(scene) == bodies) continue;
      if (expected.empty()) expected = mpm::sample_sources(first, seed_).position;
      const std::size_t count = expected.size();
      const std::vector<Vec3d> position = mpm::sample_sources(scene, seed_).position;
      if (position == expected) continue;
      throw ConfigError(fmt::format(
          "{}: {} starts with other particles than run 0 ({} and {}), which a reduced model cannot be trained on. Vary "
          "what does not move the particles at the start: materials, velocities, gravity, walls, obstacles, scripts",
          file, sweep_.run_text(run), position.size(), count));
    }
  }

  /// What decides on the particles at the start, as text.
  static std::string bodies_of(const Scene& scene) {
    Scene bare;
    bare.domain = scene.domain;
    bare.sources = scene.sources;
    bare.emitters = scene.emitters;
    for (Source& source : bare.sources) {
      source.velocity = source.angular_velocity = Vec3d::zero();
      source.spin_center.reset();
    }
    return io::scene_to_json(bare);
  }

  io::Sweep sweep_;
  FieldSet fields_;
  uint64_t seed_ = 0;
  std::vector<int64_t> train_;
  double particles_ = 1;  ///< of a run, about
};

}  // namespace

bool is_recipe(const std::string& path) { return io::is_recipe(path) || io::is_sweep(path); }

std::unique_ptr<SceneSource> open_recipe(const SceneSourceOptions& options) {
  if (io::is_sweep(options.recipe)) return std::make_unique<SweepScenes>(options);
  if (io::is_category_recipe(options.recipe)) {
    CategoryRecipe recipe = io::read_category_recipe(options.recipe, options.set);
    const std::string json = io::category_recipe_to_json(recipe),
                      fields = options.fields.empty() ? recipe.fields_stored : options.fields;
    return std::make_unique<RandomScenes<CategoryRecipe>>(std::move(recipe), options.recipe, json, fields,
                                                          options.seed);
  }
  SceneRecipe recipe = io::read_recipe(options.recipe, options.set);
  const std::string json = io::recipe_to_json(recipe);
  return std::make_unique<RandomScenes<SceneRecipe>>(std::move(recipe), options.recipe, json, options.fields,
                                                     options.seed);
}

}  // namespace graupel::experiments
