#include "rom/factored_fields.h"

#include <algorithm>
#include <utility>

namespace graupel::rom {

namespace {

// Components of the stored stress in the order of mpm's arrays: xx, yy, zz, xy, xz, yz.
const std::vector<int> stress_order = {0, 3, 5, 1, 2, 4};
const std::vector<int> vector_order = {0, 1, 2};
const std::vector<int> matrix_order = {0, 1, 2, 3, 4, 5, 6, 7, 8};

/// Coefficients of the deformation's modes and their rates, in the precision of the modes.
template <typename T>
struct Deformation {
  explicit Deformation(const ClosureBranch& from) : branch(from) {}

  void update(const LatentState& state) {
    const auto m = static_cast<std::size_t>(branch.count()), r = static_cast<std::size_t>(branch.latents());
    std::vector<double> value(m), slope(m * r);
    if (state.last_step > 0) {
      std::vector<double> before = state.latent, old(m);
      for (std::size_t j = 0; j < r; ++j) before[j] -= state.last_step * state.velocity[j];
      branch.coefficients(state.latent.data(), value.data());
      branch.coefficients(before.data(), old.data());
      a.assign(value.begin(), value.end());
      rate.resize(m);
      for (std::size_t k = 0; k < m; ++k) rate[k] = static_cast<T>((value[k] - old[k]) / state.last_step);
      return;
    }
    branch.coefficients(state.latent.data(), value.data());
    branch.jacobian(state.latent.data(), slope.data());
    a.assign(value.begin(), value.end());
    rate.assign(m, T(0));
    for (std::size_t k = 0; k < m; ++k) {
      double sum = 0;
      for (std::size_t j = 0; j < r; ++j) sum += slope[k * r + j] * state.velocity[j];
      rate[k] = static_cast<T>(sum);
    }
  }

  const ClosureBranch& branch;
  std::vector<T> a, rate;
};

template <typename T>
std::vector<T> coefficients_of(const Branch& branch, const LatentState& state) {
  std::vector<double> a(static_cast<std::size_t>(branch.count()));
  branch.coefficients(state, a.data());
  return {a.begin(), a.end()};
}

template <typename T>
class FactoredPoints final : public PointFields<T> {
 public:
  FactoredPoints(const FactoredFields& fields, const std::vector<int32_t>& points)
      : fields_(fields), deformation_(fields.deformation_branch()) {
    position_.assign(fields.deformation(), points, vector_order);
    stress_.assign(fields.stress(), points, stress_order);
    affine_.assign(fields.affine(), points, matrix_order);
  }

  void decode(const LatentState& state, const mpm::ParticleView<T>& particles) override {
    deformation_.update(state);
    const std::vector<T> stress = coefficients_of<T>(fields_.stress_branch(), state),
                         affine = coefficients_of<T>(fields_.affine_branch(), state);
    position_.evaluate(deformation_.a.data(), deformation_.rate.data(), particles.position.data,
                       particles.velocity.data);
    stress_.evaluate(stress.data(), particles.stress.data);
    affine_.evaluate(affine.data(), particles.affine_velocity.data);
  }

  int64_t bytes() const override { return position_.bytes() + stress_.bytes() + affine_.bytes(); }

 private:
  const FactoredFields& fields_;
  Deformation<T> deformation_;
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
    position_.evaluate(deformation_.a.data(), position);
  }
  void decode(const LatentState& state, T* position, T* velocity) override {
    deformation_.update(state);
    position_.evaluate(deformation_.a.data(), deformation_.rate.data(), position, velocity);
  }
  int64_t bytes() const override { return position_.bytes(); }

 private:
  Deformation<T> deformation_;
  TiledModes<T> position_;
};

/// Rows of the samples in f64: few, and the inversion needs the digits.
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
  }
  int samples() const override { return static_cast<int>(mean_.size() / 3); }
  void evaluate(const double* latent, Eigen::VectorXd& position) const override {
    Eigen::VectorXd a(branch_.count());
    branch_.coefficients(latent, a.data());
    position.noalias() = mean_ + basis_ * a;
  }
  void jacobian(const double* latent, Eigen::MatrixXd& jacobian) const override {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> slope(branch_.count(), branch_.latents());
    branch_.jacobian(latent, slope.data());
    jacobian.noalias() = basis_ * slope;
  }

 private:
  const ClosureBranch& branch_;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd basis_;
};

}  // namespace

FactoredFields::FactoredFields(ModeTable deformation, ClosureBranch deformation_branch, ModeTable stress,
                               MapBranch stress_branch, ModeTable affine, std::shared_ptr<const Branch> affine_branch)
    : deformation_(std::move(deformation)),
      stress_(std::move(stress)),
      affine_(std::move(affine)),
      deformation_branch_(std::move(deformation_branch)),
      stress_branch_(std::move(stress_branch)),
      affine_branch_(std::move(affine_branch)) {}

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

FactoredFields FactoredFields::clustered(const Clusters& clusters) const {
  return {deformation_,   deformation_branch_,        stress_.averaged(clusters),
          stress_branch_, affine_.averaged(clusters), affine_branch_};
}

}  // namespace graupel::rom
