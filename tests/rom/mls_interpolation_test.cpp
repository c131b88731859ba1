// Fields between particles: linear fields exactly, their derivative, cuts, what is outside, and refined bodies.
#include "rom/interpolation/mls_interpolation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/math/random.h"
#include "core/system/error.h"
#include "rom/fields/factored_fields.h"

namespace graupel::rom {
namespace {

constexpr double spacing = 0.02;
using Field = std::function<Vec3d(const Vec3d&)>;

double noise(uint64_t i, int c) { return Random(5, RandomPurpose::test).uniform(i, c, -0.5, 0.5); }

/// A box of 9 x 9 x `layers` particles, each anywhere in its cell; of kind 1 beyond `cut`.
MlsParticles box(int layers, double cut = 1e9) {
  MlsParticles body;
  body.spacing = spacing;
  for (int i = 0; i < 81 * layers; ++i) {
    const auto n = static_cast<uint64_t>(i);
    const Vec3d x{spacing * (i % 9 + noise(n, 0)), spacing * (i / 9 % 9 + noise(n, 1)),
                  layers > 1 ? spacing * (i / 81 + noise(n, 2)) : 0.5};
    body.numbers.push_back(i);
    body.reference.push_back(x.cast<float>());
    body.kind.push_back(x[0] > cut ? 1 : 0);
  }
  return body;
}

/// Points inside of that box, some of them before its first and behind its last particles, in no order.
ReferencePoints points_in(int layers, int count) {
  ReferencePoints points;
  for (int i = 0; i < count; ++i) {
    const auto n = static_cast<uint64_t>(7000 + i);
    points.position.push_back({static_cast<float>(spacing * (4 + 9 * noise(n, 0))),
                               static_cast<float>(spacing * (4 + 9 * noise(n, 1))),
                               layers > 1 ? static_cast<float>(spacing * (layers / 2 + layers * noise(n, 2))) : 0.5f});
    points.kind.push_back(0);
  }
  return points;
}

ModeTable table_of(const MlsParticles& body, int components, const Field& mode) {
  ModeTable table;
  table.components = components;
  table.modes = 1;
  table.points = body.numbers;
  for (const Vec3f& x : body.reference)
    for (int c = 0; c < components; ++c) {
      table.mean.push_back(components == 3 ? x[c] : 0.0f);
      table.basis.push_back(components == 3 ? static_cast<float>(mode(x.cast<double>())[c]) : 0.0f);
    }
  return table;
}

/// x = X + q mode(X).
FactoredFields fields_with(const MlsParticles& body, const Field& mode) {
  const MapBranch nothing(CoefficientMap(1, 1, {0}, {1}, {}, {}, {0, 0}));
  return {table_of(body, 3, mode), ClosureBranch(1, CoefficientMap()),        table_of(body, 6, mode), nothing,
          table_of(body, 9, mode), std::make_shared<const MapBranch>(nothing)};
}

struct Decoded {
  std::vector<Vec3d> position, velocity;
  std::vector<Mat<double, 3>> gradient;
};

/// At q = 1, q' = 2.
template <typename T>
Decoded decode(const Fields& fields, const MlsParticles& body, const ReferencePoints& points) {
  MlsPositions<T> trunk(fields, body, points);
  const auto n = static_cast<int64_t>(points.position.size());
  std::vector<T> x(static_cast<std::size_t>(3 * mpm::padded_to_tile(n))), v(x.size()), f(3 * x.size());
  const LatentState state{{1}, {2}, {}, 0, {}};
  trunk.decode_with_gradient(state, x.data(), f.data());
  std::vector<T> again(x.size());
  trunk.decode(state, again.data());
  EXPECT_EQ(x, again);
  trunk.decode(state, again.data(), v.data());
  EXPECT_EQ(x, again);
  Decoded out;
  for (int64_t i = 0; i < n; ++i) {
    out.position.push_back(mpm::TiledView<T, 3>{x.data()}.vec(i).template cast<double>());
    out.velocity.push_back(mpm::TiledView<T, 3>{v.data()}.vec(i).template cast<double>());
    const Mat<T, 3> m = mpm::load_matrix<T, 3>(mpm::TiledView<T, 9>{f.data()}, i);
    out.gradient.emplace_back();
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) out.gradient.back()(r, c) = static_cast<double>(m(r, c));
  }
  return out;
}

const double slope[3][3] = {{0.3, -0.2, 0.1}, {0.5, 0.2, -0.4}, {-0.1, 0.6, 0.3}};
Vec3d linear(const Vec3d& x) {
  Vec3d u{0.1, -0.2, 0.3};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) u[r] += slope[r][c] * x[c];
  return u;
}

template <typename T>
void expect_linear_fields_exact(int layers, double tolerance) {
  const MlsParticles body = box(layers);
  const ReferencePoints points = points_in(layers, 500);
  const FactoredFields fields = fields_with(body, linear);
  const Decoded out = decode<T>(fields, body, points);
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    const Vec3d x = points.position[i].cast<double>(), u = linear(x);
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(out.position[i][r], x[r] + u[r], tolerance * spacing) << i;
      EXPECT_NEAR(out.velocity[i][r], 2 * u[r], 2 * tolerance * spacing) << i;
      for (int c = 0; c < (layers > 1 ? 3 : 2); ++c)
        EXPECT_NEAR(out.gradient[i](r, c), (r == c) + slope[r][c], 5 * tolerance) << i;
      if (layers == 1) {
        EXPECT_NEAR(out.gradient[i](r, 2), r == 2, 5 * tolerance) << "no slope is known across a plane";
      }
    }
  }
}

TEST(MlsInterpolation, LinearFieldsAreExact) {
  expect_linear_fields_exact<double>(9, 2e-5);  // modes are stored in single precision
  expect_linear_fields_exact<float>(9, 3e-3);
  expect_linear_fields_exact<double>(1, 2e-5);
}

Vec3d waves(const Vec3d& x) {
  return {0.02 * std::sin(30 * x[0] + 10 * x[1]), 0.01 * std::cos(40 * x[2]), 0.02 * std::sin(25 * x[1]) * x[0]};
}

TEST(MlsInterpolation, TheGradientIsTheDerivativeAndContinuous) {
  const MlsParticles body = box(9);
  const FactoredFields fields = fields_with(body, waves);
  constexpr int count = 400;
  constexpr float step = 2e-4f;  // of a metre: a hundredth of the spacing
  for (int axis = 0; axis < 3; ++axis) {
    ReferencePoints line;
    for (int i = 0; i < count; ++i) {
      Vec3f x{0.07f, 0.083f, 0.076f};
      x[axis] = 0.04f + step * static_cast<float>(i);
      line.position.push_back(x);
      line.kind.push_back(0);
    }
    const Decoded out = decode<double>(fields, body, line);
    for (std::size_t i = 1; i + 1 < count; ++i)
      for (int r = 0; r < 3; ++r) {
        const double width =
            static_cast<double>(line.position[i + 1][axis]) - static_cast<double>(line.position[i - 1][axis]);
        EXPECT_NEAR((out.position[i + 1][r] - out.position[i - 1][r]) / width, out.gradient[i](r, axis), 2e-3) << i;
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(out.gradient[i](r, c), out.gradient[i - 1](r, c), 0.02) << i;
      }
  }
}

TEST(MlsInterpolation, SmoothFieldsAreFollowedInside) {
  const MlsParticles body = box(9);
  ReferencePoints points = points_in(9, 300);
  for (Vec3f& x : points.position)
    for (int d = 0; d < 3; ++d) x[d] = 0.08f + 0.6f * (x[d] - 0.08f);
  const Decoded out = decode<double>(fields_with(body, waves), body, points);
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    const Vec3d x = points.position[i].cast<double>();
    EXPECT_LT(norm(out.position[i] - x - waves(x)), 0.25 * 0.02) << "a quarter of the amplitude";
  }
}

TEST(MlsInterpolation, CutsStaySharp) {
  const MlsParticles body = box(9, 0.08);
  const FactoredFields fields = fields_with(body, [](const Vec3d& x) { return Vec3d{x[0] > 0.08 ? 1.0 : 0.0, 0, 0}; });
  ReferencePoints points = points_in(9, 200);
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    points.position[i][0] = 0.08f + 0.3f * (points.position[i][0] - 0.08f);
    points.kind[i] = points.position[i][0] > 0.08f ? 1 : 0;  // both kinds in a tile
  }
  const Decoded out = decode<float>(fields, body, points);
  for (std::size_t i = 0; i < points.position.size(); ++i)
    EXPECT_NEAR(out.position[i][0] - static_cast<double>(points.position[i][0]), points.kind[i], 1e-5);
}

TEST(MlsInterpolation, PointsOutsideOfTheBodyAreRefused) {
  const MlsParticles body = box(9, 0.08);
  const FactoredFields fields = fields_with(body, linear);
  const auto refused = [&](const Vec3f& x, int32_t kind, const std::string& part) {
    ReferencePoints points = points_in(9, 20);
    for (Vec3f& inside : points.position) inside[0] = std::min(inside[0], 0.07f);
    points.position.push_back(x);
    points.kind.push_back(kind);
    try {
      MlsPositions<float> trunk(fields, body, points);
      FAIL() << "accepted a point outside";
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  refused({0.08f, 0.08f, 0.3f}, 0, "point 20 at (0.08, 0.08, 0.3)");
  refused({0.02f, 0.08f, 0.08f}, 1, "of its kind");  // inside of the other piece
  refused({0.08f, 0.08f, 0.08f}, 7, "far from the nearest particle of its kind");
}

TEST(MlsInterpolation, RefinedPointsFillTheVolumesOfTheParticles) {
  const MlsParticles body = box(9);
  const std::vector<double> side(body.numbers.size(), spacing);
  const ReferencePoints points = refined_points(body, side, 100, 3, 8);
  ASSERT_EQ(points.position.size(), 100 * body.numbers.size());
  Vec3d mean = Vec3d::zero();
  int octants[8] = {};
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    const Vec3d d = (points.position[i] - body.reference[i / 100]).cast<double>();
    for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(d[c]), 0.5001 * spacing);
    mean += d;
    if (i < 100) ++octants[(d[0] > 0) + 2 * (d[1] > 0) + 4 * (d[2] > 0)];
  }
  EXPECT_LT(norm(mean) / static_cast<double>(points.position.size()), 0.01 * spacing);
  for (const int count : octants) EXPECT_NEAR(count, 12.5, 8);
  EXPECT_EQ(refined_points(body, side, 100, 3, 8).position, points.position);
  EXPECT_NE(refined_points(body, side, 100, 3, 9).position, points.position);
  const MlsParticles sheet = box(1);
  for (const Vec3f& x : refined_points(sheet, std::vector<double>(81, spacing), 7, 2, 8).position)
    EXPECT_EQ(x[2], 0.5f);
  // Some lie outside of the body's corners, where too few particles are near for a slope.
  const Decoded out = decode<float>(fields_with(body, linear), body, points);
  int far_off = 0;
  double worst = 0;
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    const Vec3d x = points.position[i].cast<double>();
    const double error = norm(out.position[i] - x - linear(x));
    worst = std::max(worst, error);
    far_off += error > 0.01 * spacing;
  }
  EXPECT_LT(far_off, static_cast<int>(points.position.size()) / 1000);
  EXPECT_LT(worst, spacing);
}

}  // namespace
}  // namespace graupel::rom
