#include "library/particle_state.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

namespace graupel {

namespace {

std::string text_of(double value) { return fmt::format("{:.5g}", value); }
std::string text_of(const Vec3d& v) { return fmt::format("({:.5g}, {:.5g}, {:.5g})", v[0], v[1], v[2]); }
std::string text_of(const Mat3d& m) {
  std::string text = "[";
  for (int r = 0; r < 3; ++r)
    text += fmt::format("{}[{:.5g}, {:.5g}, {:.5g}]", r == 0 ? "" : ", ", m(r, 0), m(r, 1), m(r, 2));
  return text + "]";
}

bool is_finite(double value) { return std::isfinite(value); }
bool is_finite(const Vec3d& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }
bool is_finite(const Mat3d& m) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      if (!std::isfinite(m(r, c))) return false;
  return true;
}

template <typename Value>
[[noreturn]] void refuse(const char* list, std::size_t i, const Value& value, const std::string& allowed) {
  throw ConfigError(fmt::format("{}[{}] = {} cannot start a run (allowed: {}). Correct this particle, or leave it out",
                                list, i, text_of(value), allowed));
}

/// One entry a particle, all finite, each with `problem(value)` = "" or what is allowed.
template <typename Value, typename Problem>
void check_list(const char* list, const std::vector<Value>& values, std::size_t particles, const Problem& problem) {
  if (values.empty()) return;
  if (values.size() != particles)
    throw ConfigError(
        fmt::format("{} has another length than the positions ({}, allowed: {}). Give one entry a particle", list,
                    values.size(), particles));
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!is_finite(values[i])) refuse(list, i, values[i], "finite numbers");
    const std::string allowed = problem(values[i]);
    if (!allowed.empty()) refuse(list, i, values[i], allowed);
  }
}

bool leads_out_of_plane(const Mat3d& m, double last) {
  return m(0, 2) != 0 || m(1, 2) != 0 || m(2, 0) != 0 || m(2, 1) != 0 || m(2, 2) != last;
}

void check_materials(const Scene& scene, const std::vector<std::string>& material, std::size_t particles) {
  if (material.size() != 1 && material.size() != particles)
    throw ConfigError(
        fmt::format("material has another length than the positions ({}, allowed: 1 or {}). Name one for "
                    "all particles, or one for each",
                    material.size(), particles));
  std::vector<std::string> known;
  for (const auto& [name, config] : scene.materials) known.push_back(name);
  for (std::size_t i = 0; i < material.size(); ++i)
    if (!scene.materials.contains(material[i]))
      throw ConfigError(fmt::format("material[{}] = '{}' is not in the scene (allowed: {}). Define it under materials",
                                    i, material[i], fmt::join(known, ", ")));
}

void check(const Scene& scene, const ParticleState& state) {
  const std::size_t n = state.position.size();
  if (n == 0) throw ConfigError("there is no position (0 particles, allowed: at least 1). Give one a particle");
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  const double tolerance = 1e-6 * scene.domain.dx;
  const bool plane = scene.domain.is_plane();
  check_list("position", state.position, n, [&](const Vec3d& x) {
    for (int d = 0; d < scene.domain.axes(); ++d)
      if (x[d] < low[d] - tolerance || x[d] > high[d] + tolerance)
        return fmt::format("{} to {}, inside the walls", text_of(low), text_of(high));
    return std::string();
  });
  check_list("velocity", state.velocity, n, [&](const Vec3d& v) {
    return std::string(plane && v[2] != 0 ? "third component 0 in two dimensions" : "");
  });
  check_list("deformation_gradient", state.deformation_gradient, n, [&](const Mat3d& F) {
    if (plane && leads_out_of_plane(F, 1)) return std::string("third row and column 0, 0, 1 in two dimensions");
    return std::string(determinant(F) > 0 ? "" : "det F > 0");
  });
  check_list("affine_velocity", state.affine_velocity, n, [&](const Mat3d& C) {
    return std::string(plane && leads_out_of_plane(C, 0) ? "third row and column 0 in two dimensions" : "");
  });
  check_list("plastic", state.plastic, n, [](double) { return std::string(); });
  check_list("volume", state.volume, n, [](double V) { return std::string(V > 0 ? "" : "above 0 m^3"); });
  check_materials(scene, state.material, n);
}

/// Of particles of the mean of these volumes, as far as a scene may have them.
double particles_per_cell(const Domain& domain, const std::vector<double>& volume) {
  const double all = std::accumulate(volume.begin(), volume.end(), 0.0);
  return std::min(1000.0, domain.cell_volume() * static_cast<double>(volume.size()) / all);
}

}  // namespace

Scene with_particles(const Scene& scene, ParticleState state) {
  check(scene, state);
  Source source;
  source.shape = Shape::points;
  source.material = state.material.front();
  if (!state.volume.empty()) source.particles_per_cell = particles_per_cell(scene.domain, state.volume);
  source.points = std::make_shared<const std::vector<Vec3d>>(state.position);
  source.state = std::make_shared<const ParticleState>(std::move(state));
  Scene own = scene;
  own.sources = {std::move(source)};
  return own;
}

}  // namespace graupel
