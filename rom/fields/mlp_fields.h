// The paper's fields (NSF sections 4.2 and 4.3): a network each for the displacement u(X, q) = g(X, q) - X, the
// Kirchhoff stress h(X, q, mu) and the affine velocity l(X, q), the last with mu where the training gave it. The parity
// form of the factored fields, at 10^5 to 10^6 operations a particle.
#pragma once

#include "rom/deformation/mlp_deformation.h"
#include "rom/fields/fields.h"

namespace graupel::rom {

class MlpFields final : public Fields {
 public:
  /// `reference`: X of all particles, [n, 3] [m]. Stress: xx, xy, xz, yy, yz, zz [Pa]; affine velocity row by row
  /// [1/s].
  MlpFields(int latents, std::vector<float> reference, Mlp displacement, Mlp stress, Mlp affine);

  int latents() const override { return latents_; }
  int64_t particles() const override { return static_cast<int64_t>(reference_.size()) / 3; }
  std::unique_ptr<PointFields<float>> bind_f32(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointFields<double>> bind_f64(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointPositions<float>> bind_positions_f32(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointPositions<double>> bind_positions_f64(const std::vector<int32_t>& points) const override;
  std::unique_ptr<SampleField> bind_samples(const std::vector<int32_t>& samples) const override;
  const char* kind() const override { return word_of(FieldKind::mlp); }
  /// Networks know every point: the same fields.
  std::shared_ptr<const Fields> with_clusters(const Clusters& clusters) const override;
  void store(nn::Weights& weights, nn::DType modes) const override;
  /// Throws InputError, as Mlp::load, and for networks whose inputs do not fit the latents and parameters.
  static std::shared_ptr<const MlpFields> load(const nn::Weights& weights, int latents, int parameters,
                                               std::vector<float> reference);

  const MlpDeformation& deformation() const { return deformation_; }
  const Mlp& stress() const { return stress_; }
  const Mlp& affine() const { return affine_; }
  /// X of some particles, [points, 3] [m].
  std::vector<float> reference_of(const std::vector<int32_t>& points) const;

 private:
  int latents_;
  std::vector<float> reference_;
  MlpDeformation deformation_;
  Mlp stress_, affine_;
};

}  // namespace graupel::rom
