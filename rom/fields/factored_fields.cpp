#include "rom/fields/factored_fields.h"

#include <algorithm>
#include <utility>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "rom/fields/tiled_modes.h"

namespace graupel::rom {

namespace {

// Components of the stored stress in the order of mpm's arrays: xx, yy, zz, xy, xz, yz.
const std::vector<int> stress_order = {0, 3, 5, 1, 2, 4};
const std::vector<int> vector_order = {0, 1, 2};
const std::vector<int> matrix_order = {0, 1, 2, 3, 4, 5, 6, 7, 8};

/// Coefficients of the deformation's modes and their rates.
class Deformation {
 public:
  explicit Deformation(const ClosureBranch& from) : branch_(from) {}

  void update(const LatentState& state) {
    const auto m = static_cast<std::size_t>(branch_.count()), r = static_cast<std::size_t>(branch_.latents());
    if (state.latent != latent) {
      std::swap(before, a);
      std::swap(latent_before, latent);
      latent = state.latent;
      a.resize(m);
      branch_.coefficients(latent.data(), a.data());
    }
    rate.assign(m, 0.0);
    if (state.last_step > 0) {
      if (state.previous != latent_before) {
        latent_before = state.previous;
        before.resize(m);
        branch_.coefficients(latent_before.data(), before.data());
      }
      for (std::size_t k = 0; k < m; ++k) rate[k] = (a[k] - before[k]) / state.last_step;
      return;
    }
    std::vector<double> slope(m * r);
    branch_.jacobian(latent.data(), slope.data());
    for (std::size_t k = 0; k < m; ++k)
      for (std::size_t j = 0; j < r; ++j) rate[k] += slope[k * r + j] * state.velocity[j];
  }

  std::vector<double> a, rate;

 private:
  const ClosureBranch& branch_;
  std::vector<double> latent, latent_before, before;  ///< what a and the coefficients one step before belong to
};

std::vector<double> coefficients_of(const Branch& branch, const LatentState& state) {
  std::vector<double> a(static_cast<std::size_t>(branch.count()));
  branch.coefficients(state, a.data());
  return a;
}

constexpr Grain some_tiles{8};

template <typename T>
class FactoredPoints final : public PointFields<T> {
 public:
  FactoredPoints(const FactoredFields& fields, const std::vector<int32_t>& points)
      : fields_(fields), deformation_(fields.deformation_branch()) {
    position_.assign(fields.deformation(), points, vector_order);
    if (!fields.has_stress()) return;
    stress_.assign(fields.stress(), points, stress_order);
    affine_.assign(fields.affine(), points, matrix_order);
  }

  void decode(const LatentState& state, const std::vector<int32_t>& tiles,
              const mpm::ParticleView<T>& particles) override {
    deformation_.update(state);
    position_.set_coefficients(deformation_.a.data());
    position_.set_rates(deformation_.rate.data());
    const bool with_stress = particles.stress.data != nullptr;
    GRAUPEL_ASSERT(fields_.has_stress() || !with_stress);
    if (with_stress) {
      stress_.set_coefficients(coefficients_of(fields_.stress_branch(), state).data());
      affine_.set_coefficients(coefficients_of(fields_.affine_branch(), state).data());
    }
    const auto decode_tile = [&](int64_t to) {
      const int64_t from = tiles[static_cast<std::size_t>(to)], slot = to * mpm::tile;
      position_.evaluate(from, particles.position.at(slot), particles.velocity.at(slot));
      if (!with_stress) return;
      stress_.evaluate(from, particles.stress.at(slot));
      affine_.evaluate(from, particles.affine_velocity.at(slot));
    };
    parallel_for_cpu(static_cast<int64_t>(tiles.size()), decode_tile, some_tiles);
  }

  int64_t bytes() const override { return position_.bytes() + stress_.bytes() + affine_.bytes(); }

 private:
  const FactoredFields& fields_;
  Deformation deformation_;
  TiledModes<T> position_, stress_, affine_;
};

template <typename T>
class FactoredPositions final : public PointPositions<T> {
 public:
  FactoredPositions(const FactoredFields& fields, const std::vector<int32_t>& points)
      : deformation_(fields.deformation_branch()) {
    position_.assign(fields.deformation(), points, vector_order);
  }
  void decode(const LatentState& state, T* position) override {
    deformation_.update(state);
    position_.set_coefficients(deformation_.a.data());
    parallel_for_cpu(
        position_.tiles(), [&](int64_t t) { position_.evaluate(t, position + t * 3 * mpm::tile); }, some_tiles);
  }
  void decode(const LatentState& state, T* position, T* velocity) override {
    deformation_.update(state);
    position_.set_coefficients(deformation_.a.data());
    position_.set_rates(deformation_.rate.data());
    parallel_for_cpu(
        position_.tiles(),
        [&](int64_t t) { position_.evaluate(t, position + t * 3 * mpm::tile, velocity + t * 3 * mpm::tile); },
        some_tiles);
  }
  int64_t bytes() const override { return position_.bytes(); }

 private:
  Deformation deformation_;
  TiledModes<T> position_;
};

/// Rows of the samples in f64: few, and the inversion needs the digits. With J = U da/dq the normal equations follow
/// from the Gram matrix U^T W U, which changes by the few samples that do not count in full.
class FactoredSamples final : public SampleField {
 public:
  FactoredSamples(const FactoredFields& fields, const std::vector<int32_t>& samples)
      : branch_(fields.deformation_branch()) {
    const ModeTable& table = fields.deformation();
    const auto rows = static_cast<Eigen::Index>(3 * samples.size());
    mean_.resize(rows);
    basis_.resize(rows, table.modes);
    for (std::size_t s = 0; s < samples.size(); ++s) {
      const int64_t row = table.row_of(samples[s]);
      for (int c = 0; c < 3; ++c) {
        const auto to = static_cast<Eigen::Index>(3 * s) + c;
        const auto from = static_cast<std::size_t>(3 * row + c);
        mean_[to] = static_cast<double>(table.mean[from]);
        for (int k = 0; k < table.modes; ++k)
          basis_(to, k) = static_cast<double>(
              table.basis[from * static_cast<std::size_t>(table.modes) + static_cast<std::size_t>(k)]);
      }
    }
    gram_.noalias() = basis_.transpose() * basis_;
    slope_.resize(branch_.count(), branch_.latents());
  }
  int samples() const override { return static_cast<int>(mean_.size() / 3); }
  void evaluate(const double* latent, Eigen::VectorXd& position) const override {
    Eigen::VectorXd a(branch_.count());
    branch_.coefficients(latent, a.data());
    position.noalias() = mean_ + basis_ * a;
  }
  void jacobian(const double* latent, Eigen::MatrixXd& jacobian) const override {
    RowMajor slope(branch_.count(), branch_.latents());
    branch_.jacobian(latent, slope.data());
    jacobian.noalias() = basis_ * slope;
  }
  void linearise(const double* latent) override { branch_.jacobian(latent, slope_.data()); }
  void normal_equations(const std::vector<double>& weight, const Eigen::VectorXd& residual, Eigen::MatrixXd& normal,
                        Eigen::VectorXd& right) const override {
    Eigen::MatrixXd gram = gram_;
    Eigen::VectorXd weighted = residual;
    for (std::size_t s = 0; s < weight.size(); ++s) {
      if (weight[s] == 1) continue;
      const auto row = 3 * static_cast<Eigen::Index>(s);
      const auto sample = basis_.middleRows<3>(row);
      gram.noalias() -= sample.transpose() * ((1 - weight[s]) * sample);
      weighted.segment<3>(row) *= weight[s];
    }
    normal.noalias() = slope_.transpose() * (gram * slope_);
    right.noalias() = slope_.transpose() * (basis_.transpose() * weighted);
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const ClosureBranch& branch_;
  Eigen::VectorXd mean_;
  RowMajor basis_;        ///< U [3 samples, modes]
  Eigen::MatrixXd gram_;  ///< U^T U
  RowMajor slope_;        ///< da/dq where it was linearised
};

}  // namespace

FactoredFields::FactoredFields(ModeTable deformation, ClosureBranch deformation_branch, ModeTable stress,
                               MapBranch stress_branch, ModeTable affine, std::shared_ptr<const Branch> affine_branch)
    : deformation_(std::move(deformation)),
      stress_(std::move(stress)),
      affine_(std::move(affine)),
      deformation_branch_(std::move(deformation_branch)),
      stress_branch_(std::move(stress_branch)),
      affine_branch_(std::move(affine_branch)) {
  const BranchKind kind = deformation_branch_.map().kind();
  GRAUPEL_ASSERT(stress_branch_->map().kind() == kind && affine_branch_->map().kind() == kind);
}

std::unique_ptr<PointFields<float>> FactoredFields::bind_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<FactoredPoints<float>>(*this, points);
}
std::unique_ptr<PointFields<double>> FactoredFields::bind_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<FactoredPoints<double>>(*this, points);
}
std::unique_ptr<PointPositions<float>> FactoredFields::bind_positions_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<FactoredPositions<float>>(*this, points);
}
std::unique_ptr<PointPositions<double>> FactoredFields::bind_positions_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<FactoredPositions<double>>(*this, points);
}
std::unique_ptr<SampleField> FactoredFields::bind_samples(const std::vector<int32_t>& samples) const {
  return std::make_unique<FactoredSamples>(*this, samples);
}

FactoredFields::FactoredFields(ModeTable deformation, ClosureBranch deformation_branch)
    : deformation_(std::move(deformation)), deformation_branch_(std::move(deformation_branch)) {}

FactoredFields FactoredFields::clustered(const Clusters& clusters) const {
  if (!has_stress()) return *this;
  return {deformation_,    deformation_branch_,        stress_.averaged(clusters),
          *stress_branch_, affine_.averaged(clusters), affine_branch_};
}

std::shared_ptr<const Fields> FactoredFields::with_clusters(const Clusters& clusters) const {
  return std::make_shared<const FactoredFields>(clustered(clusters));
}

void FactoredFields::store(nn::Weights& weights, nn::DType modes) const {
  deformation_.store(weights, "deformation", modes);
  deformation_branch_.map().store(weights, "deformation.branch");
  weights.metadata["branch"] = word_of(deformation_branch_.map().kind());
  if (!has_stress()) return;
  stress_.store(weights, "stress", modes);
  affine_.store(weights, "affine", modes);
  stress_branch_->map().store(weights, "stress.branch");
  affine_branch_->map().store(weights, "affine.branch");
}

}  // namespace graupel::rom
