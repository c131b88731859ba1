#include "rom/sample_rules.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "core/random.h"

namespace graupel::rom {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<int32_t> random_samples(std::vector<int32_t> candidates, std::size_t count, uint64_t seed) {
  const Random random(seed, RandomPurpose::sample_particle);
  for (std::size_t i = candidates.size() - 1; i > 0; --i)
    std::swap(candidates[i], candidates[random.integer(i, 0, static_cast<uint32_t>(i + 1))]);
  candidates.resize(count);
  return candidates;
}

std::vector<int32_t> spread_samples(const std::vector<int32_t>& candidates, std::size_t count) {
  std::vector<int32_t> samples;
  for (std::size_t i = 0; i < count; ++i) samples.push_back(candidates[i * candidates.size() / count]);
  return samples;
}

std::vector<int32_t> patched_samples(const std::vector<int32_t>& candidates, std::size_t count) {
  constexpr std::size_t patch = 16;
  const std::size_t patches = (count + patch - 1) / patch;
  std::vector<int32_t> samples;
  for (std::size_t i = 0; i < patches; ++i) {
    // The patch in the middle of its part of the order.
    const std::size_t part = candidates.size() / patches, size = std::min(patch, count - i * patch),
                      first = i * candidates.size() / patches + (part - std::min(part, size)) / 2;
    for (std::size_t j = 0; j < size; ++j) samples.push_back(candidates[first + j]);
  }
  return samples;
}

std::vector<int32_t> optimal_samples(const ModeTable& table, const std::vector<int32_t>& candidates,
                                     std::size_t count) {
  const auto m = static_cast<Eigen::Index>(table.modes), n = static_cast<Eigen::Index>(candidates.size());
  RowMajor u(3 * n, m);
  for (Eigen::Index i = 0; i < n; ++i) {
    const int64_t row = table.row_of(candidates[static_cast<std::size_t>(i)]);
    const float* from = table.basis.data() + 3 * row * table.modes;
    for (Eigen::Index k = 0; k < 3 * m; ++k) u.data()[3 * i * m + k] = static_cast<double>(from[k]);
  }
  Eigen::MatrixXd design = 1e-3 / static_cast<double>(n) * (u.transpose() * u);
  design.diagonal().array() += 1e-12 * design.trace();
  Eigen::MatrixXd inverse = design.llt().solve(Eigen::MatrixXd::Identity(m, m));
  std::vector<bool> taken(candidates.size(), false);
  std::vector<int32_t> samples;
  RowMajor shaped(3 * n, m);
  while (samples.size() < count) {
    shaped.noalias() = u * inverse;
    double most = -1;
    Eigen::Index best = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (taken[static_cast<std::size_t>(i)]) continue;
      const Eigen::Matrix3d information = shaped.middleRows<3>(3 * i) * u.middleRows<3>(3 * i).transpose();
      const double gain = (Eigen::Matrix3d::Identity() + information).determinant();
      if (gain <= most) continue;
      most = gain;
      best = i;
    }
    taken[static_cast<std::size_t>(best)] = true;
    samples.push_back(candidates[static_cast<std::size_t>(best)]);
    // (A + U^T U)^-1 = A^-1 - A^-1 U^T (I + U A^-1 U^T)^-1 U A^-1
    const Eigen::Matrix<double, 3, Eigen::Dynamic> row = shaped.middleRows<3>(3 * best);
    const Eigen::Matrix3d middle = Eigen::Matrix3d::Identity() + row * u.middleRows<3>(3 * best).transpose();
    inverse.noalias() -= row.transpose() * middle.inverse() * row;
  }
  return samples;
}

}  // namespace

std::vector<int32_t> points_within(const std::vector<int32_t>& points, const std::vector<float>& reference,
                                   const Vec3d& low, const Vec3d& high) {
  std::vector<int32_t> inside;
  for (const int32_t point : points) {
    bool is_inside = true;
    for (int d = 0; d < 3; ++d) {
      const auto x = static_cast<double>(reference[static_cast<std::size_t>(3 * point + d)]);
      is_inside = is_inside && x >= low[d] && x <= high[d];
    }
    if (is_inside) inside.push_back(point);
  }
  return inside;
}

std::vector<int32_t> choose_samples(SampleRule rule, const ModeTable& deformation,
                                    const std::vector<int32_t>& candidates, int64_t count, uint64_t seed) {
  const auto n = std::min(static_cast<std::size_t>(count), candidates.size());
  std::vector<int32_t> samples = rule == SampleRule::random    ? random_samples(candidates, n, seed)
                                 : rule == SampleRule::spread  ? spread_samples(candidates, n)
                                 : rule == SampleRule::patches ? patched_samples(candidates, n)
                                                               : optimal_samples(deformation, candidates, n);
  std::sort(samples.begin(), samples.end());
  return samples;
}

}  // namespace graupel::rom
