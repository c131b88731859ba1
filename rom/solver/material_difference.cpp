#include "rom/solver/material_difference.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "core/system/error.h"
#include "mpm/materials/material.h"

namespace graupel::rom {

namespace {

using Matrix = Mat<double, 3>;

/// |tau - tau'| over the larger one along a path of small steps, the root of the sum of squares over the steps.
double answer_difference(const MaterialConfig& a, const MaterialConfig& b, const Matrix& velocity_gradient) {
  constexpr int steps = 10;
  constexpr double dt = 1e-3;  // [s]; the probe's gradient is large enough
  const mpm::MaterialParameters<double> material[2] = {mpm::material_parameters<double>(a),
                                                       mpm::material_parameters<double>(b)};
  Matrix F[2] = {Matrix::identity(), Matrix::identity()}, tau[2];
  double internal[2] = {mpm::initial_internal_variable(a.model), mpm::initial_internal_variable(b.model)};
  double difference2 = 0, size2[2] = {0, 0};
  for (int i = 0; i < steps; ++i) {
    for (int k = 0; k < 2; ++k) {
      tau[k] = mpm::update_material(material[k], dt, velocity_gradient, F[k], internal[k]);
      size2[k] += double_dot(tau[k], tau[k]);
    }
    const Matrix difference = tau[0] - tau[1];
    difference2 += double_dot(difference, difference);
  }
  const double largest2 = std::max(size2[0], size2[1]);
  return largest2 > 0 ? std::min(1.0, std::sqrt(difference2 / largest2)) : 0;
}

double difference_of(const MaterialConfig& a, const MaterialConfig& b) {
  const Matrix probes[] = {{{{5, 0, 0}, {0, -1, 0}, {0, 0, -1}}},    // stretch
                           {{{-2, 4, 0}, {0, -2, 0}, {0, 0, -2}}},   // shear under pressure
                           {{{-3, 0, 0}, {0, -3, 0}, {0, 0, -3}}}};  // pressure; strains of 2 to 5 %
  double largest = a.model == b.model ? std::abs(a.density - b.density) / std::max(a.density, b.density) : 1;
  for (const Matrix& probe : probes) largest = std::max(largest, answer_difference(a, b, probe));
  return largest;
}

}  // namespace

double material_difference(const Scene& scene, const mpm::SampledParticles& particles, const Scene& other,
                           const mpm::SampledParticles& other_particles) {
  GRAUPEL_ASSERT(particles.position.size() == other_particles.position.size());
  std::map<std::pair<int32_t, int32_t>, double> known;
  double sum = 0, volume = 0;
  for (std::size_t p = 0; p < particles.position.size(); ++p) {
    const std::pair<int32_t, int32_t> pair = {particles.material[p], other_particles.material[p]};
    auto at = known.find(pair);
    if (at == known.end()) {
      const std::string &a = particles.material_names[static_cast<std::size_t>(pair.first)],
                        &b = other_particles.material_names[static_cast<std::size_t>(pair.second)];
      at = known.emplace(pair, difference_of(scene.materials.at(a), other.materials.at(b))).first;
    }
    sum += at->second * particles.volume[p];
    volume += particles.volume[p];
  }
  return volume > 0 ? sum / volume : 0;
}

}  // namespace graupel::rom
