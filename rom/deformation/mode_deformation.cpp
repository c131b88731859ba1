#include "rom/deformation/mode_deformation.h"

#include <fmt/format.h>

#include <utility>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "mpm/particles/particles.h"
#include "rom/deformation/lattice_points.h"

namespace graupel::rom {

namespace {

using mpm::tile;

constexpr auto slots_of_tile = static_cast<std::size_t>(tile);

/// Tables of numbers that are summed over modes, [tiles, modes, components, 16].
template <typename T>
class ModeTable {
 public:
  ModeTable(std::size_t modes, std::size_t components) : modes_(modes), components_(components) {}

  /// `fill`(stencil, mode, component) of every point.
  template <typename Fill>
  void build(const ModeLattice& lattice, const std::vector<float>& points, const Fill& fill) {
    const std::size_t n = points.size() / 3, tiles = (n + slots_of_tile - 1) / slots_of_tile;
    values_.assign(tiles * modes_ * components_ * slots_of_tile, T(0));
    const auto one_tile = [&](int64_t j) {
      const auto first = static_cast<std::size_t>(j) * slots_of_tile;
      for (std::size_t p = first; p < std::min(n, first + slots_of_tile); ++p) {
        const ModeStencil stencil(lattice, point_of(points, static_cast<int64_t>(p)));
        for (std::size_t k = 0; k < modes_; ++k)
          fill(stencil, k,
               values_.data() + (static_cast<std::size_t>(j) * modes_ + k) * components_ * slots_of_tile +
                   p % slots_of_tile);
      }
    };
    parallel_for_cpu(static_cast<int64_t>(tiles), one_tile, Grain{1});
  }
  /// values [components, 16] += sum_k factor_k u_k of a tile.
  void add(const std::vector<T>& factor, std::size_t of_tile, T* values) const {
    const std::size_t width = components_ * slots_of_tile;
    const T* u = values_.data() + of_tile * modes_ * width;
    for (std::size_t k = 0; k < modes_; ++k, u += width)
      for (std::size_t i = 0; i < width; ++i) values[i] += factor[k] * u[i];
  }
  bool empty() const { return values_.empty(); }
  void clear() { values_.clear(); }
  int64_t bytes() const { return static_cast<int64_t>(values_.size() * sizeof(T)); }

 private:
  std::size_t modes_, components_;
  std::vector<T> values_;
};

template <typename T>
std::vector<T> rounded(const std::vector<double>& values) {
  return {values.begin(), values.end()};
}

template <typename T>
class BoundModes final : public DeformationPoints<T> {
 public:
  BoundModes(const ModeDeformation& map, const std::vector<float>& points)
      : map_(map),
        displacement_(static_cast<std::size_t>(map.latents()), 3),
        gradient_(static_cast<std::size_t>(map.latents()), 9) {
    set_points(points);
  }

  void set_points(const std::vector<float>& points) override {
    points_ = points;
    displacement_.build(map_.lattice(), points_, [&](const ModeStencil& stencil, std::size_t k, T* u) {
      const Vec3d value = map_.mode(stencil, static_cast<int>(k));
      for (int c = 0; c < 3; ++c) u[c * tile] = static_cast<T>(value[c]);
    });
    gradient_.clear();
    const std::size_t tiles = (points_.size() / 3 + slots_of_tile - 1) / slots_of_tile;
    all_tiles_.resize(tiles);
    reference_.assign(3 * slots_of_tile * tiles, T(0));
    for (std::size_t j = 0; j < tiles; ++j) all_tiles_[j] = static_cast<int32_t>(j);
    const mpm::TiledView<T, 3> reference{reference_.data()};
    for (std::size_t p = 0; p < points_.size() / 3; ++p)
      for (int d = 0; d < 3; ++d)
        reference.at(static_cast<int64_t>(p))[d * tile] = static_cast<T>(points_[3 * p + static_cast<std::size_t>(d)]);
  }

  void decode(const LatentState& state, const std::vector<int32_t>& tiles, T* position, T* velocity,
              T* gradient) override {
    if (gradient != nullptr && gradient_.empty()) build_gradient();
    const std::vector<T> factor = rounded<T>(map_.away_from_rest(state)), rate = rounded<T>(map_.rate_of(state));
    const auto one_tile = [&](int64_t at) {
      const auto j = static_cast<std::size_t>(at), of = static_cast<std::size_t>(tiles[j]);
      T* const x = position + 3 * slots_of_tile * j;
      std::copy_n(reference_.data() + 3 * slots_of_tile * of, 3 * slots_of_tile, x);
      displacement_.add(factor, of, x);
      T* const v = velocity + 3 * slots_of_tile * j;
      std::fill_n(v, 3 * slots_of_tile, T(0));
      displacement_.add(rate, of, v);
      if (gradient == nullptr) return;
      T* const F = gradient + 9 * slots_of_tile * j;
      for (std::size_t c = 0; c < 9; ++c) std::fill_n(F + c * slots_of_tile, slots_of_tile, c % 4 == 0 ? T(1) : T(0));
      gradient_.add(factor, of, F);
    };
    parallel_for_cpu(static_cast<int64_t>(tiles.size()), one_tile, Grain{16});
  }

  void positions(const LatentState& state, T* position) override {
    const std::vector<T> factor = rounded<T>(map_.away_from_rest(state));
    const auto one_tile = [&](int64_t at) {
      const auto j = static_cast<std::size_t>(at);
      T* const x = position + 3 * slots_of_tile * j;
      std::copy_n(reference_.data() + 3 * slots_of_tile * j, 3 * slots_of_tile, x);
      displacement_.add(factor, j, x);
    };
    parallel_for_cpu(static_cast<int64_t>(all_tiles_.size()), one_tile, Grain{16});
  }
  const std::vector<int32_t>& all_tiles() const override { return all_tiles_; }
  int64_t bytes() const override {
    return displacement_.bytes() + gradient_.bytes() + static_cast<int64_t>(reference_.size() * sizeof(T));
  }

 private:
  void build_gradient() {
    gradient_.build(map_.lattice(), points_, [&](const ModeStencil& stencil, std::size_t k, T* slope) {
      const Mat3d sum = map_.mode_slope(stencil, static_cast<int>(k));
      for (int c = 0; c < 9; ++c) slope[c * tile] = static_cast<T>(sum(c / 3, c % 3));
    });
  }
  const ModeDeformation& map_;
  std::vector<float> points_;
  std::vector<int32_t> all_tiles_;
  std::vector<T> reference_;              ///< X in tiles
  ModeTable<T> displacement_, gradient_;  ///< the latter once it is asked for
};

class ModeSamples final : public SampleField {
 public:
  ModeSamples(const ModeDeformation& map, const std::vector<float>& points)
      : slope_(static_cast<Eigen::Index>(points.size()), map.latents()) {
    for (std::size_t p = 0; p < points.size() / 3; ++p) {
      const ModeStencil stencil(map.lattice(), point_of(points, static_cast<int64_t>(p)));
      for (int k = 0; k < map.latents(); ++k) {
        const Vec3d u = map.mode(stencil, k);
        for (int c = 0; c < 3; ++c) slope_(3 * static_cast<Eigen::Index>(p) + c, k) = u[c];
      }
    }
    const Eigen::Map<const Eigen::VectorXd> rest(map.rest().data(), map.latents());
    base_ = Eigen::Map<const Eigen::VectorXf>(points.data(), slope_.rows()).cast<double>() - slope_ * rest;
  }

  int samples() const override { return static_cast<int>(base_.size() / 3); }
  void evaluate(const double* latent, Eigen::VectorXd& position) const override {
    position = base_;
    position.noalias() += slope_ * Eigen::Map<const Eigen::VectorXd>(latent, slope_.cols());
  }
  void jacobian(const double*, Eigen::MatrixXd& jacobian) const override { jacobian = slope_; }

 private:
  Eigen::MatrixXd slope_;  ///< dg/dq, the same for every latent
  Eigen::VectorXd base_;   ///< g(X, 0)
};

template <typename T>
std::unique_ptr<DeformationPoints<T>> bind(const ModeDeformation& map, const std::vector<float>& points,
                                           PointTables tables) {
  if (tables == PointTables::none) return std::make_unique<LatticePoints<T>>(map, points);
  return std::make_unique<BoundModes<T>>(map, points);
}

}  // namespace

ModeDeformation::ModeDeformation(ModeLattice lattice, std::vector<float> nodes, std::vector<double> rest)
    : lattice_(lattice), nodes_(std::move(nodes)), rest_(std::move(rest)) {
  GRAUPEL_ASSERT(!rest_.empty());
  GRAUPEL_ASSERT(nodes_.size() == rest_.size() * static_cast<std::size_t>(3 * lattice_.nodes()));
}

Vec3d ModeDeformation::mode(const ModeStencil& stencil, int k) const {
  const float* const nodes = nodes_.data() + 3 * k * lattice_.nodes();
  Vec3d u = Vec3d::zero();
  for (int n = 0; n < mode_stencil; ++n)
    for (int c = 0; c < 3; ++c) u[c] += stencil.weight[n] * static_cast<double>(nodes[3 * stencil.node[n] + c]);
  return u;
}

Mat3d ModeDeformation::mode_slope(const ModeStencil& stencil, int k) const {
  const float* const nodes = nodes_.data() + 3 * k * lattice_.nodes();
  Mat3d slope = Mat3d::zero();
  for (int n = 0; n < mode_stencil; ++n)
    for (int c = 0; c < 3; ++c)
      for (int d = 0; d < 3; ++d)
        slope(c, d) += stencil.gradient[n][d] * static_cast<double>(nodes[3 * stencil.node[n] + c]);
  return slope;
}

std::unique_ptr<DeformationPoints<float>> ModeDeformation::bind_f32(const std::vector<float>& points,
                                                                    PointTables tables) const {
  return bind<float>(*this, points, tables);
}
std::unique_ptr<DeformationPoints<double>> ModeDeformation::bind_f64(const std::vector<float>& points,
                                                                     PointTables tables) const {
  return bind<double>(*this, points, tables);
}

std::vector<double> ModeDeformation::away_from_rest(const LatentState& state) const {
  std::vector<double> factor = state.latent;
  for (std::size_t k = 0; k < factor.size(); ++k) factor[k] -= rest_[k];
  return factor;
}

std::vector<double> ModeDeformation::rate_of(const LatentState& state) {
  if (state.last_step <= 0) return state.velocity;
  std::vector<double> rate = state.latent;
  for (std::size_t k = 0; k < rate.size(); ++k) rate[k] = (rate[k] - state.previous[k]) / state.last_step;
  return rate;
}
std::unique_ptr<SampleField> ModeDeformation::bind_samples(const std::vector<float>& points) const {
  return std::make_unique<ModeSamples>(*this, points);
}

void ModeDeformation::store(nn::Weights& weights) const {
  const std::vector<float> place = {static_cast<float>(lattice_.low[0]), static_cast<float>(lattice_.low[1]),
                                    static_cast<float>(lattice_.low[2]), static_cast<float>(lattice_.spacing)};
  weights.tensors["modes.lattice"] = nn::Tensor::from_float(place, {4});
  weights.tensors["modes.nodes"] =
      nn::Tensor::from_float(nodes_, {latents(), lattice_.count[0], lattice_.count[1], lattice_.count[2], 3});
}

bool ModeDeformation::is_in(const nn::Weights& weights) { return weights.tensors.count("modes.nodes") > 0; }

ModeDeformation ModeDeformation::load(const nn::Weights& weights, std::vector<double> rest) {
  const std::vector<float> place = weights.get("modes.lattice", {4});
  const nn::Tensor& tensor = weights.tensors.at("modes.nodes");
  ModeLattice lattice;
  bool fits = tensor.shape.size() == 5 && tensor.shape[0] == static_cast<int64_t>(rest.size()) &&
              tensor.shape[4] == 3 && place[3] > 0;
  for (std::size_t d = 0; d < 3 && fits; ++d) fits = tensor.shape[1 + d] >= 3 && tensor.shape[1 + d] <= 100000;
  if (!fits)
    throw InputError(
        fmt::format("'{}' has modes that do not fit its {} latents or their lattice ('modes.nodes' must be [latents, "
                    "at least 3, at "
                    "least 3, at least 3, 3], the spacing in 'modes.lattice' above 0). Train the model again",
                    weights.file, rest.size()));
  for (int d = 0; d < 3; ++d) {
    lattice.low[d] = static_cast<double>(place[static_cast<std::size_t>(d)]);
    lattice.count[d] = static_cast<int>(tensor.shape[static_cast<std::size_t>(1 + d)]);
  }
  lattice.spacing = static_cast<double>(place[3]);
  return {lattice, weights.get("modes.nodes", tensor.shape), std::move(rest)};
}

}  // namespace graupel::rom
