#include "mpm/particles/particle_lifecycle.h"

#include <algorithm>

namespace graupel::mpm {

template <typename T>
ParticleLifecycle<T>::ParticleLifecycle(Device device, const Scene& scene, const SampledParticles& sampled)
    : plane_(scene.domain.is_plane()),
      scripts_(sampled.scripts),
      reach_(sampled.scripts.size(), 0.0),
      emitters_(scene.emitters),
      presence_(device, 0),
      birth_time_(device, 0),
      sinks_(device, 0),
      script_(device, 0),
      steps_(device, 0) {
  const std::size_t n = sampled.position.size();
  if (scene.has_inactive_particles()) {
    std::vector<double> birth = sampled.birth_time;
    birth.resize(n, 0.0);
    std::vector<Presence> presence(n);
    for (std::size_t i = 0; i < n; ++i) presence[i] = birth[i] <= 0 ? Presence::active : Presence::unborn;
    presence_.upload(presence);
    birth_time_.upload(birth);
    sinks_.upload(std::vector<Region>(scene.sinks.begin(), scene.sinks.end()));
  }
  if (!has_scripts()) return;
  script_.upload(sampled.script);
  for (std::size_t i = 0; i < n; ++i) {
    if (sampled.script[i] < 0) continue;
    const auto s = static_cast<std::size_t>(sampled.script[i]);
    const Vec3d center = scripts_[s].motion.center.value_or(scripts_[s].body_center);
    reach_[s] = std::max(reach_[s], norm(sampled.position[i] - center));
  }
  begin_step(0, 1);
}

template <typename T>
void ParticleLifecycle<T>::begin_step(double time, double dt) {
  step_end_ = time + dt;
  if (has_scripts()) steps_.upload(script_steps(time, dt));
}

template <typename T>
std::vector<ScriptStep<T>> ParticleLifecycle<T>::script_steps(double time, double dt) const {
  std::vector<ScriptStep<T>> steps;
  for (const Script& script : scripts_) {
    const RigidStep<T> motion = rigid_step<T>(script.motion, script.body_center, time, dt);
    steps.push_back({plane_ ? in_plane(motion) : motion, time < script.release_time});
  }
  return steps;
}

template <typename T>
LifecycleView<T> ParticleLifecycle<T>::view() const {
  auto& self = const_cast<ParticleLifecycle&>(*this);  // kernels change who is present; const members only read it
  return {has_presence() ? self.presence_.data() : nullptr,
          birth_time_.data(),
          step_end_,
          sinks_.data(),
          static_cast<int32_t>(sinks_.size()),
          has_scripts() ? script_.data() : nullptr,
          steps_.data()};
}

template <typename T>
std::vector<uint8_t> ParticleLifecycle<T>::active() const {
  std::vector<uint8_t> active;
  for (const Presence p : presence_.download()) active.push_back(p == Presence::active ? 1 : 0);
  return active;
}

template <typename T>
void ParticleLifecycle<T>::count(int64_t& born, int64_t& removed) const {
  born = removed = 0;
  const std::vector<Presence> presence = presence_.download();
  const std::vector<double> birth_time = birth_time_.download();
  for (std::size_t i = 0; i < presence.size(); ++i) {
    if (birth_time[i] > 0 && presence[i] != Presence::unborn) ++born;
    if (presence[i] == Presence::gone) ++removed;
  }
}

template <typename T>
double ParticleLifecycle<T>::largest_speed(double from, double to) const {
  double fastest = 0;
  for (std::size_t s = 0; s < scripts_.size(); ++s) {
    if (from >= scripts_[s].release_time) continue;
    double speed, angular_speed;
    scripts_[s].motion.fastest(from, to, speed, angular_speed);
    fastest = std::max(fastest, speed + angular_speed * reach_[s]);
  }
  for (const Emitter& emitter : emitters_) {
    const bool stream = emitter.emission == Emission::stream;
    const double first = stream ? emitter.start_time : emitter.times.empty() ? 0 : emitter.times.front();
    const double last = stream ? emitter.end_time : emitter.times.empty() ? 0 : emitter.times.back();
    if (from <= last && to >= first) fastest = std::max(fastest, norm(emitter.velocity));
  }
  return fastest;
}

template class ParticleLifecycle<float>;
template class ParticleLifecycle<double>;

}  // namespace graupel::mpm
