#include "rom/deformation/mlp_deformation.h"

#include <algorithm>
#include <utility>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "mpm/particles/particles.h"
#include "rom/networks/mlp_points.h"

namespace graupel::rom {

namespace {

using mpm::tile;

const std::vector<int> vector_order = {0, 1, 2};

/// (X, q) of points first .. first + count - 1.
Mlp::Rows inputs_of(const std::vector<float>& points, const double* latent, int latents, Eigen::Index first,
                    Eigen::Index count) {
  Mlp::Rows z(count, 3 + latents);
  for (Eigen::Index r = 0; r < count; ++r) {
    for (Eigen::Index d = 0; d < 3; ++d)
      z(r, d) = static_cast<double>(points[static_cast<std::size_t>(3 * (first + r) + d)]);
    for (int j = 0; j < latents; ++j) z(r, 3 + j) = latent[j];
  }
  return z;
}

template <typename T>
class BoundMlp final : public DeformationPoints<T> {
 public:
  BoundMlp(const MlpDeformation& map, const std::vector<float>& points)
      : map_(map), net_(map.displacement(), points, vector_order) {
    set_base(points);
  }

  void set_points(const std::vector<float>& points) override {
    net_.set_points(points);
    set_base(points);
  }
  void decode(const LatentState& state, const std::vector<int32_t>& tiles, T* position, T* velocity,
              T* gradient) override {
    evaluate(state, tiles, position, velocity, gradient);
    add(base_, 3, tiles, position);
    if (gradient != nullptr) add(base_gradient_, 9, tiles, gradient);
  }
  void positions(const LatentState& state, T* position) override {
    net_.evaluate(state.latent, position);
    add(base_, 3, net_.all_tiles(), position);
  }
  const std::vector<int32_t>& all_tiles() const override { return net_.all_tiles(); }
  int64_t bytes() const override {
    return net_.bytes() + static_cast<int64_t>((base_.size() + base_gradient_.size() + slopes_.size()) * sizeof(T));
  }

 private:
  void set_base(const std::vector<float>& points) {
    const std::size_t slots = net_.all_tiles().size() * static_cast<std::size_t>(tile);
    base_.assign(3 * slots, T(0));
    base_gradient_.assign(9 * slots, T(0));
    if (!map_.rest().empty()) {
      LatentState rest;
      rest.latent = map_.rest();
      rest.velocity.assign(rest.latent.size(), 0.0);
      std::vector<T> velocity(base_.size());
      evaluate(rest, net_.all_tiles(), base_.data(), velocity.data(), base_gradient_.data());
      for (T& u : base_) u = -u;
      for (T& f : base_gradient_) f = -f;
    }
    const mpm::TiledView<T, 3> base{base_.data()};
    const mpm::TiledView<T, 9> gradient{base_gradient_.data()};
    for (int64_t p = 0; p < net_.slots(); ++p)
      for (int d = 0; d < 3; ++d) {
        base.at(p)[d * tile] += static_cast<T>(points[static_cast<std::size_t>(3 * p + d)]);
        gradient.at(p)[4 * d * tile] += T(1);
      }
  }

  static void add(const std::vector<T>& base, int components, const std::vector<int32_t>& tiles, T* values) {
    const auto width = static_cast<std::size_t>(components * tile);
    for (std::size_t j = 0; j < tiles.size(); ++j)
      for (std::size_t i = 0; i < width; ++i)
        values[j * width + i] += base[static_cast<std::size_t>(tiles[j]) * width + i];
  }

  /// u, its velocity and du/dX.
  void evaluate(const LatentState& state, const std::vector<int32_t>& tiles, T* displacement, T* velocity,
                T* gradient) {
    const auto r = static_cast<Eigen::Index>(state.latent.size());
    const std::size_t width = 3 * static_cast<std::size_t>(tile) * tiles.size();
    const bool difference = state.last_step > 0;
    const Eigen::Index axes = gradient != nullptr ? 3 : 0;
    Mlp::Rows directions = Mlp::Rows::Zero(axes + (difference ? 0 : 1), 3 + r);
    slopes_.resize(3 * width);
    std::vector<T*> slopes;
    for (Eigen::Index k = 0; k < axes; ++k) {
      directions(k, k) = 1;
      slopes.push_back(slopes_.data() + static_cast<std::size_t>(k) * width);
    }
    if (!difference) {
      directions.row(axes).tail(r) = Eigen::Map<const Eigen::RowVectorXd>(state.velocity.data(), r);
      slopes.push_back(velocity);
    }
    net_.evaluate(state.latent, directions, tiles, displacement, slopes);
    if (difference) {
      net_.evaluate(state.previous, tiles, velocity);
      for (std::size_t i = 0; i < width; ++i)
        velocity[i] = (displacement[i] - velocity[i]) / static_cast<T>(state.last_step);
    }
    for (std::size_t t = 0; t < tiles.size() && axes > 0; ++t)
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 3; ++k)
          std::copy_n(slopes[k] + (3 * t + c) * static_cast<std::size_t>(tile), tile,
                      gradient + (9 * t + 3 * c + k) * static_cast<std::size_t>(tile));
  }

  const MlpDeformation& map_;
  MlpPoints<T> net_;
  std::vector<T> base_, base_gradient_;  ///< X + a(X) and its gradient, in tiles
  std::vector<T> slopes_;
};

class MlpSamples final : public SampleField {
 public:
  MlpSamples(const MlpDeformation& map, const std::vector<float>& points) : map_(map), points_(points) {
    base_ = Eigen::Map<const Eigen::VectorXf>(points_.data(), static_cast<Eigen::Index>(points_.size())).cast<double>();
    if (map.rest().empty()) return;
    Mlp::Rows u;
    map.displacement().evaluate(inputs_of(points_, map.rest().data(), map.latents(), 0, samples()), u);
    base_ -= Eigen::Map<const Eigen::VectorXd>(u.data(), u.size());
  }
  int samples() const override { return static_cast<int>(points_.size() / 3); }

  void evaluate(const double* latent, Eigen::VectorXd& position) const override {
    position.resize(base_.size());
    const auto points = [&](int64_t b) {
      const auto [first, count] = block_of(b);
      Mlp::Rows u;
      map_.displacement().evaluate(inputs_of(points_, latent, map_.latents(), first, count), u);
      position.segment(3 * first, 3 * count) =
          base_.segment(3 * first, 3 * count) + Eigen::Map<const Eigen::VectorXd>(u.data(), u.size());
    };
    parallel_for_cpu(blocks(), points, Grain{1});
  }
  void jacobian(const double* latent, Eigen::MatrixXd& jacobian) const override {
    jacobian.resize(base_.size(), map_.latents());
    const auto points = [&](int64_t b) {
      const auto [first, count] = block_of(b);
      Mlp::Rows u, slope;
      map_.displacement().evaluate(inputs_of(points_, latent, map_.latents(), first, count), u, slope);
      jacobian.middleRows(3 * first, 3 * count) = slope.rightCols(map_.latents());
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

  const MlpDeformation& map_;
  std::vector<float> points_;
  Eigen::VectorXd base_;  ///< X + a(X)
};

}  // namespace

MlpDeformation::MlpDeformation(Mlp displacement, std::vector<double> rest)
    : displacement_(std::move(displacement)), rest_(std::move(rest)) {
  GRAUPEL_ASSERT(displacement_.outputs() == 3 && latents() > 0);
  GRAUPEL_ASSERT(rest_.empty() || static_cast<int>(rest_.size()) == latents());
}

std::unique_ptr<DeformationPoints<float>> MlpDeformation::bind_f32(const std::vector<float>& points,
                                                                   PointTables) const {
  return std::make_unique<BoundMlp<float>>(*this, points);
}
std::unique_ptr<DeformationPoints<double>> MlpDeformation::bind_f64(const std::vector<float>& points,
                                                                    PointTables) const {
  return std::make_unique<BoundMlp<double>>(*this, points);
}
std::unique_ptr<SampleField> MlpDeformation::bind_samples(const std::vector<float>& points) const {
  return std::make_unique<MlpSamples>(*this, points);
}

}  // namespace graupel::rom
