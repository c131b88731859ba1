#include "library/mpm.h"

#include <map>
#include <utility>

#include "core/scene/materials_by_type.h"
#include "io/scene/scene_reader.h"
#include "mpm/user_material_run.h"

namespace graupel {

struct Simulation::Impl {
  Scene scene;
  uint64_t seed;
  std::unique_ptr<mpm::Simulation> run;
  ParticleMaterials materials;
  std::vector<double> volume;
  /// Copies of the present state; empty until they are asked for.
  std::shared_ptr<const ParticleFrame> frame;
  std::map<ParticleField, std::shared_ptr<const std::vector<float>>> fields;
  std::map<ParticleQuantity, std::shared_ptr<const float>> on_device;

  void forget_copies() {
    frame.reset();
    fields.clear();
    on_device.clear();
  }
  const std::shared_ptr<const ParticleFrame>& state() {
    if (!frame) frame = std::make_shared<const ParticleFrame>(run->frame());
    return frame;
  }
};

namespace {

Scene with_names(Scene scene) {
  for (auto& [name, material] : scene.materials) material.name = name;
  return scene;
}

}  // namespace

Simulation::Simulation(const Scene& scene, const SimulationSettings& settings)
    : impl_(std::make_unique<Impl>(
          Impl{with_names(scene), settings.seed.value_or(scene.seed), nullptr, {}, {}, {}, {}, {}})) {
  if (settings.device == Device::cuda) parse_device("cuda");  // says what is missing
  mpm::SimulationOptions options;
  options.device = settings.device;
  options.precision = settings.f64 ? mpm::Precision::f64 : mpm::Precision::f32;
  options.seed = impl_->seed;
  options.contact_forces = settings.contact_forces;
  const mpm::PreparedScene prepared(impl_->scene, options);
  impl_->materials = kept_materials(impl_->scene.materials, prepared.particles.material);
  impl_->volume = prepared.particles.volume;
  impl_->run = mpm::create_with_user_materials(prepared, settings.materials);
}
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

void Simulation::advance_frame() {
  impl_->forget_copies();
  impl_->run->advance_frame();
}
bool Simulation::advance_substep() {
  impl_->forget_copies();
  return impl_->run->advance_substep();
}
double Simulation::time() const { return impl_->run->time(); }
int64_t Simulation::substeps() const { return impl_->run->statistics().substeps; }
const Scene& Simulation::scene() const { return impl_->scene; }

std::size_t Simulation::particle_count() const { return impl_->run->particle_count(); }
std::span<const int32_t> Simulation::particle_type() const { return impl_->run->particle_type(); }
std::span<const Vec3f> Simulation::position() const { return impl_->state()->position; }
std::span<const Vec3f> Simulation::velocity() const { return impl_->state()->velocity; }
std::span<const uint8_t> Simulation::active() const { return impl_->state()->active; }
std::span<const double> Simulation::volume() const { return impl_->volume; }
std::span<const float> Simulation::field(ParticleField field) const { return *shared_field(field); }
std::shared_ptr<const ParticleFrame> Simulation::shared_frame() const { return impl_->state(); }
std::shared_ptr<const std::vector<float>> Simulation::shared_field(ParticleField field) const {
  auto [place, is_new] = impl_->fields.try_emplace(field);
  if (is_new) place->second = std::make_shared<const std::vector<float>>(std::move(impl_->run->fields({field})[field]));
  return place->second;
}

std::shared_ptr<const float> Simulation::on_device(ParticleQuantity what) const {
  std::shared_ptr<const float>& rows = impl_->on_device[what];
  if (!rows) rows = impl_->run->rows(what);
  return rows;
}

Balance Simulation::balance() const {
  const mpm::Diagnostics d = impl_->run->diagnostics();
  return {d.mass, d.momentum, d.kinetic_energy, d.elastic_energy, d.potential_energy};
}

std::vector<ContactForce> Simulation::contact_forces() const { return impl_->run->contact_forces(); }

ParticleFrame Simulation::frame(FieldSet wanted) const { return mpm::frame_with_fields(*impl_->run, wanted); }

Trajectory Simulation::header() const {
  Trajectory header;
  header.particle_type = impl_->run->particle_type();
  header.materials = impl_->materials;
  header.frame_time = impl_->scene.frame_time;
  header.scene_json = io::scene_to_json(impl_->scene);
  header.seed = impl_->seed;
  header.made_by = "mpm";
  return header;
}

std::vector<std::byte> Simulation::save_state() const { return impl_->run->save_state(); }
void Simulation::load_state(const std::vector<std::byte>& state) {
  impl_->forget_copies();
  impl_->run->load_state(state);
}

}  // namespace graupel
