// Factored fields, f(X; s) = mean(X) + sum_k W_k(X) a_k(s): spatial modes (POD of the training runs) times coefficients
// that a small branch gives once a step. A particle then costs one multiplication a mode and component, where the
// paper's networks take some 10^5 to 10^6 (docs/reference/reduced-order.md).
#pragma once

#include <optional>

#include "rom/fields/branch.h"
#include "rom/fields/fields.h"
#include "rom/fields/mode_table.h"

namespace graupel::rom {

class FactoredFields final : public Fields {
 public:
  /// The branches are of one kind.
  FactoredFields(ModeTable deformation, ClosureBranch deformation_branch, ModeTable stress, MapBranch stress_branch,
                 ModeTable affine, std::shared_ptr<const Branch> affine_branch);
  /// Deformation alone, for models whose points follow the material's law (GradientKind::integrated).
  FactoredFields(ModeTable deformation, ClosureBranch deformation_branch);
  /// The same fields with the means of stress and affine velocity over these clusters at their representatives; so far
  /// they must be known at all particles.
  FactoredFields clustered(const Clusters& clusters) const;

  bool has_stress() const { return stress_branch_.has_value(); }  ///< and affine velocity
  int latents() const override { return deformation_branch_.latents(); }
  int64_t particles() const override { return deformation_.rows(); }
  std::unique_ptr<PointFields<float>> bind_f32(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointFields<double>> bind_f64(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointPositions<float>> bind_positions_f32(const std::vector<int32_t>& points) const override;
  std::unique_ptr<PointPositions<double>> bind_positions_f64(const std::vector<int32_t>& points) const override;
  std::unique_ptr<SampleField> bind_samples(const std::vector<int32_t>& samples) const override;

  const char* kind() const override { return word_of(FieldKind::factored); }
  std::shared_ptr<const Fields> with_clusters(const Clusters& clusters) const override;
  void store(nn::Weights& weights, nn::DType modes) const override;

  const ModeTable& deformation() const { return deformation_; }  ///< mean: positions [m]
  const ModeTable& stress() const { return stress_; }            ///< xx, xy, xz, yy, yz, zz [Pa]
  const ModeTable& affine() const { return affine_; }            ///< row by row [1/s]
  const ClosureBranch& deformation_branch() const { return deformation_branch_; }
  const MapBranch& stress_branch() const { return *stress_branch_; }
  const Branch& affine_branch() const { return *affine_branch_; }

 private:
  ModeTable deformation_, stress_, affine_;
  ClosureBranch deformation_branch_;
  std::optional<MapBranch> stress_branch_;
  std::shared_ptr<const Branch> affine_branch_;
};

}  // namespace graupel::rom
