// Fields of a model that knows its deformation alone (CROM): the deformation gradient F = dg/dX is decoded beside
// position and velocity, and the material's own law gives the stress of it. The affine velocity is zero, as in PIC
// transfers.
#pragma once

#include <memory>
#include <vector>

#include "rom/deformation/deformation.h"
#include "rom/fields/fields.h"

namespace graupel::rom {

class DeformationFields final : public Fields {
 public:
  /// `reference`: X of all particles, [n, 3] [m].
  DeformationFields(std::vector<float> reference, std::shared_ptr<const Deformation> map);

  int latents() const override { return map_->latents(); }
  int64_t particles() const override { return static_cast<int64_t>(reference_.size()) / 3; }
  bool stress_follows_deformation() const override { return true; }
  std::unique_ptr<PointFields<float>> bind_f32(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointFields<double>> bind_f64(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointPositions<float>> bind_positions_f32(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointPositions<double>> bind_positions_f64(const std::vector<int32_t>& points) const override;
  std::unique_ptr<SampleField> bind_samples(const std::vector<int32_t>& samples) const override;
  std::unique_ptr<PointPositions<float>> bind_any_points(const std::vector<float>& points) const override;
  const char* kind() const override { return word_of(map_->kind()); }
  /// The map knows every point: the same fields.
  std::shared_ptr<const Fields> with_clusters(const Clusters& clusters) const override;
  void store(nn::Weights& weights, nn::DType modes) const override;
  /// A network or modes, as the file has it; `rest` as theirs. Throws InputError as Mlp::load and
  /// ModeDeformation::load.
  static std::shared_ptr<const DeformationFields> load(const nn::Weights& weights, int latents,
                                                       std::vector<float> reference, std::vector<double> rest);

  const Deformation& deformation() const { return *map_; }

 private:
  std::vector<float> reference_;
  std::shared_ptr<const Deformation> map_;
};

}  // namespace graupel::rom
