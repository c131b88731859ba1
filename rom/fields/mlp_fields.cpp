#include "rom/fields/mlp_fields.h"

#include <utility>

#include "core/system/error.h"
#include "rom/fields/branch.h"
#include "rom/fields/deformed_positions.h"
#include "rom/networks/mlp_points.h"

namespace graupel::rom {

namespace {

// As in factored_fields.cpp: the stored stress in the order of mpm's arrays, xx, yy, zz, xy, xz, yz.
const std::vector<int> stress_order = {0, 3, 5, 1, 2, 4};
const std::vector<int> matrix_order = {0, 1, 2, 3, 4, 5, 6, 7, 8};

template <typename T>
class MlpFieldPoints final : public PointFields<T> {
 public:
  MlpFieldPoints(const MlpFields& fields, const std::vector<int32_t>& points)
      : deformation_(bind_deformation<T>(fields.deformation(), fields.reference_of(points))),
        stress_(fields.stress(), fields.reference_of(points), stress_order),
        affine_(fields.affine(), fields.reference_of(points), matrix_order),
        stress_inputs_(fields.stress().inputs() - 3),
        affine_inputs_(fields.affine().inputs() - 3) {}

  void decode(const LatentState& state, const std::vector<int32_t>& tiles,
              const mpm::ParticleView<T>& particles) override {
    deformation_->decode(state, tiles, particles.position.data, particles.velocity.data, nullptr);
    stress_.evaluate(map_input(state, stress_inputs_), tiles, particles.stress.data);
    affine_.evaluate(map_input(state, affine_inputs_), tiles, particles.affine_velocity.data);
  }
  int64_t bytes() const override { return deformation_->bytes() + stress_.bytes() + affine_.bytes(); }

 private:
  std::unique_ptr<DeformationPoints<T>> deformation_;
  MlpPoints<T> stress_, affine_;
  int stress_inputs_, affine_inputs_;
};

}  // namespace

MlpFields::MlpFields(int latents, std::vector<float> reference, Mlp displacement, Mlp stress, Mlp affine)
    : latents_(latents),
      reference_(std::move(reference)),
      deformation_(std::move(displacement)),
      stress_(std::move(stress)),
      affine_(std::move(affine)) {
  GRAUPEL_ASSERT(deformation_.latents() == latents);
  GRAUPEL_ASSERT(stress_.inputs() >= 3 + latents && stress_.outputs() == 6);
  GRAUPEL_ASSERT(affine_.inputs() >= 3 + latents && affine_.outputs() == 9);
}

std::vector<float> MlpFields::reference_of(const std::vector<int32_t>& points) const {
  return points_of(reference_, points);
}

std::unique_ptr<PointFields<float>> MlpFields::bind_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<MlpFieldPoints<float>>(*this, points);
}
std::unique_ptr<PointFields<double>> MlpFields::bind_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<MlpFieldPoints<double>>(*this, points);
}
std::unique_ptr<PointPositions<float>> MlpFields::bind_positions_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<DeformedPositions<float>>(deformation_, reference_of(points));
}
std::unique_ptr<PointPositions<double>> MlpFields::bind_positions_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<DeformedPositions<double>>(deformation_, reference_of(points));
}
std::unique_ptr<SampleField> MlpFields::bind_samples(const std::vector<int32_t>& samples) const {
  return deformation_.bind_samples(reference_of(samples));
}

std::shared_ptr<const Fields> MlpFields::with_clusters(const Clusters&) const {
  return std::make_shared<const MlpFields>(*this);
}

void MlpFields::store(nn::Weights& weights, nn::DType) const {
  deformation_.displacement().store(weights, "deformation");
  stress_.store(weights, "stress");
  affine_.store(weights, "affine");
}

std::shared_ptr<const MlpFields> MlpFields::load(const nn::Weights& weights, int latents, int parameters,
                                                 std::vector<float> reference) {
  const int all = 3 + latents + parameters;
  const int affine_inputs = mlp_inputs(weights, "affine") == 3 + latents ? 3 + latents : all;
  return std::make_shared<const MlpFields>(
      latents, std::move(reference), Mlp::load(weights, "deformation", 3 + latents, 3),
      Mlp::load(weights, "stress", all, 6), Mlp::load(weights, "affine", affine_inputs, 9));
}

}  // namespace graupel::rom
