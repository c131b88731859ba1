// A network's deformation map (NSF section 4.2, CROM section 4):
//   g(X, q) = X + u(X, q) + a(X),   a(X) = -u(X, q_0) where the body starts undeformed (CROM eqs. 24, 25), else 0.
#pragma once

#include <vector>

#include "rom/deformation/deformation.h"
#include "rom/networks/mlp.h"

namespace graupel::rom {

class MlpDeformation final : public Deformation {
 public:
  /// `displacement`: u of (X, q) [m]. `rest`: q_0 [r], in which the body is exactly the reference body; none: a = 0.
  explicit MlpDeformation(Mlp displacement, std::vector<double> rest = {});

  DeformationKind kind() const override { return DeformationKind::mlp; }
  int latents() const override { return displacement_.inputs() - 3; }
  std::unique_ptr<DeformationPoints<float>> bind_f32(const std::vector<float>& points,
                                                     PointTables tables) const override;
  std::unique_ptr<DeformationPoints<double>> bind_f64(const std::vector<float>& points,
                                                      PointTables tables) const override;
  std::unique_ptr<SampleField> bind_samples(const std::vector<float>& points) const override;
  void store(nn::Weights& weights) const override { displacement_.store(weights, "deformation"); }

  const Mlp& displacement() const { return displacement_; }
  const std::vector<double>& rest() const { return rest_; }

 private:
  Mlp displacement_;
  std::vector<double> rest_;
};

}  // namespace graupel::rom
