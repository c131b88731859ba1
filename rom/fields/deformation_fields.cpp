#include "rom/fields/deformation_fields.h"

#include <algorithm>
#include <utility>

#include "rom/deformation/mlp_deformation.h"
#include "rom/deformation/mode_deformation.h"
#include "rom/fields/deformed_positions.h"

namespace graupel::rom {

namespace {

template <typename T>
class DeformedPoints final : public PointFields<T> {
 public:
  DeformedPoints(const Deformation& map, const std::vector<float>& points)
      : deformation_(bind_deformation<T>(map, points)) {}

  void decode(const LatentState& state, const std::vector<int32_t>& tiles,
              const mpm::ParticleView<T>& particles) override {
    deformation_->decode(state, tiles, particles.position.data, particles.velocity.data,
                         particles.deformation_gradient.data);
    if (particles.stress.data == nullptr) return;
    const std::size_t slots = tiles.size() * static_cast<std::size_t>(mpm::tile);
    std::fill_n(particles.affine_velocity.data, 9 * slots, T(0));
    std::fill_n(particles.stress.data, 6 * slots, T(0));
  }
  int64_t bytes() const override { return deformation_->bytes(); }

 private:
  std::unique_ptr<DeformationPoints<T>> deformation_;
};

}  // namespace

DeformationFields::DeformationFields(std::vector<float> reference, std::shared_ptr<const Deformation> map)
    : reference_(std::move(reference)), map_(std::move(map)) {}

std::unique_ptr<PointFields<float>> DeformationFields::bind_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<DeformedPoints<float>>(*map_, points_of(reference_, points));
}
std::unique_ptr<PointFields<double>> DeformationFields::bind_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<DeformedPoints<double>>(*map_, points_of(reference_, points));
}
std::unique_ptr<PointPositions<float>> DeformationFields::bind_positions_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<DeformedPositions<float>>(*map_, points_of(reference_, points));
}
std::unique_ptr<PointPositions<double>> DeformationFields::bind_positions_f64(
    const std::vector<int32_t>& points) const {
  return std::make_unique<DeformedPositions<double>>(*map_, points_of(reference_, points));
}
std::unique_ptr<SampleField> DeformationFields::bind_samples(const std::vector<int32_t>& samples) const {
  return map_->bind_samples(points_of(reference_, samples));
}

std::unique_ptr<PointPositions<float>> DeformationFields::bind_any_points(const std::vector<float>& points) const {
  return std::make_unique<DeformedPositions<float>>(*map_, points, PointTables::none);
}

std::shared_ptr<const Fields> DeformationFields::with_clusters(const Clusters&) const {
  return std::make_shared<const DeformationFields>(*this);
}

void DeformationFields::store(nn::Weights& weights, nn::DType) const { map_->store(weights); }

std::shared_ptr<const DeformationFields> DeformationFields::load(const nn::Weights& weights, int latents,
                                                                 std::vector<float> reference,
                                                                 std::vector<double> rest) {
  std::shared_ptr<const Deformation> map;
  if (ModeDeformation::is_in(weights))
    map = std::make_shared<const ModeDeformation>(ModeDeformation::load(weights, std::move(rest)));
  else
    map = std::make_shared<const MlpDeformation>(Mlp::load(weights, "deformation", 3 + latents, 3), std::move(rest));
  return std::make_shared<const DeformationFields>(std::move(reference), std::move(map));
}

}  // namespace graupel::rom
