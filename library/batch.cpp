#include "library/batch.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "core/parallel/parallel_tasks.h"
#include "mpm/simulation.h"

namespace graupel {

namespace {

std::string name_of(std::size_t i, const Scene& scene) {
  return scene.name.empty() ? fmt::format("scene {}", i) : fmt::format("scene {} ('{}')", i, scene.name);
}

/// prepare(), whose errors then name the scene.
template <typename Prepare>
void with_name(std::size_t i, const Scene& scene, const Prepare& prepare) {
  const auto named = [&](const Error& error) { return name_of(i, scene) + ": " + error.what(); };
  try {
    prepare();
  } catch (const ConfigError& error) {
    throw ConfigError(named(error));
  } catch (const InputError& error) {
    throw InputError(named(error));
  }
}

mpm::SimulationOptions options_of(const Scene& scene, std::size_t i, const BatchSettings& settings) {
  mpm::SimulationOptions options;
  options.device = settings.device;
  options.precision = settings.f64 ? mpm::Precision::f64 : mpm::Precision::f32;
  options.seed = settings.seeds.empty() ? scene.seed : settings.seeds[i];
  return options;
}

}  // namespace

struct Batch::Impl {
  using Frames = std::vector<std::shared_ptr<const ParticleFrame>>;

  std::vector<Scene> scenes;
  std::unique_ptr<mpm::SceneBatch> run;
  int64_t frames_done = 0;
  /// Copies of the present state; empty until they are asked for.
  std::map<std::string, Frames> frames;  ///< by the names of their fields
  std::map<ParticleQuantity, std::vector<std::shared_ptr<const float>>> on_device;

  void forget_copies() {
    frames.clear();
    on_device.clear();
  }
};

Batch::Batch(const std::vector<Scene>& scenes, const BatchSettings& settings) : impl_(std::make_unique<Impl>()) {
  if (settings.device == Device::cuda) parse_device("cuda");  // says what is missing
  if (scenes.empty()) throw ConfigError("the batch has no scene (allowed: 1 or more). Give it a list of scenes");
  if (!settings.seeds.empty() && settings.seeds.size() != scenes.size())
    throw ConfigError(
        fmt::format("the batch has {} seeds for {} scenes (allowed: one for each scene, or none). Give it "
                    "as many",
                    settings.seeds.size(), scenes.size()));
  impl_->scenes = scenes;
  for (Scene& scene : impl_->scenes)
    for (auto& [name, material] : scene.materials) material.name = name;
  std::vector<std::unique_ptr<mpm::PreparedScene>> made(scenes.size());
  for_each_task(scenes.size(), num_threads(), [&](std::size_t i) {
    const Scene& scene = impl_->scenes[i];
    with_name(i, scene, [&] { made[i] = std::make_unique<mpm::PreparedScene>(scene, options_of(scene, i, settings)); });
  });
  std::vector<mpm::PreparedScene> prepared;
  prepared.reserve(made.size());
  for (auto& one : made) {
    prepared.push_back(std::move(*one));
    one.reset();
  }
  try {
    impl_->run = mpm::SceneBatch::create(prepared);
  } catch (const ConfigError&) {
    for (std::size_t i = 0; i < prepared.size(); ++i)
      with_name(i, scenes[i], [&] { mpm::SceneBatch::create({prepared[i]}); });  // throws for the one that it was
    throw;
  }
}
Batch::Batch(Batch&&) noexcept = default;
Batch& Batch::operator=(Batch&&) noexcept = default;
Batch::~Batch() = default;

std::size_t Batch::size() const { return impl_->scenes.size(); }
const Scene& Batch::scene(std::size_t i) const {
  if (i >= size())
    throw ConfigError(fmt::format("the batch has no scene {} (allowed: 0 to {}). Ask for one of them", i, size() - 1));
  return impl_->scenes[i];
}
std::span<const int32_t> Batch::particle_type(std::size_t i) const {
  scene(i);  // throws
  return impl_->run->particle_type(static_cast<int>(i));
}

void Batch::advance_frame() {
  advance_frame([] { return false; });
}
bool Batch::advance_frame(const std::function<bool()>& stop) {
  impl_->forget_copies();
  if (!impl_->run->advance_frame(stop)) return false;
  ++impl_->frames_done;
  return true;
}
int64_t Batch::frames_done() const { return impl_->frames_done; }

std::optional<std::string> Batch::divergence(std::size_t i) const {
  const Scene& of = scene(i);
  std::optional<std::string> reason = impl_->run->divergence(static_cast<int>(i));
  if (!reason) return reason;
  return name_of(i, of) + ": " + *reason;
}

std::shared_ptr<const ParticleFrame> Batch::frame(std::size_t i, FieldSet wanted) const {
  scene(i);  // throws
  Impl::Frames& frames = impl_->frames[wanted.names()];
  if (frames.empty())
    for (ParticleFrame& frame : impl_->run->frames(wanted))
      frames.push_back(std::make_shared<const ParticleFrame>(std::move(frame)));
  return frames.at(i);
}

std::shared_ptr<const float> Batch::on_device(std::size_t i, ParticleQuantity what) const {
  scene(i);  // throws
  std::vector<std::shared_ptr<const float>>& rows = impl_->on_device[what];
  if (rows.empty()) rows = impl_->run->rows(what);
  return rows.at(i);
}

}  // namespace graupel
