#include "train/reduced/crom/reconstruction.h"

#include <cmath>
#include <vector>

#include "mpm/particles/particles.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

/// Sums of squares of errors and of what they are compared with.
struct Squares {
  double error = 0, size = 0;
  void add(double got, double want, double compared) {
    error += (got - want) * (got - want);
    size += compared * compared;
  }
  double relative() const { return size > 0 ? std::sqrt(error / size) : 0; }
};

/// Component c of particle p in tiles.
double in_tiles(const std::vector<double>& values, std::size_t components, std::size_t p, std::size_t c) {
  constexpr auto tile = static_cast<std::size_t>(mpm::tile);
  return values[(p / tile * components + c) * tile + p % tile];
}

std::vector<double> row_of(const MatrixXd& m, Index row) {
  std::vector<double> values;
  for (Index j = 0; j < m.cols(); ++j) values.push_back(m(row, j));
  return values;
}

/// Decodes snapshots and adds up their errors.
class Reconstruction {
 public:
  Reconstruction(const rom::Deformation& map, const SnapshotSet& set) : set_(set) {
    for (const Vec3f& x : set.reference()) reference_.insert(reference_.end(), x.a, x.a + 3);
    points_ = bind_deformation<double>(map, reference_, rom::PointTables::none);
    const std::size_t slots = points_->all_tiles().size() * static_cast<std::size_t>(mpm::tile);
    position_.resize(3 * slots);
    velocity_.resize(3 * slots);
    gradient_.resize(9 * slots);
  }

  void add(int64_t snapshot, bool last, std::vector<double> latent, std::vector<double> rate) {
    rom::LatentState state;
    state.latent = std::move(latent);
    state.velocity = std::move(rate);
    points_->decode(state, points_->all_tiles(), position_.data(), velocity_.data(), gradient_.data());
    const std::vector<float> x = set_.read(SnapshotField::position, snapshot),
                             f = set_.read(SnapshotField::deformation_gradient, snapshot);
    for (std::size_t p = 0; p < x.size() / 3; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        const auto want = static_cast<double>(x[3 * p + c]);
        position.add(in_tiles(position_, 3, p, c), want, want);
        displacement.add(in_tiles(position_, 3, p, c), want, want - static_cast<double>(reference_[3 * p + c]));
      }
      for (std::size_t c = 0; c < 9; ++c) {
        const auto want = static_cast<double>(f[9 * p + c]);
        gradient.add(in_tiles(gradient_, 9, p, c), want, want - (c % 4 == 0 ? 1 : 0));
      }
    }
    if (last) return;
    const std::vector<float> next = set_.read(SnapshotField::position, snapshot + 1);
    for (std::size_t p = 0; p < x.size() / 3; ++p)
      for (std::size_t c = 0; c < 3; ++c) {
        const double want = static_cast<double>(next[3 * p + c] - x[3 * p + c]) / set_.frame_time();
        velocity.add(in_tiles(velocity_, 3, p, c), want, want);
      }
  }

  Squares position, displacement, gradient, velocity;

 private:
  const SnapshotSet& set_;
  std::vector<float> reference_;
  std::unique_ptr<rom::DeformationPoints<double>> points_;
  std::vector<double> position_, velocity_, gradient_;
};

}  // namespace

MatrixXd latent_rates(const SnapshotSet& set, const MatrixXd& latents) {
  MatrixXd rates = MatrixXd::Zero(latents.rows(), latents.cols());
  for (int run = 0; run < set.runs(); ++run)
    for (int64_t i = set.first_snapshot(run); i + 1 < set.first_snapshot(run + 1); ++i)
      rates.row(i) = (latents.row(i + 1) - latents.row(i)) / set.frame_time();
  return rates;
}

ReconstructionErrors reconstruction_errors(const rom::Deformation& map, const SnapshotSet& set, const MatrixXd& latents,
                                           int64_t stride) {
  Reconstruction sums(map, set);
  const MatrixXd rates = latent_rates(set, latents);
  for (int run = 0; run < set.runs(); ++run)
    for (int64_t i = set.first_snapshot(run); i < set.first_snapshot(run + 1); ++i)
      if (i % stride == 0) sums.add(i, i + 1 == set.first_snapshot(run + 1), row_of(latents, i), row_of(rates, i));
  return {sums.position.relative(), sums.displacement.relative(), sums.gradient.relative(), sums.velocity.relative()};
}

}  // namespace graupel::train
