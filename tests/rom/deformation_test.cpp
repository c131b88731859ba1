// Models that know their deformation alone: the map's derivatives, projections, and motions that are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/system/error.h"
#include "rom/cubature/sample_selection.h"
#include "rom/deformation/mode_deformation.h"
#include "rom/reduced_solver.h"
#include "rom/solver/eulerian_quadrature.h"
#include "tests/rom/deformation_model.h"
#include "tests/rom/random_network.h"

namespace graupel::rom {
namespace {

using test::deformation_model;
using test::jelly_block;
using test::linear_network;
using test::random_network;
using test::translation;

constexpr ProjectionKind projections[] = {ProjectionKind::position, ProjectionKind::position_velocity,
                                          ProjectionKind::velocity};

std::vector<float> some_points(int n) {
  std::vector<float> points;
  for (int i = 0; i < 3 * n; ++i)
    points.push_back(static_cast<float>(0.5 * test::network_noise(static_cast<uint64_t>(i))));
  return points;
}

/// g, F and velocity in tiles.
template <typename T>
struct Decoded {
  std::vector<T> position, velocity, gradient;

  Decoded(const Deformation& map, const std::vector<float>& points, const LatentState& state,
          PointTables tables = PointTables::kept) {
    const auto bound = bind_deformation<T>(map, points, tables);
    const std::size_t slots = 16 * bound->all_tiles().size();
    position.resize(3 * slots);
    velocity.resize(3 * slots);
    gradient.resize(9 * slots);
    bound->decode(state, bound->all_tiles(), position.data(), velocity.data(), gradient.data());
  }
  Vec<T, 3> x(int64_t p) const { return at(position, p); }
  Vec<T, 3> v(int64_t p) const { return at(velocity, p); }
  T F(int64_t p, int r, int c) const {
    return gradient[static_cast<std::size_t>((p / 16 * 9 + 3 * r + c) * 16 + p % 16)];
  }

 private:
  static Vec<T, 3> at(const std::vector<T>& values, int64_t p) {
    Vec<T, 3> v;
    for (int d = 0; d < 3; ++d) v[d] = values[static_cast<std::size_t>((p / 16 * 3 + d) * 16 + p % 16)];
    return v;
  }
};

const std::vector<double> rest_of_four = {0.1, -0.2, 0.3, 0};

MlpDeformation some_network() { return MlpDeformation(random_network(3 + 4, 30, 3, 8), rest_of_four); }

/// Four random modes on a lattice around some_points().
ModeDeformation some_modes() {
  const ModeLattice lattice = ModeLattice::around({-0.5f, -0.5f, -0.5f, 0.5f, 0.5f, 0.5f}, 0.3, Vec3d::filled(-0.5));
  std::vector<float> nodes(static_cast<std::size_t>(4 * 3 * lattice.nodes()));
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i] = static_cast<float>(test::network_noise(i));
  return {lattice, std::move(nodes), rest_of_four};
}

class DeformationMaps : public testing::TestWithParam<DeformationKind> {
 protected:
  const MlpDeformation network_ = some_network();
  const ModeDeformation modes_ = some_modes();
  const Deformation& map = GetParam() == DeformationKind::mlp ? static_cast<const Deformation&>(network_) : modes_;
};

TEST_P(DeformationMaps, GradientAndVelocityAreTheSlopesOfPositions) {
  const LatentState state{{0.5, 0.2, -0.4, 0.1}, {2, -1, 0.5, 3}, {}, 0, {}};
  const std::vector<float> points = some_points(37);
  const Decoded<double> at(map, points, state);
  constexpr float h = 1.0f / 1024;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> up = points, down = points;
    for (std::size_t p = 0; p < 37; ++p) {
      up[3 * p + static_cast<std::size_t>(c)] += h;
      down[3 * p + static_cast<std::size_t>(c)] -= h;
    }
    const Decoded<double> above(map, up, state), below(map, down, state);
    for (int64_t p = 0; p < 37; ++p) {
      const auto i = static_cast<std::size_t>(3 * p + c);
      const double width = static_cast<double>(up[i]) - static_cast<double>(down[i]);
      for (int r = 0; r < 3; ++r) EXPECT_NEAR(at.F(p, r, c), (above.x(p)[r] - below.x(p)[r]) / width, 2e-4);
    }
  }
  constexpr double dt = 1e-5;
  LatentState later = state, earlier = state;
  for (std::size_t j = 0; j < 4; ++j) {
    later.latent[j] += dt * state.velocity[j];
    earlier.latent[j] -= dt * state.velocity[j];
  }
  const Decoded<double> after(map, points, later), before(map, points, earlier);
  for (int64_t p = 0; p < 37; ++p)
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(at.v(p)[d], (after.x(p)[d] - before.x(p)[d]) / (2 * dt), 1e-6);
}

TEST_P(DeformationMaps, BothPrecisionsAgreeAndTheBodyStartsUndeformed) {
  const std::vector<double>& rest = rest_of_four;
  const std::vector<float> points = some_points(70);
  const LatentState state{{0.5, 0.2, -0.4, 0.1}, {2, -1, 0.5, 3}, {}, 0, {}};
  const Decoded<double> twice(map, points, state), start(map, points, {rest, {0, 0, 0, 0}, {}, 0, {}});
  const Decoded<float> single(map, points, state);
  for (std::size_t i = 0; i < twice.position.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(single.position[i]), twice.position[i], 3e-5);
    EXPECT_NEAR(static_cast<double>(single.velocity[i]), twice.velocity[i], 1e-4);
  }
  for (std::size_t i = 0; i < twice.gradient.size(); ++i)
    EXPECT_NEAR(static_cast<double>(single.gradient[i]), twice.gradient[i], 1e-4);
  for (int64_t p = 0; p < 70; ++p)
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(start.x(p)[r], static_cast<double>(points[static_cast<std::size_t>(3 * p + r)]), 1e-12);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(start.F(p, r, c), r == c ? 1 : 0, 1e-12);
    }
}

TEST_P(DeformationMaps, AreTheSameWithoutTables) {
  const std::vector<float> points = some_points(70);
  const LatentState state{{0.5, 0.2, -0.4, 0.1}, {2, -1, 0.5, 3}, {}, 0, {}};
  const Decoded<double> tables(map, points, state), without(map, points, state, PointTables::none);
  const auto bound = bind_deformation<double>(map, points, PointTables::none);
  std::vector<double> position(tables.position.size());
  bound->positions(state, position.data());
  for (int64_t p = 0; p < 70; ++p)
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(without.x(p)[r], tables.x(p)[r], 1e-12);
      EXPECT_NEAR(position[static_cast<std::size_t>((p / 16 * 3 + r) * 16 + p % 16)], tables.x(p)[r], 1e-12);
      EXPECT_NEAR(without.v(p)[r], tables.v(p)[r], 1e-12);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(without.F(p, r, c), tables.F(p, r, c), 1e-11);
    }
}

TEST(ModeLattice, HasTheNodesOfAGrid) {
  const ModeLattice lattice = ModeLattice::around({0.31f, -0.2f, 1.0f, 0.74f, 0.3f, 1.1f}, 0.1, {0.05, 0, 0});
  for (int d = 0; d < 3; ++d) {
    const double nodes = (lattice.low[d] - (d == 0 ? 0.05 : 0)) / 0.1;
    EXPECT_NEAR(nodes, std::round(nodes), 1e-9);
  }
  for (const Vec3d& x : {Vec3d{0.31, -0.2, 1}, Vec3d{0.74, 0.3, 1.1}}) {
    const ModeStencil stencil(lattice, x);
    double sum = 0;
    for (int n = 0; n < mode_stencil; ++n) {
      EXPECT_GE(stencil.weight[n], 0) << "beyond the lattice";
      sum += stencil.weight[n];
    }
    EXPECT_NEAR(sum, 1, 1e-12);
  }
}

TEST(ModeLattice, PointsAnywhereDependOnNodesOfIt) {
  const ModeLattice lattice = ModeLattice::around({0, 0, 0, 1, 1, 1}, 0.1, {0, 0, 0});
  const int last = lattice.count[0] - 3;
  EXPECT_EQ(mode_base(lattice, 0, 3.7), 3);
  for (const double beyond : {1e3, 1e10, 1e40, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(mode_base(lattice, 0, beyond), last) << beyond;
    EXPECT_EQ(mode_base(lattice, 0, -beyond), 0) << beyond;
  }
  EXPECT_EQ(mode_base(lattice, 0, std::numeric_limits<double>::quiet_NaN()), 0);
}

TEST_P(DeformationMaps, SamplesAreThePointsAndTheirJacobianIsTheSlope) {
  const std::vector<float> points = some_points(20);
  const auto samples = map.bind_samples(points);
  const LatentState state{{0.5, 0.2, -0.4, 0.1}, {2, -1, 0.5, 3}, {}, 0, {}};
  const Decoded<double> at(map, points, state);
  Eigen::VectorXd position;
  Eigen::MatrixXd jacobian;
  samples->evaluate(state.latent.data(), position);
  samples->jacobian(state.latent.data(), jacobian);
  const Eigen::VectorXd velocity = jacobian * Eigen::Map<const Eigen::VectorXd>(state.velocity.data(), 4);
  for (int64_t p = 0; p < 20; ++p)
    for (int d = 0; d < 3; ++d) {
      EXPECT_NEAR(at.x(p)[d], position[3 * p + d], 1e-9);
      EXPECT_NEAR(at.v(p)[d], velocity[3 * p + d], 1e-9);
    }
}

TEST_P(DeformationMaps, AreThoseOfTheirFile) {
  const std::vector<float> points = some_points(20);
  nn::Weights weights;
  map.store(weights);
  const auto loaded = DeformationFields::load(weights, 4, points, rest_of_four);
  EXPECT_STREQ(loaded->kind(), word_of(GetParam()));
  const LatentState state{{0.5, 0.2, -0.4, 0.1}, {2, -1, 0.5, 3}, {}, 0, {}};
  const Decoded<double> before(map, points, state), after(loaded->deformation(), points, state);
  for (std::size_t i = 0; i < before.position.size(); ++i) EXPECT_NEAR(after.position[i], before.position[i], 1e-6);
  for (std::size_t i = 0; i < before.gradient.size(); ++i) EXPECT_NEAR(after.gradient[i], before.gradient[i], 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Kinds, DeformationMaps, testing::Values(DeformationKind::mlp, DeformationKind::modes),
                         [](const auto& kind) { return std::string(word_of(kind.param)); });

TEST(ModeDeformation, FilesOfOtherModesAreRefused) {
  nn::Weights weights;
  some_modes().store(weights);
  weights.file = "modes.safetensors";
  EXPECT_THROW(ModeDeformation::load(weights, {0, 0}), InputError) << "of four latents";
  weights.tensors["modes.lattice"] = nn::Tensor::from_float({0, 0, 0, -1}, {4});
  EXPECT_THROW(ModeDeformation::load(weights, rest_of_four), InputError) << "a negative spacing";
  weights.tensors.erase("modes.lattice");
  EXPECT_THROW(ModeDeformation::load(weights, rest_of_four), InputError);
}

TEST(Projection, FindsTheLatentAndItsVelocity) {
  const MlpDeformation map(random_network(3 + 4, 30, 3, 8));
  const auto field = map.bind_samples(some_points(20));
  constexpr double dt = 1e-3;
  const std::vector<double> q = {0.5, 0.2, -0.4, 0.1}, rate = {2, -1, 0.5, 3};
  for (const ProjectionKind kind : projections) {
    LatentState state{q, {0, 0, 0, 0}, {}, 0, {}};
    SampleMotion motion;
    Eigen::MatrixXd jacobian;
    field->evaluate(q.data(), motion.before);
    field->jacobian(q.data(), jacobian);
    // Positions on the manifold, or velocities in its tangent space.
    if (kind == ProjectionKind::velocity) {
      motion.after = motion.before + dt * (jacobian * Eigen::Map<const Eigen::VectorXd>(rate.data(), 4));
    } else {
      std::vector<double> later = q;
      for (std::size_t j = 0; j < 4; ++j) later[j] += dt * rate[j];
      field->evaluate(later.data(), motion.after);
    }
    const FitReport report = project(kind, *field, motion, dt, 20, state);
    EXPECT_LT(report.distance, 1e-8) << word_of(kind);
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_NEAR(state.latent[j], q[j] + dt * rate[j], 2e-7) << word_of(kind);
      EXPECT_NEAR(state.velocity[j], rate[j], kind == ProjectionKind::velocity ? 1e-9 : 0.05) << word_of(kind);
    }
    EXPECT_EQ(state.last_step > 0, kind == ProjectionKind::position);
  }
}

TEST(Projection, LostSamplesDoNotCount) {
  const MlpDeformation map(random_network(3 + 4, 30, 3, 8));
  const auto field = map.bind_samples(some_points(20));
  const std::vector<double> q = {0.5, 0.2, -0.4, 0.1};
  for (const ProjectionKind kind : projections) {
    LatentState state{q, {0, 0, 0, 0}, {}, 0, {}};
    SampleMotion motion;
    field->evaluate(q.data(), motion.before);
    motion.after = motion.before;
    motion.after.segment<3>(6).array() += 0.3;
    motion.weight.assign(20, 1);
    motion.weight[2] = 0;
    project(kind, *field, motion, 1e-3, 20, state);
    for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(state.latent[j], q[j], 1e-9) << word_of(kind);
  }
}

/// Two samples of a map that can follow one of them alone: the heavier one wins, by its weight.
TEST(Projection, HeavySamplesAreFollowed) {
  const MlpDeformation map(linear_network((Eigen::MatrixXd(3, 4) << 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0).finished()));
  const auto field = map.bind_samples({0, 0, 0, 0.5f, 0, 0});
  for (const ProjectionKind kind : projections) {
    LatentState state{{0}, {0}, {}, 0, {}};
    SampleMotion motion;
    field->evaluate(state.latent.data(), motion.before);
    motion.after = motion.before;
    motion.after[0] += 0.01;
    motion.weight = {9, 1};
    const FitReport report = project(kind, *field, motion, 1e-3, 20, state);
    EXPECT_NEAR(state.latent[0], 0.009, 1e-9) << word_of(kind);
    EXPECT_NEAR(report.distance, std::sqrt(0.9 * 0.1) * 0.01, 1e-9) << word_of(kind);
  }
}

template <typename T>
class DeformationRun : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(DeformationRun, Precisions);

/// Symplectic Euler: after n steps v = g n dt, x = g dt^2 n (n + 1) / 2.
TYPED_TEST(DeformationRun, ABodyInTheAirFallsFreely) {
  const Scene scene = jelly_block("[0, -9.8, 0]");
  ReducedModel model = deformation_model(scene, linear_network(translation()), {0, 0, 0});
  for (const ProjectionKind kind : projections) {
    model.gradient = kind == ProjectionKind::position ? GradientKind::integrated : GradientKind::map;
    ReducedOptions options;
    options.projection = kind;
    ReducedSolver<TypeParam> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {}, options);
    for (int f = 0; f < 3; ++f) solver.advance_frame();
    const double n = 12, dt = 0.0025, tolerance = sizeof(TypeParam) == 4 ? 2e-5 : 2e-7;
    EXPECT_NEAR(solver.state().latent[1], -9.8 * dt * dt * n * (n + 1) / 2, tolerance) << word_of(kind);
    EXPECT_NEAR(solver.state().velocity[1], -9.8 * n * dt, 100 * tolerance) << word_of(kind);
    EXPECT_NEAR(solver.state().latent[0], 0, tolerance) << word_of(kind);
  }
}

/// A stretched block pulls on itself, and its momentum stays: with all particles the mean velocity is zero.
TYPED_TEST(DeformationRun, StressMovesNoMomentum) {
  const Scene scene = jelly_block("[0, 0, 0]");
  Eigen::MatrixXd matrix = translation();
  matrix(0, 0) = 0.1;  // du_x/dX = 0.1
  matrix(1, 0) = 0.05;
  ReducedModel model = deformation_model(scene, linear_network(matrix), {0, 0, 0});
  model.fields = std::make_shared<const DeformationFields>(
      model.reference, std::make_shared<const MlpDeformation>(linear_network(matrix)));
  ReducedOptions options;
  options.projection = ProjectionKind::velocity;
  ReducedSolver<TypeParam> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {}, options);
  const std::vector<double> start = solver.state().latent;
  solver.step(0.0025);
  const double tolerance = sizeof(TypeParam) == 4 ? 1e-4 : 1e-9;
  for (std::size_t d = 0; d < 3; ++d) EXPECT_NEAR(solver.state().velocity[d], 0, tolerance);
  EXPECT_GT(solver.trust().residual, 0.5) << "its particles move, but not as a whole";
}

/// A stretched block at rest: cells' points find their material points, and their mass is that of the block.
TEST(EulerianQuadrature, TracesPointsBackAndHasTheBodysMass) {
  const Scene scene = jelly_block("[0, 0, 0]");
  Eigen::MatrixXd matrix = translation();
  matrix(0, 0) = 0.1;
  matrix(1, 2) = -0.05;
  const ReducedModel model = deformation_model(scene, linear_network(matrix), {0, 0, 0});
  const MlpDeformation map(linear_network(matrix));
  const mpm::PreparedScene prepared(scene, {.seed = scene.seed});
  ParticleGrid<double> grid(prepared);
  EulerianQuadrature<double> quadrature(map, model.reference, prepared.particles, model.samples,
                                        mpm::grid_of<double>(scene.domain), 2, grid);
  const LatentState state{{0.02, -0.01, 0.03}, {0.5, 0, -0.25}, {}, 0, {}};
  quadrature.find(state, grid);
  quadrature.fill(state, grid);
  const mpm::ParticleView<double> p = grid.particles();
  const auto samples = static_cast<int64_t>(model.samples.size());
  double volume = 0, expected = 0;
  Vec3d center = Vec3d::zero(), expected_center = Vec3d::zero();
  for (const double v : prepared.particles.volume) expected += v;
  for (const Vec3d& X : prepared.particles.position)
    expected_center +=
        (1.0 / static_cast<double>(samples)) * Vec3d{X[0] * 1.1 + 0.02, X[1] - 0.05 * X[2] - 0.01, X[2] + 0.03};
  for (int64_t slot = samples; slot < p.count; ++slot) {
    const Mat<double, 3> F = mpm::load_matrix<double, 3>(p.deformation_gradient, slot);
    EXPECT_NEAR(F(0, 0), 1.1, 1e-6);
    EXPECT_NEAR(F(1, 2), -0.05, 1e-6);
    EXPECT_NEAR(p.velocity.vec(slot)[0], 0.5, 1e-6);
    volume += p.volume.get(slot);
    center += p.volume.get(slot) * p.position.vec(slot);
  }
  EXPECT_NEAR(volume, expected, 0.06 * expected);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(center[d] / volume, expected_center[d], 0.1 * scene.domain.dx) << d;
}

TYPED_TEST(DeformationRun, EulerianQuadratureFallsAsFreely) {
  const Scene scene = jelly_block("[0, -9.8, 0]");
  const ReducedModel model = deformation_model(scene, linear_network(translation()), {0, 0, 0});
  ReducedOptions options;
  options.quadrature = QuadratureKind::eulerian;
  options.samples = std::vector<int32_t>{3, 40, 77, 150};
  ReducedSolver<TypeParam> solver(model, mpm::PreparedScene(scene, {.seed = scene.seed}), {}, options);
  for (int f = 0; f < 3; ++f) solver.advance_frame();
  const double n = 12, dt = 0.0025;
  EXPECT_NEAR(solver.state().latent[1], -9.8 * dt * dt * n * (n + 1) / 2, 2e-5);
  EXPECT_NEAR(solver.state().velocity[1], -9.8 * n * dt, 2e-3);
}

TEST(ReferenceBody, KnowsWhatIsInside) {
  const Scene scene = jelly_block("[0, 0, 0]");
  const ReducedModel model = deformation_model(scene, linear_network(translation()), {0, 0, 0});
  const mpm::PreparedScene prepared(scene, {.seed = scene.seed});
  const ReferenceBody body(model.reference, prepared.particles.volume);
  int64_t inside = 0, right = 0;
  constexpr int n = 40;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) {
        const Vec3d x = Vec3d{0.35 + 0.3 * (i + 0.5) / n, 0.35 + 0.3 * (j + 0.5) / n, 0.35 + 0.3 * (k + 0.5) / n};
        bool in = true;
        for (int d = 0; d < 3; ++d) in = in && std::abs(x[d] - 0.5) < 0.1;
        const int32_t particle = body.particle_at(x);
        inside += particle >= 0;
        right += (particle >= 0) == in;
        if (particle < 0) continue;
        EXPECT_LT(norm(prepared.particles.position[static_cast<std::size_t>(particle)] - x), 0.04);
      }
  EXPECT_NEAR(static_cast<double>(inside) / (n * n * n), 8.0 / 27, 0.015);
  EXPECT_GT(static_cast<double>(right) / (n * n * n), 0.9);
  EXPECT_EQ(body.particle_at({0.9, 0.5, 0.5}), -1);
}

TEST(BoundarySamples, AreFiveOfEveryScriptAtLeast) {
  const std::vector<int32_t> script = {-1, 0, 0, 0, 0, 0, 0, 0, 0, -1, 1, 1, -1};
  const std::vector<int32_t> samples = with_boundary_samples({0, 3, 9}, script, 5);
  EXPECT_EQ(std::vector<int32_t>(samples.begin(), samples.begin() + 3), (std::vector<int32_t>{0, 3, 9}));
  EXPECT_EQ(std::set<int32_t>(samples.begin(), samples.end()).size(), samples.size());
  const auto led_by = [&](int32_t number) {
    return std::count_if(samples.begin(), samples.end(),
                         [&](int32_t p) { return script[static_cast<std::size_t>(p)] == number; });
  };
  EXPECT_EQ(led_by(0), 5);
  EXPECT_EQ(led_by(1), 2) << "there are no more";
  EXPECT_EQ(with_boundary_samples({4, 2}, {}, 5), (std::vector<int32_t>{4, 2}));
}

TEST(DeformationModel, SurvivesAFileAndRefusesWhatItCannotKnow) {
  const Scene scene = jelly_block("[0, -9.8, 0]");
  ReducedModel model = deformation_model(scene, linear_network(translation()), {0, 0, 0});
  model.gradient = GradientKind::integrated;
  nn::Weights weights = model.store(nn::DType::f32);
  weights.file = "crom.safetensors";
  EXPECT_TRUE(is_reduced_model(weights));
  const ReducedModel again = ReducedModel::load(weights);
  EXPECT_EQ(again.kind, ReducedKind::crom);
  EXPECT_EQ(again.projection, ProjectionKind::position_velocity);
  EXPECT_EQ(again.gradient, GradientKind::integrated);
  EXPECT_TRUE(again.fields->stress_follows_deformation());
  ReducedOptions eulerian;
  eulerian.quadrature = QuadratureKind::eulerian;
  EXPECT_THROW(ReducedSolver<double>(again, mpm::PreparedScene(scene, {.seed = scene.seed}), {}, eulerian),
               ConfigError);
  const auto latent_after_a_frame = [&](const ReducedModel& of) {
    ReducedSolver<double> solver(of, mpm::PreparedScene(scene, {.seed = scene.seed}), {}, {});
    solver.advance_frame();
    return solver.state().latent;
  };
  EXPECT_EQ(latent_after_a_frame(again), latent_after_a_frame(model));

  Scene sandy = scene;
  sandy.materials.begin()->second.model = MaterialModel::sand;
  try {
    ReducedSolver<double>(model, mpm::PreparedScene(sandy, {.seed = scene.seed}), {}, {});
    FAIL() << "a plastic law was taken";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("material 'jelly' is not elastic"), std::string::npos) << error.what();
  }
  Scene with_spare = scene;
  with_spare.materials["spare"].model = MaterialModel::sand;  // of no body
  EXPECT_NO_THROW(check_deformation_scene(with_spare));
  Scene affine = scene;
  affine.transfer.scheme = TransferScheme::apic;
  EXPECT_THROW(ReducedSolver<double>(model, mpm::PreparedScene(affine, {.seed = scene.seed}), {}, {}), ConfigError);
  weights.metadata["architecture"] = "licrom";
  EXPECT_THROW(ReducedModel::load(weights), InputError);
}

}  // namespace
}  // namespace graupel::rom
