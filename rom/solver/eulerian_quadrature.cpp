#include "rom/solver/eulerian_quadrature.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/math/mat.h"
#include "core/parallel/parallel_for.h"
#include "mpm/physics/stencil.h"

namespace graupel::rom {

namespace {

using mpm::tile;

constexpr int newton_iterations = 8;
constexpr double newton_tolerance = 1e-4;  ///< of dx
constexpr int stencil_reach = 2;           ///< base cells apart that quadratic stencils of three nodes share nodes over

template <typename T>
Vec3d vector_at(const std::vector<T>& values, int64_t slot) {
  const T* const at = mpm::TiledView<const T, 3>{values.data()}.at(slot);
  Vec3d v;
  for (int d = 0; d < 3; ++d) v[d] = static_cast<double>(at[d * tile]);
  return v;
}
Vec3d point_at(const std::vector<float>& points, int64_t p) {
  Vec3d x;
  for (int d = 0; d < 3; ++d) x[d] = static_cast<double>(points[static_cast<std::size_t>(3 * p + d)]);
  return x;
}
template <typename T>
Mat<double, 3> matrix_at(const std::vector<T>& values, int64_t slot) {
  const T* const at = mpm::TiledView<const T, 9>{values.data()}.at(slot);
  Mat<double, 3> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = static_cast<double>(at[(3 * r + c) * tile]);
  return m;
}

Mat<double, 3> inverse(const Mat<double, 3>& m) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> inverted =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&m.a[0][0]).inverse();
  Mat<double, 3> result;
  std::copy_n(inverted.data(), 9, &result.a[0][0]);
  return result;
}

}  // namespace

template <typename T>
EulerianQuadrature<T>::EulerianQuadrature(const Deformation& map, const std::vector<float>& reference,
                                          const mpm::SampledParticles& particles, const std::vector<int32_t>& samples,
                                          const mpm::GridGeometry<T, 3>& geometry, int per_axis, ParticleGrid<T>& grid)
    : body_(reference, particles.volume),
      material_(particles.material),
      geometry_(geometry),
      per_axis_(per_axis),
      points_(bind_deformation<T>(map, {}, PointTables::none)),
      sample_count_(static_cast<int64_t>(samples.size())) {
  GridParticles readers;
  readers.particles = samples;
  readers.weight.assign(samples.size(), 0.0);
  readers.samples = sample_count_;
  grid.choose(readers);
  for (const int32_t s : samples)
    for (int d = 0; d < 3; ++d) sample_reference_.push_back(reference[static_cast<std::size_t>(3 * s + d)]);
  samples_ = bind_deformation<T>(map, sample_reference_);
  const std::size_t slots = samples_->all_tiles().size() * static_cast<std::size_t>(tile);
  sample_position_.resize(3 * slots);
  sample_velocity_.resize(3 * slots);
  sample_gradient_.resize(9 * slots);
  std::size_t cells = 1;
  for (int d = 0; d < 3; ++d) {
    cells_[d] = mpm::block_width * geometry_.blocks[d];
    cells *= static_cast<std::size_t>(cells_[d]);
  }
  stamp_.assign(cells, 0);
}

/// Points of all cells near a sample, each with the guess X = X_s + F_s^-1 (x - x_s).
template <typename T>
void EulerianQuadrature<T>::propose() {
  guesses_.clear();
  ++round_;
  const double dx = static_cast<double>(geometry_.dx);
  // Nearest sample first: cells one base cell away are taken before those two away.
  for (int ring = 0; ring <= stencil_reach; ++ring)
    for (int64_t s = 0; s < sample_count_; ++s) {
      const Vec3d x_s = vector_at(sample_position_, s), X_s = point_at(sample_reference_, s);
      const Mat<double, 3> to_reference = inverse(matrix_at(sample_gradient_, s));
      const Vec<int, 3> own = mpm::base_node(geometry_.local(x_s.template cast<T>()));
      for (int i = -ring; i <= ring; ++i)
        for (int j = -ring; j <= ring; ++j)
          for (int k = -ring; k <= ring; ++k) {
            if (std::max({std::abs(i), std::abs(j), std::abs(k)}) != ring) continue;
            const Vec<int, 3> cell = {own[0] + i, own[1] + j, own[2] + k};
            bool inside = true;
            for (int d = 0; d < 3; ++d) inside = inside && cell[d] >= 0 && cell[d] < cells_[d];
            if (!inside) continue;
            uint32_t& stamp = stamp_[(static_cast<std::size_t>(cell[0]) * static_cast<std::size_t>(cells_[1]) +
                                      static_cast<std::size_t>(cell[1])) *
                                         static_cast<std::size_t>(cells_[2]) +
                                     static_cast<std::size_t>(cell[2])];
            if (stamp == round_) continue;
            stamp = round_;
            for (int a = 0; a < per_axis_; ++a)
              for (int b = 0; b < per_axis_; ++b)
                for (int c = 0; c < per_axis_; ++c) {
                  const Vec3d within = Vec3d{a + 0.5, b + 0.5, c + 0.5} * (1.0 / per_axis_) + Vec3d::filled(0.5);
                  const Vec3d x =
                      geometry_.origin.template cast<double>() + dx * (cell.template cast<double>() + within);
                  const Vec3d X = X_s + to_reference * (x - x_s);
                  if (body_.near(X)) guesses_.push_back({x, X});
                }
          }
    }
}

/// Newton's method, X <- X - F^-1 (g(X, q) - x), for all points at once; those that are there, or lost, drop out.
template <typename T>
void EulerianQuadrature<T>::trace_back(const LatentState& state) {
  const double tolerance = newton_tolerance * static_cast<double>(geometry_.dx);
  found_.clear();
  for (int iteration = 0; iteration <= newton_iterations && !guesses_.empty(); ++iteration) {
    material_points_.clear();
    for (const Guess& guess : guesses_)
      for (int d = 0; d < 3; ++d) material_points_.push_back(static_cast<float>(guess.material_point[d]));
    points_->set_points(material_points_);
    const std::size_t slots = points_->all_tiles().size() * static_cast<std::size_t>(tile);
    position_.resize(3 * slots);
    velocity_.resize(3 * slots);
    gradient_.resize(9 * slots);
    points_->decode(state, points_->all_tiles(), position_.data(), velocity_.data(), gradient_.data());
    std::size_t open = 0;
    for (std::size_t i = 0; i < guesses_.size(); ++i) {
      const auto p = static_cast<int64_t>(i);
      const Vec3d X = point_at(material_points_, p), miss = vector_at(position_, p) - guesses_[i].place;
      const Mat<double, 3> F = matrix_at(gradient_, p);
      if (norm(miss) <= tolerance) {
        const int32_t particle = body_.particle_at(X);
        if (particle >= 0 && determinant(F) > 0)
          found_.push_back({guesses_[i].place, vector_at(velocity_, p), F, particle});
        continue;
      }
      const Vec3d next = X - inverse(F) * miss;
      if (body_.near(next)) guesses_[open++] = {guesses_[i].place, next};
    }
    guesses_.resize(open);
  }
}

template <typename T>
void EulerianQuadrature<T>::find(const LatentState& state, ParticleGrid<T>& grid) {
  samples_->decode(state, samples_->all_tiles(), sample_position_.data(), sample_velocity_.data(),
                   sample_gradient_.data());
  propose();
  trace_back(state);
  grid.resize_points(static_cast<int64_t>(found_.size()));
}

template <typename T>
void EulerianQuadrature<T>::fill(const LatentState&, ParticleGrid<T>& grid) {
  const mpm::ParticleView<T> p = grid.particles();
  for (int64_t s = 0; s < sample_count_; ++s) {
    p.position.set_vec(s, vector_at(sample_position_, s).template cast<T>());
    p.velocity.set_vec(s, vector_at(sample_velocity_, s).template cast<T>());
    mpm::store_matrix<T, 3>(p.deformation_gradient, s, matrix_at(sample_gradient_, s).template cast<T>());
    mpm::store_matrix<T, 3>(p.affine_velocity, s, Mat<T, 3>::zero());
  }
  const double volume = std::pow(static_cast<double>(geometry_.dx) / per_axis_, 3);
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const int64_t slot = sample_count_ + static_cast<int64_t>(i);
    const Point& point = found_[i];
    p.position.set_vec(slot, point.position.template cast<T>());
    p.velocity.set_vec(slot, point.velocity.template cast<T>());
    mpm::store_matrix<T, 3>(p.deformation_gradient, slot, point.gradient.template cast<T>());
    mpm::store_matrix<T, 3>(p.affine_velocity, slot, Mat<T, 3>::zero());
    p.volume.set(slot, static_cast<T>(volume / determinant(point.gradient)));
    p.material.set(slot, material_[static_cast<std::size_t>(point.particle)]);
    p.source_index.set(slot, point.particle);
  }
}

template <typename T>
int64_t EulerianQuadrature<T>::bytes() const {
  return body_.bytes() + samples_->bytes() + points_->bytes() +
         static_cast<int64_t>(stamp_.size() * sizeof(uint32_t) + guesses_.capacity() * sizeof(Guess) +
                              found_.capacity() * sizeof(Point) +
                              (position_.size() + velocity_.size() + gradient_.size()) * sizeof(T));
}

template class EulerianQuadrature<float>;
template class EulerianQuadrature<double>;

}  // namespace graupel::rom
