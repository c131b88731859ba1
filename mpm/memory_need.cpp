#include "mpm/memory_need.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "core/parallel/memory.h"
#include "core/system/error.h"
#include "mpm/grid/grid.h"
#include "mpm/scene/plane_section.h"
#include "mpm/scene/source_body.h"
#include "sparsegrid/analytic_shape.h"

namespace graupel::mpm {

namespace {

constexpr double order_bytes = 8;   ///< key and place of a particle in a BlockTable
constexpr double tuned_bytes = 17;  ///< keys, places and marks of a particle in a BatchSolver, and of a sort
constexpr double cpu_block_bytes = 13, tuned_block_bytes = 13;  ///< of a block of the domain in the directories

double record_bytes(Precision precision) {
  return 35 * (precision == Precision::f64 ? sizeof(double) : sizeof(float)) + 2 * sizeof(int32_t);
}

double particles_in(const Body& body, double per_cell, double dx) {
  if (body.shape == Shape::points) return body.points ? static_cast<double>(body.points->size()) : 0;
  return body_volume(body) * per_cell / (dx * dx * dx);
}

/// A body of a scene in the plane is as its section there, however thin or thick; of meshes and level sets, whose
/// section is not to be had in a moment, as its volume.
double particles_in(const Source& source, const Domain& domain) {
  const bool has_section = sparsegrid::is_analytic(source.shape) && source.shape != Shape::plane;
  if (!domain.is_plane() || !has_section) return particles_in(source, source.particles_per_cell, domain.dx);
  const SourceBody body(source, 0, domain.dx);
  const PlaneSection section(source, body, domain.plane());
  return section.is_met() ? section.area() * source.particles_per_cell / (domain.dx * domain.dx) : 0;
}

/// Emitters beyond their limit are refused with their own words.
double particles_of(const Emitter& emitter, double dx) {
  const double count =
      emitter.emission == Emission::burst
          ? particles_in(emitter, emitter.particles_per_cell, dx) * static_cast<double>(emitter.times.size())
          : emitter.rate.value_or(0) * std::max(0.0, emitter.end_time - emitter.start_time);
  return std::min(count, static_cast<double>(emitter.particle_limit));
}

void check_fits(const MemoryNeed& need, double bytes, uint64_t available, const char* where) {
  if (bytes <= static_cast<double>(available)) return;
  throw ConfigError(fmt::format(
      "the scene does not fit into the memory {} (at least {:.4g} GB needed for {:.0f} particles and {:.4g} grid "
      "blocks, {:.4g} GB available). Use fewer particles_per_cell, a larger dx, smaller sources or domain, or another "
      "device",
      where, 1e-9 * bytes, need.particles, need.blocks, 1e-9 * static_cast<double>(available)));
}

}  // namespace

MemoryNeed least_memory(const Domain& domain, const SimulationOptions& options, double particles) {
  MemoryNeed need;
  need.particles = particles;
  need.blocks = 1;
  for (int d = 0; d < 3; ++d) need.blocks *= grid_of<double>(domain).blocks[d];
  const double record = record_bytes(options.precision);
  if (options.device == Device::cpu) {
    // Two copies of the particles, and a third while the sampled ones are turned into them or a frame is read.
    need.host_bytes = particles * (3 * record + order_bytes) + need.blocks * cpu_block_bytes;
    return need;
  }
  need.host_bytes = particles * set_up_bytes;
  need.device_bytes = particles * (2 * record + tuned_bytes) + need.blocks * tuned_block_bytes;
  return need;
}

MemoryNeed least_memory(const Scene& scene, const SimulationOptions& options) {
  double particles = 0;
  const double dx = scene.domain.dx;
  for (const Source& source : scene.sources) particles += particles_in(source, scene.domain);
  for (const Emitter& emitter : scene.emitters) particles += particles_of(emitter, dx);
  return least_memory(scene.domain, options, particles);
}

MemoryNeed least_memory(const std::vector<PreparedScene>& scenes) {
  MemoryNeed all;
  for (const PreparedScene& s : scenes) {
    const MemoryNeed one = least_memory(s.scene.domain, s.options, static_cast<double>(s.particles.position.size()));
    all.particles += one.particles;
    all.blocks += one.blocks;
    all.host_bytes += one.host_bytes;
    all.device_bytes += one.device_bytes;
  }
  return all;
}

void check_block_count(double blocks) {
  constexpr double most = 1e9;
  if (blocks > most)
    throw ConfigError(
        fmt::format("the domain has too many grid blocks of 4^3 nodes ({:.0f}, at most {:.0f}). Use a larger dx or a "
                    "smaller domain",
                    blocks, most));
}

void check_memory(const MemoryNeed& need, uint64_t available_on_host, uint64_t available_on_device) {
  constexpr double most_particles = std::numeric_limits<int32_t>::max() - 16;
  check_block_count(need.blocks);
  check_fits(need, need.host_bytes, available_on_host, need.device_bytes > 0 ? "of the machine" : "of the CPU");
  check_fits(need, need.device_bytes, available_on_device, "of the GPU");
  if (need.particles > most_particles)
    throw ConfigError(
        fmt::format("the scene has too many particles ({:.0f}, allowed: {:.0f}). Use fewer "
                    "particles_per_cell, a larger dx or smaller sources",
                    need.particles, most_particles));
}

void check_memory(const MemoryNeed& need, Device device) {
  check_memory(need, available_bytes(Device::cpu),
               device == Device::cpu ? std::numeric_limits<uint64_t>::max() : available_bytes(device));
}

}  // namespace graupel::mpm
