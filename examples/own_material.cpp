// A law of one's own: stable neo-Hookean elasticity (Smith, de Goes and Kim 2018, eq. 13), beside the built-in one.
#include <graupel/io.h>
#include <graupel/mpm.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

using namespace graupel;

class StableNeoHookean : public UserMaterial {
 public:
  explicit StableNeoHookean(const MaterialConfig& m) : density_(m.density) {
    const double E = m.youngs_modulus, nu = m.poissons_ratio;
    const double lambda = E * nu / ((1 + nu) * (1 - 2 * nu)), mu = E / (2 * (1 + nu));
    mu_ = mu * 4 / 3;  // remapped, so that small strains see E and nu
    lambda_ = lambda + mu * 5 / 6;
    rest_ = 1 + 0.75 * mu_ / lambda_;
  }
  Mat3d stress(const MaterialStep&, MaterialState& state) const override {
    const double J = determinant(state.F), I = double_dot(state.F, state.F);
    return mu_ * (1 - 1 / (I + 1)) * (state.F * transpose(state.F)) + lambda_ * J * (J - rest_) * Mat3d::identity();
  }
  double sound_speed(const MaterialState& state) const override {
    const double J = determinant(state.F), stretch2 = double_dot(state.F, state.F);  // at least the largest one
    return std::sqrt((2 * mu_ * stretch2 + lambda_ * J * J) / density_);
  }

 private:
  double density_, mu_, lambda_, rest_;
};

double seconds_of(Simulation& run) {
  const auto begin = std::chrono::steady_clock::now();
  for (int64_t frame = 0; frame < run.scene().frames; ++frame) run.advance_frame();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

int main() try {
  const Scene scene = io::parse_scene(R"({
    "name": "bar", "domain": { "size": [0.6, 0.6, 0.6], "dx": 0.02 }, "frames": 20,
    "materials": { "rubber": { "preset": "neo_hookean" } },
    "sources": [ { "shape": "box", "size": [0.3, 0.1, 0.1], "position": [0.3, 0.3, 0.3], "material": "rubber",
                   "sampling": "jittered_lattice", "angular_velocity": [0, 0, 8] } ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 40 } })",
                                      "example", ".");
  Simulation built_in(scene, {.f64 = true});
  const auto law = std::make_shared<StableNeoHookean>(scene.materials.at("rubber"));
  Simulation own(scene, {.f64 = true, .materials = {{"rubber", law}}});
  const double ratio = seconds_of(own) / seconds_of(built_in);
  double difference = 0;
  for (std::size_t i = 0; i < own.particle_count(); ++i)
    difference = std::max<double>(difference, norm(own.position()[i] - built_in.position()[i]));
  std::printf("positions differ by up to %.1e m; own over built-in time: %.1f\n", difference, ratio);
  return difference < 1e-6 ? 0 : 1;
} catch (const Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return static_cast<int>(error.code());
}
