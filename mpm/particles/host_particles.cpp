#include "mpm/particles/host_particles.h"

#include "mpm/bspline.h"
#include "mpm/materials/material.h"

namespace graupel::mpm {

namespace {

/// Deformation, internal variable and the stress of both, by an update in which no time passes.
template <typename T>
void set_given_state(const GivenState& given, const MaterialConfig& material, std::size_t i, HostParticles<T>& host) {
  Mat<T, 3>& F = host.deformation_gradient[i];
  T& internal = host.internal[i];
  const Mat<T, 3> deformed = given.deformation_gradient.template cast<T>();
  if (keeps_deformation(material.model)) F = deformed;
  if (is_fluid(material.model)) internal = determinant(deformed);
  if (given.internal) internal = static_cast<T>(*given.internal);
  host.affine_velocity[i] += given.affine_velocity.template cast<T>();
  host.stress[i] = symmetric_components(
      update_material(material_parameters<T>(material), T(0), host.affine_velocity[i], F, internal));
}

}  // namespace

template <typename T>
HostParticles<T>::HostParticles(std::size_t n)
    : position(n),
      velocity(n),
      affine_velocity(n, Mat<T, 3>::zero()),
      deformation_gradient(n, Mat<T, 3>::identity()),
      stress(n, Vec<T, 6>::zero()),
      internal(n),
      volume(n),
      material(n),
      source_index(n) {}

template <typename T>
HostParticles<T> initial_particles(const SampledParticles& sampled, const std::vector<MaterialConfig>& materials) {
  HostParticles<T> host(sampled.position.size());
  for (std::size_t i = 0; i < host.size(); ++i) {
    host.position[i] = sampled.position[i].cast<T>();
    host.velocity[i] = sampled.velocity[i].cast<T>();
    const Vec<T, 3> w = sampled.spin[i].cast<T>();
    host.affine_velocity[i] = {{{T(0), -w[2], w[1]}, {w[2], T(0), -w[0]}, {-w[1], w[0], T(0)}}};
    host.volume[i] = static_cast<T>(sampled.volume[i]);
    host.material[i] = sampled.material[i];
    host.source_index[i] = static_cast<int32_t>(i);
    host.internal[i] = static_cast<T>(initial_internal_variable(materials[sampled.material[i]].model));
    if (!sampled.given.empty()) set_given_state(sampled.given[i], materials[sampled.material[i]], i, host);
  }
  return host;
}

namespace {

/// Copies K numbers a particle between records and tiles; `to_tiles` chooses the direction.
template <typename T>
void write_tiles(std::vector<T>& tiles, const T* records, int64_t n, int components) {
  tiles.assign(static_cast<std::size_t>(padded_to_tile(n) * components), T(0));
  for (int64_t p = 0; p < n; ++p)
    for (int k = 0; k < components; ++k)
      tiles[static_cast<std::size_t>((p / tile) * (tile * components) + k * tile + p % tile)] =
          records[p * components + k];
}

template <typename T>
void read_tiles(const std::vector<T>& tiles, T* records, int64_t n, int components) {
  for (int64_t p = 0; p < n; ++p)
    for (int k = 0; k < components; ++k)
      records[p * components + k] =
          tiles[static_cast<std::size_t>((p / tile) * (tile * components) + k * tile + p % tile)];
}

/// Start of every array of the records, in the order of Particles::for_each_buffer.
template <typename T>
std::vector<const void*> arrays_of(const HostParticles<T>& host) {
  return {host.position.data(),    host.velocity.data(), host.affine_velocity.data(), host.deformation_gradient.data(),
          host.stress.data(),      host.internal.data(), host.volume.data(),          host.material.data(),
          host.source_index.data()};
}

}  // namespace

template <typename T>
Particles<T> upload_particles(const HostParticles<T>& host, Device device) {
  const auto n = static_cast<int64_t>(host.size());
  Particles<T> particles(device, n);
  const std::vector<const void*> arrays = arrays_of(host);
  std::size_t next = 0;
  particles.for_each_buffer([&](auto& buffer) {
    using Value = std::remove_reference_t<decltype(*buffer.data())>;
    const int components = static_cast<int>(static_cast<int64_t>(buffer.size()) / padded_to_tile(n));
    std::vector<Value> tiles;
    write_tiles(tiles, static_cast<const Value*>(arrays[next++]), n, components);
    buffer.upload(tiles);
  });
  return particles;
}

template <typename T>
HostParticles<T> download_particles(Particles<T>& particles) {
  const int64_t n = particles.count();
  HostParticles<T> host(static_cast<std::size_t>(n));
  const std::vector<const void*> arrays = arrays_of(host);
  std::size_t next = 0;
  particles.for_each_buffer([&](auto& buffer) {
    using Value = std::remove_reference_t<decltype(*buffer.data())>;
    const int components = static_cast<int>(static_cast<int64_t>(buffer.size()) / padded_to_tile(n));
    read_tiles(buffer.download(), static_cast<Value*>(const_cast<void*>(arrays[next++])), n, components);
  });
  return host;
}

void set_active(ParticleFrame& frame, std::vector<uint8_t> active) {
  frame.active = std::move(active);
  for (std::size_t i = 0; i < frame.active.size(); ++i)
    if (frame.active[i] == 0) frame.velocity[i] = Vec3f::zero();
}

template <typename T>
ParticleFields fields_of(const HostParticles<T>& particles, FieldSet wanted, const std::vector<uint8_t>& active) {
  ParticleFields fields;
  const std::size_t n = particles.size();
  for (const ParticleField field : all_particle_fields)
    if (wanted.contains(field)) fields[field].assign(n * static_cast<std::size_t>(info_of(field).components), 0.0f);
  const auto put_matrix = [&](ParticleField field, std::size_t place, const Mat<T, 3>& m) {
    for (int k = 0; k < 9; ++k)
      fields[field][9 * place + static_cast<std::size_t>(k)] = static_cast<float>(m(k / 3, k % 3));
  };
  constexpr int kept_as[] = {0, 3, 4, 1, 5, 2};  // xx, xy, xz, yy, yz, zz among xx, yy, zz, xy, xz, yz
  for (std::size_t slot = 0; slot < n; ++slot) {
    const auto place = static_cast<std::size_t>(particles.source_index[slot]);
    const bool in_run = active.empty() || active[place] != 0;
    if (wanted.contains(ParticleField::stress) && in_run)
      for (std::size_t k = 0; k < 6; ++k)
        fields[ParticleField::stress][6 * place + k] = static_cast<float>(particles.stress[slot][kept_as[k]]);
    if (wanted.contains(ParticleField::affine) && in_run)
      put_matrix(ParticleField::affine, place, particles.affine_velocity[slot]);
    if (wanted.contains(ParticleField::deformation_gradient))
      put_matrix(ParticleField::deformation_gradient, place, particles.deformation_gradient[slot]);
    if (wanted.contains(ParticleField::plastic))
      fields[ParticleField::plastic][place] = static_cast<float>(particles.internal[slot]);
  }
  return fields;
}

template <typename T>
Diagnostics diagnose(const HostParticles<T>& particles, const std::vector<MaterialConfig>& materials,
                     const Scene& scene, const std::vector<uint8_t>& active, double time) {
  const Vec3d gravity = scene.gravity_at(time);
  const double dx = scene.domain.dx, second_moment = dx * dx / inverse_moment(scene.transfer.spline);
  std::vector<MaterialParameters<double>> parameters;
  parameters.reserve(materials.size());
  for (const MaterialConfig& m : materials) parameters.push_back(material_parameters<double>(m));
  Diagnostics sum;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    if (!active.empty() && active[static_cast<std::size_t>(particles.source_index[i])] == 0) continue;
    const MaterialParameters<double>& m = parameters[particles.material[i]];
    const double volume = static_cast<double>(particles.volume[i]), mass = m.density * volume;
    const Vec3d x = particles.position[i].template cast<double>(), v = particles.velocity[i].template cast<double>();
    const Mat3d C = particles.affine_velocity[i].template cast<double>();
    const Vec3d spin = {C(2, 1) - C(1, 2), C(0, 2) - C(2, 0), C(1, 0) - C(0, 1)};
    sum.mass += mass;
    sum.momentum += mass * v;
    sum.angular_momentum += mass * (cross(x, v) + second_moment * spin);
    sum.kinetic_energy += 0.5 * mass * norm2(v);
    sum.potential_energy -= mass * dot(gravity, x);
    sum.elastic_energy += volume * energy_density(m, particles.deformation_gradient[i].template cast<double>(),
                                                  static_cast<double>(particles.internal[i]));
  }
  return sum;
}

#define GRAUPEL_INSTANTIATE(T)                                                                                 \
  template struct HostParticles<T>;                                                                            \
  template HostParticles<T> initial_particles<T>(const SampledParticles&, const std::vector<MaterialConfig>&); \
  template Particles<T> upload_particles<T>(const HostParticles<T>&, Device);                                  \
  template HostParticles<T> download_particles<T>(Particles<T>&);                                              \
  template ParticleFields fields_of<T>(const HostParticles<T>&, FieldSet, const std::vector<uint8_t>&);        \
  template Diagnostics diagnose<T>(const HostParticles<T>&, const std::vector<MaterialConfig>&, const Scene&,  \
                                   const std::vector<uint8_t>&, double);
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)
#undef GRAUPEL_INSTANTIATE

}  // namespace graupel::mpm
