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
      points_(bind_deformation<T>(map, {})),
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
  place_.clear();
  material_point_.clear();
  ++round_;
  const double dx = static_cast<double>(geometry_.dx);
  // Nearest sample first: cells one base cell away are taken before those two away.
  for (int ring = 0; ring <= stencil_reach; ++ring)
    for (int64_t s = 0; s < sample_count_; ++s) {
      const Vec3d x_s = vector_at(sample_position_, s);
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
                  const Vec3d guess = to_reference * (x - x_s);
                  place_.push_back(x);
                  for (int d = 0; d < 3; ++d)
                    material_point_.push_back(sample_reference_[static_cast<std::size_t>(3 * s + d)] +
                                              static_cast<float>(guess[d]));
                }
          }
    }
}

/// Newton's method for all points at once, X <- X - F^-1 (g(X, q) - x).
template <typename T>
void EulerianQuadrature<T>::trace_back(const LatentState& state) {
  const double tolerance = newton_tolerance * static_cast<double>(geometry_.dx);
  const auto n = static_cast<int64_t>(place_.size());
  std::vector<uint8_t> found(place_.size(), 0);
  for (int iteration = 0; iteration <= newton_iterations; ++iteration) {
    points_->set_points(material_point_);
    const std::size_t slots = points_->all_tiles().size() * static_cast<std::size_t>(tile);
    position_.resize(3 * slots);
    velocity_.resize(3 * slots);
    gradient_.resize(9 * slots);
    points_->decode(state, points_->all_tiles(), position_.data(), velocity_.data(), gradient_.data());
    bool all = true;
    for (int64_t p = 0; p < n; ++p) {
      const auto i = static_cast<std::size_t>(p);
      const Vec3d miss = vector_at(position_, p) - place_[i];
      found[i] = norm(miss) <= tolerance;
      if (found[i]) continue;
      all = false;
      if (iteration == newton_iterations) continue;
      const Vec3d way = inverse(matrix_at(gradient_, p)) * miss;
      for (int d = 0; d < 3; ++d)
        if (std::isfinite(way[d])) material_point_[3 * i + static_cast<std::size_t>(d)] -= static_cast<float>(way[d]);
    }
    if (all) break;
  }
  kept_.clear();
  particle_.clear();
  for (int64_t p = 0; p < n; ++p) {
    const auto i = static_cast<std::size_t>(p);
    if (!found[i] || !(determinant(matrix_at(gradient_, p)) > 0)) continue;
    Vec3d X;
    for (int d = 0; d < 3; ++d) X[d] = static_cast<double>(material_point_[3 * i + static_cast<std::size_t>(d)]);
    const int32_t nearest = body_.particle_at(X);
    if (nearest < 0) continue;
    kept_.push_back(p);
    particle_.push_back(nearest);
  }
}

template <typename T>
void EulerianQuadrature<T>::find(const LatentState& state, ParticleGrid<T>& grid) {
  samples_->decode(state, samples_->all_tiles(), sample_position_.data(), sample_velocity_.data(),
                   sample_gradient_.data());
  propose();
  trace_back(state);
  grid.resize_points(static_cast<int64_t>(kept_.size()));
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
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    const int64_t slot = sample_count_ + static_cast<int64_t>(i);
    const Mat<double, 3> F = matrix_at(gradient_, kept_[i]);
    p.position.set_vec(slot, place_[static_cast<std::size_t>(kept_[i])].template cast<T>());
    p.velocity.set_vec(slot, vector_at(velocity_, kept_[i]).template cast<T>());
    mpm::store_matrix<T, 3>(p.deformation_gradient, slot, F.template cast<T>());
    mpm::store_matrix<T, 3>(p.affine_velocity, slot, Mat<T, 3>::zero());
    p.volume.set(slot, static_cast<T>(volume / determinant(F)));
    p.material.set(slot, material_[static_cast<std::size_t>(particle_[i])]);
    p.source_index.set(slot, particle_[i]);
  }
}

template <typename T>
int64_t EulerianQuadrature<T>::bytes() const {
  return body_.bytes() + samples_->bytes() + points_->bytes() +
         static_cast<int64_t>(stamp_.size() * sizeof(uint32_t) + place_.size() * sizeof(Vec3d) +
                              (position_.size() + velocity_.size() + gradient_.size()) * sizeof(T));
}

template class EulerianQuadrature<float>;
template class EulerianQuadrature<double>;

}  // namespace graupel::rom
