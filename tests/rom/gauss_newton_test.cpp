// Inversion of a deformation field: recovers a known latent, in spite of samples that are lost.
#include "rom/projection/gauss_newton.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"

namespace graupel::rom {
namespace {

/// Positions that bend with the latent: B_s (q + 0.2 q_0^2).
class BentField final : public SampleField {
 public:
  BentField(int samples, int latents) : samples_(samples), basis_(3 * samples, latents) {
    const Random random(5, RandomPurpose::test);
    for (Eigen::Index i = 0; i < basis_.size(); ++i)
      basis_.data()[i] = random.uniform(static_cast<uint64_t>(i), 0, -1, 1);
  }
  int samples() const override { return samples_; }
  void evaluate(const double* q, Eigen::VectorXd& x) const override {
    Eigen::VectorXd a = Eigen::Map<const Eigen::VectorXd>(q, basis_.cols());
    a.array() += 0.2 * q[0] * q[0];
    x = basis_ * a;
  }
  void jacobian(const double* q, Eigen::MatrixXd& j) const override {
    j = basis_;
    j.col(0) += 0.4 * q[0] * basis_.rowwise().sum();
  }

 private:
  int samples_;
  Eigen::MatrixXd basis_;
};

const Eigen::VectorXd truth = (Eigen::VectorXd(4) << 0.5, -0.3, 0.8, 0.1).finished();

TEST(GaussNewton, RecoversALatent) {
  BentField field(30, 4);
  Eigen::VectorXd target, latent = Eigen::VectorXd::Zero(4);
  field.evaluate(truth.data(), target);
  const FitReport report = fit_latent(field, target, {}, {.iterations = 10}, latent);
  EXPECT_LT((latent - truth).norm(), 1e-10);
  EXPECT_LT(report.distance, 1e-10);
  EXPECT_GT(report.condition, 1);
}

TEST(GaussNewton, OneLinearisationLeadsToTheSameLatentWhereTheWayIsShort) {
  BentField field(30, 4);
  Eigen::VectorXd target, latent = truth.array() + 1e-3;
  field.evaluate(truth.data(), target);
  fit_latent(field, target, {}, {.iterations = 4, .linearisation = Linearisation::once}, latent);
  EXPECT_LT((latent - truth).norm(), 1e-10);
}

TEST(GaussNewton, LostSamplesDoNotCount) {
  BentField field(60, 4);
  Eigen::VectorXd target, latent = Eigen::VectorXd::Zero(4);
  field.evaluate(truth.data(), target);
  target.segment<3>(30).array() += 5;
  target.segment<3>(90).array() += std::nan("");
  std::vector<double> weight(60, 1);
  weight[10] = weight[30] = 0;
  const FitReport report = fit_latent(field, target, weight, {.iterations = 10}, latent);
  EXPECT_LT((latent - truth).norm(), 1e-10);
  EXPECT_DOUBLE_EQ(report.down_weighted, 2.0 / 60);
}

TEST(GaussNewton, StopsWhenMostSamplesAreLost) {
  BentField field(10, 4);
  Eigen::VectorXd target, latent = truth;
  field.evaluate(truth.data(), target);
  EXPECT_THROW(fit_latent(field, target, std::vector<double>(10, 0), {}, latent), DivergedError);
}

}  // namespace
}  // namespace graupel::rom
