// Laws that hold to rounding, whatever the resolution: free fall, conservation in the transfers, affine fields, the
// kernel's moments, objective stress.
#include <algorithm>
#include <cmath>

#include "core/math/random.h"
#include "mpm/bspline.h"
#include "mpm/materials/material.h"
#include "validation/case_list.h"
#include "validation/setup.h"

namespace graupel::validation {

namespace {

/// What a law is checked for: space and plane, quadratic and cubic splines.
struct LawForm {
  int64_t dimensions = 3;
  Spline spline = Spline::quadratic;
};
constexpr LawForm other_forms[] = {{2, Spline::quadratic}, {3, Spline::cubic}, {2, Spline::cubic}};

template <typename T>
std::string name_of(const LawForm& form) {
  std::string name = sizeof(T) == 4 ? ", f32" : ", f64";
  if (form.dimensions == 2) name += ", plane";
  if (form.spline == Spline::cubic) name += ", cubic";
  return name;
}

/// A vector or matrix of the state, without its part across the plane.
template <typename State>
State in_form(const LawForm& form, const State& state) {
  return form.dimensions == 2 ? mpm::in_space(mpm::in_axes<2>(state)) : state;
}

double random_number(uint64_t i, double scale) { return Random(1, RandomPurpose::test).uniform(i, 0, -scale, scale); }

template <typename T>
Mat<T, 3> random_matrix(uint64_t i, double scale) {
  Mat<T, 3> m;
  for (uint64_t k = 0; k < 9; ++k) m.a[k / 3][k % 3] = static_cast<T>(random_number(9 * i + k, scale));
  return m;
}

template <typename T>
double largest_entry(const Mat<T, 3>& m) {
  double largest = 0;
  for (int k = 0; k < 9; ++k) largest = std::max(largest, std::abs(static_cast<double>(m.a[k / 3][k % 3])));
  return largest;
}

template <typename T>
std::unique_ptr<mpm::Solver<T>> solver_of(const Scene& scene) {
  return std::make_unique<mpm::Solver<T>>(scene, mpm::SimulationOptions{}, mpm::sample_sources(scene, 1),
                                          sparsegrid::ObstacleSet(scene));
}

/// A cube (or square) of side 0.2 of random particles in the middle of a domain of side 1.
Scene cube_scene(const LawForm& form) {
  Scene scene;
  scene.domain.dimensions = form.dimensions;
  scene.transfer.spline = form.spline;
  scene.domain.dx = 1.0 / 32;
  scene.gravity = {0, 0, 0};
  scene.materials["jelly"] = preset("jelly");
  Source source;
  source.material = "jelly";
  source.size = {0.2, 0.2, 0.2};
  source.position = {0.5, 0.6, 0.5};
  scene.sources.push_back(source);
  return scene;
}

template <typename T>
void check_free_fall(const LawForm& form, double tolerance, Outcome& outcome) {
  Scene scene = cube_scene(form);
  scene.gravity = {0, -9.81, 0};
  scene.sources[0].velocity = in_form(form, Vec3d{0.3, 1, -0.2});
  const auto solver = solver_of<T>(scene);
  const mpm::HostParticles<T> first = solver->particles();
  constexpr int steps = 150;
  const double dt = 1e-3;
  for (int n = 0; n < steps; ++n) solver->substep(dt);
  const mpm::HostParticles<T> last = solver->particles();
  double way = 0, speed = 0, strain = 0, affine = 0;
  for (std::size_t i = 0; i < last.size(); ++i) {
    const Vec3d v0 = scene.sources[0].velocity;
    const Vec3d x = first.position[i].template cast<double>() + steps * dt * v0 +
                    (dt * dt * steps * (steps + 1) / 2) * scene.gravity;
    way = std::max(way, norm(last.position[i].template cast<double>() - x));
    speed = std::max(speed, norm(last.velocity[i].template cast<double>() - (v0 + steps * dt * scene.gravity)));
    strain = std::max(strain, largest_entry(last.deformation_gradient[i] - Mat<T, 3>::identity()));
    affine = std::max(affine, dt * largest_entry(last.affine_velocity[i]));
  }
  const std::string name = name_of<T>(form);
  outcome.add(absolute("largest error of position [m]" + name, way, 0, tolerance));
  outcome.add(absolute("largest error of velocity [m/s]" + name, speed, 0, tolerance));
  outcome.add(absolute("largest entry of F - I" + name, strain, 0, tolerance));
  outcome.add(absolute("largest entry of C dt" + name, affine, 0, tolerance));
}

/// Random velocities, affine velocities and stresses.
template <typename T>
void disturb(const LawForm& form, mpm::Solver<T>& solver) {
  const mpm::ParticleView<T> p = solver.view().particles;
  for (int64_t slot = 0; slot < p.count; ++slot) {
    const auto seed = static_cast<uint64_t>(slot);
    const Mat<T, 3> A = random_matrix<T>(3 * seed, 2), stress = random_matrix<T>(3 * seed + 1, 1e4);
    p.velocity.set_vec(slot, in_form(form, A * Vec<T, 3>{T(1), T(0), T(0)}));
    mpm::store_matrix(p.affine_velocity, slot, in_form(form, random_matrix<T>(3 * seed + 2, 20)));
    mpm::store_symmetric(p.stress, slot, stress + transpose(stress));
  }
}

template <typename T>
void check_conservation(const LawForm& form, double tolerance, Outcome& outcome) {
  const auto solver = solver_of<T>(cube_scene(form));
  disturb(form, *solver);
  const mpm::Diagnostics before = solver->diagnostics();
  const double speed = std::sqrt(2 * before.kinetic_energy / before.mass);
  solver->substep(1e-4);
  const mpm::Diagnostics after = solver->diagnostics();
  outcome.add(absolute("change of momentum over m v_rms" + name_of<T>(form),
                       norm(after.momentum - before.momentum) / (before.mass * speed), 0, tolerance));
  outcome.add(absolute("change of angular momentum over m v_rms 1 m" + name_of<T>(form),
                       norm(after.angular_momentum - before.angular_momentum) / (before.mass * speed), 0, tolerance));
}

template <typename T>
void check_affine(const LawForm& form, double tolerance, Outcome& outcome) {
  const auto solver = solver_of<T>(cube_scene(form));
  const Mat<T, 3> A = in_form(form, random_matrix<T>(1, 1));
  const Vec<T, 3> b = in_form(form, Vec<T, 3>{T(0.3), T(-0.2), T(0.5)});
  const T dt = T(1e-3);
  const mpm::ParticleView<T> p = solver->view().particles;
  for (int64_t slot = 0; slot < p.count; ++slot) {
    p.velocity.set_vec(slot, A * p.position.vec(slot) + b);
    mpm::store_matrix(p.affine_velocity, slot, A);
  }
  const mpm::HostParticles<T> before = solver->particles();
  solver->substep(static_cast<double>(dt));
  const mpm::HostParticles<T> after = solver->particles();
  double velocity = 0, affine = 0, strain = 0;
  for (std::size_t i = 0; i < after.size(); ++i) {
    velocity = std::max(velocity, static_cast<double>(norm(after.velocity[i] - before.velocity[i])));
    affine = std::max(affine, largest_entry(after.affine_velocity[i] - A));
    strain = std::max(strain, largest_entry(after.deformation_gradient[i] - (Mat<T, 3>::identity() + dt * A)));
  }
  const std::string name = name_of<T>(form);
  outcome.add(absolute("largest change of v = A x + b [m/s]" + name, velocity, 0, tolerance));
  outcome.add(absolute("largest entry of C - A [1/s]" + name, affine, 0, 10 * tolerance));
  outcome.add(absolute("largest entry of F - (I + dt A)" + name, strain, 0, tolerance));
}

template <Spline S>
void check_moments(const std::string& moment_text, double moment, Outcome& outcome) {
  double sum = 0, first = 0, second = 0;
  for (int i = 0; i < 1000; ++i) {
    const double fx = mpm::BSpline<S>::base_shift + i / 1000.0;
    const mpm::AxisWeights<double, S> weights = mpm::bspline_weights<S>(fx);
    double moments[3] = {};
    for (int k = 0; k < mpm::stencil_width<S>; ++k)
      for (int power = 0; power < 3; ++power) moments[power] += weights.w[k] * std::pow(k - fx, power);
    sum = std::max(sum, std::abs(moments[0] - 1));
    first = std::max(first, std::abs(moments[1]));
    second = std::max(second, std::abs(moments[2] - moment));
  }
  const std::string name = S == Spline::cubic ? ", cubic" : "";
  outcome.add(absolute("sum of the weights - 1" + name, sum, 0, 1e-14));
  outcome.add(absolute("first moment [dx]" + name, first, 0, 1e-14));
  outcome.add(absolute("second moment - " + moment_text + " [dx^2]" + name, second, 0, 1e-14));
}

/// Derivative of the energy by central differences, times F^T, against the stress.
double energy_error(const mpm::MaterialParameters<double>& m, const Mat3d& F, double internal, const Mat3d& tau) {
  constexpr double h = 1e-6;
  Mat3d from_energy = Mat3d::zero();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      Mat3d high = F, low = F;
      high(r, c) += h;
      low(r, c) -= h;
      const double P = (mpm::energy_density(m, high, internal) - mpm::energy_density(m, low, internal)) / (2 * h);
      for (int k = 0; k < 3; ++k) from_energy(r, k) += P * F(k, c);
    }
  return largest_entry(from_energy - tau) / largest_entry(tau);
}

/// Whether a second return mapping has more to do by design: viscous flow goes on with time, and softening by the
/// explicit order shows in the next step.
bool flows_on(const mpm::MaterialParameters<double>& m) {
  return m.model == MaterialModel::toothpaste || m.model == MaterialModel::foam ||
         (m.hardening_slope < 0 && m.hardening_update == HardeningUpdate::before);
}

}  // namespace

Outcome free_fall(const RunOptions&) {
  Outcome outcome;
  check_free_fall<float>({}, 1e-5, outcome);
  check_free_fall<double>({}, 1e-12, outcome);
  for (const LawForm& form : other_forms) check_free_fall<double>(form, 1e-12, outcome);
  return outcome;
}

Outcome conservation(const RunOptions&) {
  Outcome outcome;
  check_conservation<float>({}, 1e-6, outcome);
  check_conservation<double>({}, 1e-14, outcome);
  for (const LawForm& form : other_forms) check_conservation<double>(form, 1e-14, outcome);
  return outcome;
}

Outcome affine_field(const RunOptions&) {
  Outcome outcome;
  check_affine<float>({}, 1e-5, outcome);
  check_affine<double>({}, 1e-13, outcome);
  for (const LawForm& form : other_forms) check_affine<double>(form, 1e-13, outcome);
  return outcome;
}

Outcome kernel_moments(const RunOptions&) {
  Outcome outcome;
  check_moments<Spline::quadratic>("1/4", 0.25, outcome);
  check_moments<Spline::cubic>("1/3", 1.0 / 3, outcome);
  return outcome;
}

Outcome material_laws(const RunOptions&) {
  const Mat3d R = rotation_about(normalized(Vec3d{1, -2, 0.5}), 0.8);
  double turned = 0, repeated = 0, energy = 0;
  for (const std::string& name : material_preset_names()) {
    const auto m = mpm::material_parameters<double>(preset(name));
    if (m.model == MaterialModel::stationary) continue;
    const double stiffness = m.density * m.elastic_speed * m.elastic_speed;
    for (uint64_t i = 0; i < 20; ++i) {
      const Mat3d C = random_matrix<double>(i, i % 2 == 0 ? 0.1 : 50);
      Mat3d F = Mat3d::identity(), F_turned = R;
      double internal = mpm::initial_internal_variable(m.model), internal_turned = internal;
      const Mat3d tau = mpm::update_material(m, 1e-3, C, F, internal);
      const Mat3d tau_turned = mpm::update_material(m, 1e-3, R * C * transpose(R), F_turned, internal_turned);
      turned = std::max(turned, largest_entry(tau_turned - R * tau * transpose(R)) / stiffness);
      if (!flows_on(m)) {
        Mat3d again = F;
        mpm::update_material(m, 1e-3, Mat3d::zero(), again, internal);
        repeated = std::max(repeated, largest_entry(again - F));
      }
    }
    if (!mpm::keeps_deformation(m.model)) continue;
    Mat3d F = 0.998 * Mat3d::identity() + random_matrix<double>(3, 2e-5);  // below every yield surface
    double internal = mpm::initial_internal_variable(m.model);
    const Mat3d tau = mpm::update_material(m, 1e-3, Mat3d::zero(), F, internal);
    energy = std::max(energy, energy_error(m, F, internal, tau));
  }
  Outcome outcome;
  outcome.add(absolute("tau(R F) - R tau R^T over stiffness, all presets", turned, 0, 1e-12));
  outcome.add(absolute("change of F by a second return mapping, all presets", repeated, 0, 1e-12));
  outcome.add(absolute("stress from energy - stress, relative, all presets", energy, 0, 1e-6));
  return outcome;
}

}  // namespace graupel::validation
