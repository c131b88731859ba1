// Compares only the emitters' own times: all matter of an emitter is born in one state.
#include "mpm/solver/emitted_sound.h"

#include <algorithm>

#include "mpm/materials/list.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm {

namespace {

bool emits(const Emitter& emitter, double from, double to) {
  if (emitter.emission == Emission::stream) return from <= emitter.end_time && to >= emitter.start_time;
  return std::any_of(emitter.times.begin(), emitter.times.end(), [&](double t) { return from <= t && t <= to; });
}

}  // namespace

template <typename T>
EmittedSound::EmittedSound(const Scene& scene, const SampledParticles& sampled, const HostParticles<T>& initial,
                           const std::vector<MaterialConfig>& materials, const UserLaws& laws)
    : emitters_(scene.emitters), sound_speed_(scene.emitters.size(), 0.0) {
  std::vector<MaterialParameters<T>> parameters;
  parameters.reserve(materials.size());
  for (const MaterialConfig& config : materials) parameters.push_back(material_parameters<T>(config));
  for (std::size_t i = 0; i < initial.size() && !emitters_.empty(); ++i) {
    const auto source = static_cast<std::size_t>(sampled.source[i]);
    if (source < scene.sources.size()) continue;
    const auto material = static_cast<std::size_t>(initial.material[i]);
    const Mat<T, 3>& F = initial.deformation_gradient[i];
    const T internal = initial.internal[i];
    const bool own = !laws.empty() && laws[material];
    const double c = own ? laws[material]->sound_speed({F.template cast<double>(), static_cast<double>(internal)})
                         : static_cast<double>(sound_speed(parameters[material], F, internal));
    double& largest = sound_speed_[source - scene.sources.size()];
    largest = std::max(largest, c);
  }
}

double EmittedSound::largest(double from, double to) const {
  double largest = 0;
  for (std::size_t e = 0; e < emitters_.size(); ++e)
    if (emits(emitters_[e], from, to)) largest = std::max(largest, sound_speed_[e]);
  return largest;
}

template EmittedSound::EmittedSound(const Scene&, const SampledParticles&, const HostParticles<float>&,
                                    const std::vector<MaterialConfig>&, const UserLaws&);
template EmittedSound::EmittedSound(const Scene&, const SampledParticles&, const HostParticles<double>&,
                                    const std::vector<MaterialConfig>&, const UserLaws&);

}  // namespace graupel::mpm
