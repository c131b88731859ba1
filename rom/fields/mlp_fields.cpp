#include "rom/fields/mlp_fields.h"

#include <algorithm>
#include <utility>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "rom/fields/branch.h"
#include "rom/fields/mlp_points.h"

namespace graupel::rom {

namespace {

// As in factored_fields.cpp: the stored stress in the order of mpm's arrays, xx, yy, zz, xy, xz, yz.
const std::vector<int> stress_order = {0, 3, 5, 1, 2, 4};
const std::vector<int> vector_order = {0, 1, 2};
const std::vector<int> matrix_order = {0, 1, 2, 3, 4, 5, 6, 7, 8};

/// (X_p, q) of points first .. first + count - 1.
Mlp::Rows inputs_of(const std::vector<float>& reference, const double* latent, int latents, Eigen::Index first,
                    Eigen::Index count) {
  Mlp::Rows z(count, 3 + latents);
  for (Eigen::Index r = 0; r < count; ++r) {
    for (Eigen::Index d = 0; d < 3; ++d)
      z(r, d) = static_cast<double>(reference[static_cast<std::size_t>(3 * (first + r) + d)]);
    for (int j = 0; j < latents; ++j) z(r, 3 + j) = latent[j];
  }
  return z;
}

/// g and its velocity at some points.
template <typename T>
class MlpPositions final : public PointPositions<T> {
 public:
  MlpPositions(const MlpFields& fields, const std::vector<int32_t>& points)
      : fields_(fields),
        reference_(fields.reference_of(points)),
        net_(fields.displacement(), reference_, vector_order) {}

  void decode(const LatentState& state, T* position) override {
    net_.evaluate(state.latent, position);
    add_reference(net_.all_tiles(), position);
  }
  void decode(const LatentState& state, T* position, T* velocity) override {
    decode(state, net_.all_tiles(), position, velocity);
  }
  /// Some tiles, as PointFields. The velocity is the difference of displacements over the last step, as in the paper
  /// (docs/decisions/0008).
  void decode(const LatentState& state, const std::vector<int32_t>& tiles, T* position, T* velocity) {
    net_.evaluate(state.latent, tiles, position);
    if (state.last_step > 0) {
      before_.resize(3 * static_cast<std::size_t>(mpm::tile) * tiles.size());
      net_.evaluate(state.previous, tiles, before_.data());
      for (std::size_t i = 0; i < before_.size(); ++i)
        velocity[i] = (position[i] - before_[i]) / static_cast<T>(state.last_step);
    } else {
      tangent(state, tiles, velocity);
    }
    add_reference(tiles, position);
  }
  int64_t bytes() const override {
    return net_.bytes() + static_cast<int64_t>(reference_.size() * sizeof(float) + before_.size() * sizeof(T));
  }

 private:
  /// Slots of a tile that are points.
  int64_t points_in(int32_t tile) const { return std::min(mpm::tile, net_.slots() - tile * mpm::tile); }

  void add_reference(const std::vector<int32_t>& tiles, T* position) const {
    const mpm::TiledView<T, 3> view{position};
    for (std::size_t j = 0; j < tiles.size(); ++j)
      for (int64_t l = 0; l < points_in(tiles[j]); ++l)
        for (int d = 0; d < 3; ++d)
          view.at(static_cast<int64_t>(j) * mpm::tile + l)[d * mpm::tile] +=
              static_cast<T>(reference_[static_cast<std::size_t>(3 * (tiles[j] * mpm::tile + l) + d)]);
  }

  /// dg/dq q', at the start of a run.
  void tangent(const LatentState& state, const std::vector<int32_t>& tiles, T* velocity) const {
    const auto r = static_cast<Eigen::Index>(state.latent.size());
    const Eigen::Map<const Eigen::VectorXd> rate(state.velocity.data(), r);
    std::fill_n(velocity, 3 * static_cast<std::size_t>(mpm::tile) * tiles.size(), T(0));
    const mpm::TiledView<T, 3> view{velocity};
    const auto points = [&](int64_t j) {
      const int32_t tile = tiles[static_cast<std::size_t>(j)];
      Mlp::Rows u, slope;
      fields_.displacement().evaluate(
          inputs_of(reference_, state.latent.data(), static_cast<int>(r), tile * mpm::tile, points_in(tile)), u, slope);
      const Eigen::VectorXd v = slope.rightCols(r) * rate;
      for (Eigen::Index i = 0; i < u.rows(); ++i)
        view.set_vec(j * mpm::tile + i,
                     {static_cast<T>(v[3 * i]), static_cast<T>(v[3 * i + 1]), static_cast<T>(v[3 * i + 2])});
    };
    parallel_for_cpu(static_cast<int64_t>(tiles.size()), points, Grain{1});
  }

  const MlpFields& fields_;
  std::vector<float> reference_;
  MlpPoints<T> net_;
  std::vector<T> before_;
};

template <typename T>
class MlpFieldPoints final : public PointFields<T> {
 public:
  MlpFieldPoints(const MlpFields& fields, const std::vector<int32_t>& points)
      : positions_(fields, points),
        stress_(fields.stress(), fields.reference_of(points), stress_order),
        affine_(fields.affine(), fields.reference_of(points), matrix_order),
        stress_inputs_(fields.stress().inputs() - 3),
        affine_inputs_(fields.affine().inputs() - 3) {}

  void decode(const LatentState& state, const std::vector<int32_t>& tiles,
              const mpm::ParticleView<T>& particles) override {
    positions_.decode(state, tiles, particles.position.data, particles.velocity.data);
    stress_.evaluate(map_input(state, stress_inputs_), tiles, particles.stress.data);
    affine_.evaluate(map_input(state, affine_inputs_), tiles, particles.affine_velocity.data);
  }
  int64_t bytes() const override { return positions_.bytes() + stress_.bytes() + affine_.bytes(); }

 private:
  MlpPositions<T> positions_;
  MlpPoints<T> stress_, affine_;
  int stress_inputs_, affine_inputs_;
};

class MlpSamples final : public SampleField {
 public:
  MlpSamples(const MlpFields& fields, const std::vector<int32_t>& samples)
      : fields_(fields), reference_(fields.reference_of(samples)) {}
  int samples() const override { return static_cast<int>(reference_.size() / 3); }

  void evaluate(const double* latent, Eigen::VectorXd& position) const override {
    position.resize(static_cast<Eigen::Index>(reference_.size()));
    const auto points = [&](int64_t b) {
      const auto [first, count] = block_of(b);
      Mlp::Rows u;
      fields_.displacement().evaluate(inputs_of(reference_, latent, fields_.latents(), first, count), u);
      for (Eigen::Index i = 0; i < 3 * count; ++i)
        position[3 * first + i] =
            static_cast<double>(reference_[static_cast<std::size_t>(3 * first + i)]) + u.data()[i];
    };
    parallel_for_cpu(blocks(), points, Grain{1});
  }
  void jacobian(const double* latent, Eigen::MatrixXd& jacobian) const override {
    jacobian.resize(static_cast<Eigen::Index>(reference_.size()), fields_.latents());
    const auto points = [&](int64_t b) {
      const auto [first, count] = block_of(b);
      Mlp::Rows u, slope;
      fields_.displacement().evaluate(inputs_of(reference_, latent, fields_.latents(), first, count), u, slope);
      jacobian.middleRows(3 * first, 3 * count) = slope.rightCols(fields_.latents());
    };
    parallel_for_cpu(blocks(), points, Grain{1});
  }

 private:
  /// Of 16: few samples should keep all threads busy.
  static constexpr Eigen::Index few = 16;
  int64_t blocks() const { return (samples() + few - 1) / few; }
  std::pair<Eigen::Index, Eigen::Index> block_of(int64_t b) const {
    return {b * few, std::min<Eigen::Index>(few, samples() - b * few)};
  }

  const MlpFields& fields_;
  std::vector<float> reference_;
};

}  // namespace

MlpFields::MlpFields(int latents, std::vector<float> reference, Mlp displacement, Mlp stress, Mlp affine)
    : latents_(latents),
      reference_(std::move(reference)),
      displacement_(std::move(displacement)),
      stress_(std::move(stress)),
      affine_(std::move(affine)) {
  GRAUPEL_ASSERT(displacement_.inputs() == 3 + latents && displacement_.outputs() == 3);
  GRAUPEL_ASSERT(stress_.inputs() >= 3 + latents && stress_.outputs() == 6);
  GRAUPEL_ASSERT(affine_.inputs() >= 3 + latents && affine_.outputs() == 9);
}

std::vector<float> MlpFields::reference_of(const std::vector<int32_t>& points) const {
  std::vector<float> x;
  x.reserve(3 * points.size());
  for (const int32_t p : points)
    x.insert(x.end(), reference_.begin() + 3 * static_cast<std::ptrdiff_t>(p),
             reference_.begin() + 3 * static_cast<std::ptrdiff_t>(p) + 3);
  return x;
}

std::unique_ptr<PointFields<float>> MlpFields::bind_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<MlpFieldPoints<float>>(*this, points);
}
std::unique_ptr<PointFields<double>> MlpFields::bind_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<MlpFieldPoints<double>>(*this, points);
}
std::unique_ptr<PointPositions<float>> MlpFields::bind_positions_f32(const std::vector<int32_t>& points) const {
  return std::make_unique<MlpPositions<float>>(*this, points);
}
std::unique_ptr<PointPositions<double>> MlpFields::bind_positions_f64(const std::vector<int32_t>& points) const {
  return std::make_unique<MlpPositions<double>>(*this, points);
}
std::unique_ptr<SampleField> MlpFields::bind_samples(const std::vector<int32_t>& samples) const {
  return std::make_unique<MlpSamples>(*this, samples);
}

std::shared_ptr<const Fields> MlpFields::with_clusters(const Clusters&) const {
  return std::make_shared<const MlpFields>(*this);
}

void MlpFields::store(nn::Weights& weights, nn::DType) const {
  displacement_.store(weights, "deformation");
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
