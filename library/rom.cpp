#include "library/rom.h"

#include "core/scene/checks/range_check.h"
#include "experiments/models/reduced_model.h"
#include "io/scene/scene_reader.h"
#include "mpm/scene/particle_materials.h"

namespace graupel {

struct ReducedModel::Impl {
  experiments::LoadedModel loaded;
  std::vector<ReducedParameter> parameters;

  explicit Impl(const std::string& file) : loaded(file) {
    for (const rom::ModelParameter& p : loaded.model.parameters)
      parameters.push_back({p.name, p.unit, p.keys, p.low, p.high});
  }
};

ReducedModel::ReducedModel(const std::string& weights_file) : impl_(std::make_shared<const Impl>(weights_file)) {}

Scene ReducedModel::scene() const {
  return io::parse_stored_scene(impl_->loaded.model.scene_json, impl_->loaded.file, impl_->loaded.file);
}
const std::vector<ReducedParameter>& ReducedModel::parameters() const { return impl_->parameters; }
std::vector<std::string> ReducedModel::remarks(const Scene& scene) const {
  return experiments::unlike_training(impl_->loaded, scene);
}

struct ReducedSimulation::Impl {
  ReducedModel model;  ///< the run refers to it
  Scene scene;
  uint64_t seed;
  experiments::ReducedRun run;
  std::shared_ptr<const ParticleFrame> frame;  ///< a copy of the present state; none until it is asked for

  Impl(const ReducedModel& used, const experiments::LoadedModel& loaded, const Scene& of_run,
       const ReducedSettings& settings)
      : model(used),
        scene(in_range(of_run)),
        seed(settings.seed.value_or(of_run.seed)),
        run(loaded, scene, seed, options_of(settings), how(settings)) {}

  static const Scene& in_range(const Scene& scene) {
    check_ranges(scene);
    return scene;
  }
  static rom::ReducedOptions options_of(const ReducedSettings& settings) {
    rom::ReducedOptions options;
    options.step_factor = settings.step_factor;
    return options;
  }
  static experiments::ReducedRunOptions how(const ReducedSettings& settings) {
    if (settings.device == Device::cuda) parse_device("cuda");  // says what is missing
    return {.arithmetic = settings.f64 ? experiments::Arithmetic::f64 : experiments::Arithmetic::f32,
            .outside = experiments::OutsideRange::be_quiet,
            .device = settings.device};
  }
  const std::shared_ptr<const ParticleFrame>& state() {
    if (!frame) frame = std::make_shared<const ParticleFrame>(run.frame());
    return frame;
  }
};

ReducedSimulation::ReducedSimulation(const ReducedModel& model, const Scene& scene, const ReducedSettings& settings)
    : impl_(std::make_unique<Impl>(model, model.impl_->loaded, scene, settings)) {}
ReducedSimulation::ReducedSimulation(ReducedSimulation&&) noexcept = default;
ReducedSimulation& ReducedSimulation::operator=(ReducedSimulation&&) noexcept = default;
ReducedSimulation::~ReducedSimulation() = default;

void ReducedSimulation::advance_frame() {
  impl_->frame.reset();
  impl_->run.advance_frame();
}
double ReducedSimulation::time() const { return impl_->run.time(); }
std::size_t ReducedSimulation::particle_count() const { return impl_->run.particle_type().size(); }
std::span<const int32_t> ReducedSimulation::particle_type() const { return impl_->run.particle_type(); }
std::span<const Vec3f> ReducedSimulation::position() const { return impl_->state()->position; }
std::span<const Vec3f> ReducedSimulation::velocity() const { return impl_->state()->velocity; }
ParticleFrame ReducedSimulation::frame() const { return impl_->run.frame(); }
std::shared_ptr<const ParticleFrame> ReducedSimulation::shared_frame() const { return impl_->state(); }

Trajectory ReducedSimulation::header() const {
  Trajectory header;
  header.particle_type = impl_->run.particle_type();
  header.materials = mpm::kept_materials(impl_->scene, impl_->seed);
  header.frame_time = impl_->scene.frame_time;
  header.scene_json = io::scene_to_json(impl_->scene);
  header.seed = impl_->seed;
  header.made_by = impl_->model.impl_->loaded.file;
  return header;
}

double ReducedSimulation::trust_number() const { return impl_->run.trust_number(); }
std::string ReducedSimulation::verdict() const { return rom::verdict_text(impl_->run.trust_record().verdict()); }

}  // namespace graupel
