// Modes of a deformation at points that change or are decoded seldom: the modes are summed on their lattice, once for a
// state, and points are interpolated there. The work of a point does not depend on the number of modes, and nothing is
// kept of it but X.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/parallel/parallel_for.h"
#include "mpm/bspline.h"
#include "mpm/particles/particles.h"
#include "rom/deformation/mode_deformation.h"

namespace graupel::rom {

template <typename T>
class LatticePoints final : public DeformationPoints<T> {
 public:
  LatticePoints(const ModeDeformation& map, const std::vector<float>& points) : map_(map) { set_points(points); }

  void set_points(const std::vector<float>& points) override {
    points_ = points;
    all_tiles_.resize(static_cast<std::size_t>(mpm::padded_to_tile(count()) / mpm::tile));
    std::iota(all_tiles_.begin(), all_tiles_.end(), 0);
  }
  void decode(const LatentState& state, const std::vector<int32_t>& tiles, T* position, T* velocity,
              T* gradient) override {
    sum_modes(map_.away_from_rest(state), displacement_);
    sum_modes(map_.rate_of(state), rate_);
    each_point(tiles, [&](const Stencil& at, const Vec<T, 3>& X, int64_t slot) {
      Mat<T, 3> slope;
      Vec<T, 3> u;
      at.evaluate(displacement_.nodes, u, gradient == nullptr ? nullptr : &slope);
      mpm::TiledView<T, 3>{position}.set_vec(slot, X + u);
      if (gradient != nullptr) mpm::store_matrix<T, 3>({gradient}, slot, Mat<T, 3>::identity() + slope);
      at.evaluate(rate_.nodes, u, nullptr);
      mpm::TiledView<T, 3>{velocity}.set_vec(slot, u);
    });
  }
  void positions(const LatentState& state, T* position) override {
    sum_modes(map_.away_from_rest(state), displacement_);
    each_point(all_tiles_, [&](const Stencil& at, const Vec<T, 3>& X, int64_t slot) {
      Vec<T, 3> u;
      at.evaluate(displacement_.nodes, u, nullptr);
      mpm::TiledView<T, 3>{position}.set_vec(slot, X + u);
    });
  }
  const std::vector<int32_t>& all_tiles() const override { return all_tiles_; }
  int64_t bytes() const override {
    return static_cast<int64_t>(points_.capacity() * sizeof(float) +
                                (displacement_.nodes.size() + rate_.nodes.size()) * sizeof(T));
  }

 private:
  /// sum_k factor_k u_k at every node, [nodes, 3].
  struct NodeSum {
    std::vector<double> factor;
    std::vector<T> nodes;
  };
  /// Nodes and weights of a point, axis by axis.
  struct Stencil {
    const ModeLattice& lattice;
    int base[3];
    T weight[3][3], slope[3][3];  ///< slope [1/m]

    Stencil(const ModeLattice& of, const float* X) : lattice(of) {
      for (int d = 0; d < 3; ++d) {
        const double u = (static_cast<double>(X[d]) - of.low[d]) / of.spacing;
        base[d] = mode_base(of, d, u);
        const auto fx = static_cast<T>(u - base[d]);
        const mpm::AxisWeights<T> axis = mpm::bspline_weights(fx);
        std::copy_n(axis.w, 3, weight[d]);
        const auto per_metre = static_cast<T>(1 / of.spacing);
        slope[d][0] = (fx - T(1.5)) * per_metre;
        slope[d][1] = (2 - 2 * fx) * per_metre;
        slope[d][2] = (fx - T(0.5)) * per_metre;
      }
    }
    /// Value, and row by row its derivative unless that is null.
    void evaluate(const std::vector<T>& nodes, Vec<T, 3>& value, Mat<T, 3>* derivative) const {
      value = Vec<T, 3>::zero();
      if (derivative != nullptr) *derivative = Mat<T, 3>::zero();
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const T* const row = nodes.data() + 3 * lattice.node(base[0] + i, base[1] + j, base[2]);
          const T w = weight[0][i] * weight[1][j];
          for (int c = 0; c < 3; ++c) {
            const T along = weight[2][0] * row[c] + weight[2][1] * row[3 + c] + weight[2][2] * row[6 + c];
            value[c] += w * along;
            if (derivative == nullptr) continue;
            (*derivative)(c, 0) += slope[0][i] * weight[1][j] * along;
            (*derivative)(c, 1) += weight[0][i] * slope[1][j] * along;
            (*derivative)(c, 2) += w * (slope[2][0] * row[c] + slope[2][1] * row[3 + c] + slope[2][2] * row[6 + c]);
          }
        }
    }
  };

  int64_t count() const { return static_cast<int64_t>(points_.size() / 3); }

  template <typename Body>
  void each_point(const std::vector<int32_t>& tiles, const Body& body) const {
    const auto one_tile = [&](int64_t j) {
      const int64_t first = int64_t(tiles[static_cast<std::size_t>(j)]) * mpm::tile;
      for (int64_t i = 0; i < std::min<int64_t>(mpm::tile, count() - first); ++i) {
        const float* const X = points_.data() + 3 * (first + i);
        body(Stencil(map_.lattice(), X), Vec<T, 3>{T(X[0]), T(X[1]), T(X[2])}, j * mpm::tile + i);
      }
    };
    parallel_for_cpu(static_cast<int64_t>(tiles.size()), one_tile, Grain{64});
  }
  void sum_modes(std::vector<double> factor, NodeSum& sum) const {
    if (factor == sum.factor) return;
    const auto width = static_cast<std::size_t>(3 * map_.lattice().nodes());
    sum.nodes.resize(width);
    constexpr std::size_t part = 3072;
    const auto some_nodes = [&](int64_t at) {
      const std::size_t first = static_cast<std::size_t>(at) * part, end = std::min(width, first + part);
      std::fill(sum.nodes.begin() + static_cast<std::ptrdiff_t>(first),
                sum.nodes.begin() + static_cast<std::ptrdiff_t>(end), T(0));
      for (std::size_t k = 0; k < factor.size(); ++k) {
        const float* const mode = map_.nodes().data() + k * width;
        const auto f = static_cast<T>(factor[k]);
        for (std::size_t i = first; i < end; ++i) sum.nodes[i] += f * static_cast<T>(mode[i]);
      }
    };
    parallel_for_cpu(static_cast<int64_t>((width + part - 1) / part), some_nodes, Grain{1});
    sum.factor = std::move(factor);
  }

  const ModeDeformation& map_;
  std::vector<float> points_;
  std::vector<int32_t> all_tiles_;
  NodeSum displacement_, rate_;
};

}  // namespace graupel::rom
