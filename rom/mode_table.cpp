#include "rom/mode_table.h"

#include <algorithm>
#include <cmath>

#include "core/parallel_for.h"
#include "rom/tensors.h"

namespace graupel::rom {

using mpm::tile;

int64_t ModeTable::row_of(int32_t point) const {
  const auto at = std::lower_bound(points.begin(), points.end(), point);
  return at == points.end() || *at != point ? -1 : at - points.begin();
}

ModeTable ModeTable::averaged(const Clusters& clusters) const {
  ModeTable means;
  means.components = components;
  means.modes = modes;
  const std::vector<int32_t> chosen = clusters.representatives();
  means.points = chosen;
  std::sort(means.points.begin(), means.points.end());
  std::vector<std::size_t> row(chosen.size());  // of every cluster
  for (std::size_t c = 0; c < chosen.size(); ++c) row[c] = static_cast<std::size_t>(means.row_of(chosen[c]));
  std::vector<float> members(chosen.size(), 0);
  for (const int32_t cluster : clusters.of_particle) members[static_cast<std::size_t>(cluster)] += 1;
  const auto average = [&](const std::vector<float>& values, std::size_t width) {
    std::vector<float> sums(chosen.size() * width, 0);
    for (std::size_t p = 0; p < clusters.of_particle.size(); ++p) {
      const auto cluster = static_cast<std::size_t>(clusters.of_particle[p]);
      const auto from = static_cast<std::size_t>(row_of(static_cast<int32_t>(p)));
      for (std::size_t k = 0; k < width; ++k)
        sums[row[cluster] * width + k] += values[from * width + k] / members[cluster];
    }
    return sums;
  };
  means.mean = average(mean, static_cast<std::size_t>(components));
  means.basis = average(basis, static_cast<std::size_t>(components) * static_cast<std::size_t>(modes));
  return means;
}

ModeTable ModeTable::load(const nn::Weights& weights, const std::string& prefix, int components) {
  ModeTable table;
  table.components = components;
  table.points = get_indices(weights, prefix + ".points");
  table.modes = static_cast<int>(extent(weights, prefix + ".amplitude", 0));
  const int64_t rows = table.rows();
  const std::vector<float> amplitude = weights.get(prefix + ".amplitude", {table.modes});
  table.mean = weights.get(prefix + ".mean", {rows, components});
  table.basis = weights.get(prefix + ".basis", {rows, components, table.modes});
  for (std::size_t i = 0; i < table.basis.size(); ++i)
    table.basis[i] *= amplitude[i % static_cast<std::size_t>(table.modes)];
  return table;
}

void ModeTable::store(nn::Weights& weights, const std::string& prefix, nn::DType dtype) const {
  const auto m = static_cast<std::size_t>(modes);
  std::vector<float> amplitude(m, 0), scaled = basis;
  for (std::size_t i = 0; i < basis.size(); ++i) amplitude[i % m] = std::max(amplitude[i % m], std::abs(basis[i]));
  for (float& a : amplitude) a = a > 0 ? a : 1;
  for (std::size_t i = 0; i < basis.size(); ++i) scaled[i] /= amplitude[i % m];
  weights.tensors[prefix + ".points"] = index_tensor(points);
  weights.tensors[prefix + ".mean"] = nn::Tensor::from_float(mean, {rows(), components});
  weights.tensors[prefix + ".amplitude"] = nn::Tensor::from_float(amplitude, {modes});
  weights.tensors[prefix + ".basis"] = nn::Tensor::from_float(scaled, {rows(), components, modes}, dtype);
}

template <typename T>
void TiledModes<T>::assign(const ModeTable& table, const std::vector<int32_t>& points, const std::vector<int>& order) {
  slots_ = static_cast<int64_t>(points.size());
  components_ = static_cast<int>(order.size());
  modes_ = table.modes;
  const int64_t tiles = mpm::padded_to_tile(slots_) / tile;
  mean_.resize_discard(static_cast<std::size_t>(tiles * components_ * tile));
  basis_.resize_discard(static_cast<std::size_t>(tiles * components_ * modes_ * tile));
  const auto fill_tile = [&](int64_t t) {
    for (int64_t l = 0; l < tile; ++l) {
      const int64_t slot = t * tile + l;
      const int32_t point = slot < slots_ ? points[static_cast<std::size_t>(slot)] : -1;
      const int64_t row = table.row_of(point);
      for (int c = 0; c < components_; ++c) {
        const int64_t from = row * table.components + order[static_cast<std::size_t>(c)];
        const int64_t to = t * components_ + c;
        mean_[static_cast<std::size_t>(to * tile + l)] =
            row < 0 ? T(0) : static_cast<T>(table.mean[static_cast<std::size_t>(from)]);
        for (int k = 0; k < modes_; ++k)
          basis_[static_cast<std::size_t>((to * modes_ + k) * tile + l)] =
              row < 0 ? T(0) : static_cast<T>(table.basis[static_cast<std::size_t>(from * modes_ + k)]);
      }
    }
  };
  parallel_for_cpu(tiles, fill_tile, Grain{16});
}

template <typename T>
void TiledModes<T>::evaluate(const T* a, T* values) const {
  const int64_t columns = mpm::padded_to_tile(slots_) / tile * components_;
  const auto column = [&](int64_t n) {
    const T *mean = mean_.data() + n * tile, *w = basis_.data() + n * modes_ * tile;
    T sum[tile];
    for (int64_t l = 0; l < tile; ++l) sum[l] = mean[l];
    for (int k = 0; k < modes_; ++k)
      for (int64_t l = 0; l < tile; ++l) sum[l] += a[k] * w[k * tile + l];
    for (int64_t l = 0; l < tile; ++l) values[n * tile + l] = sum[l];
  };
  parallel_for_cpu(columns, column, Grain{64});
}

template <typename T>
void TiledModes<T>::evaluate(const T* a, const T* a_rate, T* values, T* rates) const {
  const int64_t columns = mpm::padded_to_tile(slots_) / tile * components_;
  const auto column = [&](int64_t n) {
    const T *mean = mean_.data() + n * tile, *w = basis_.data() + n * modes_ * tile;
    T sum[tile], rate[tile];
    for (int64_t l = 0; l < tile; ++l) {
      sum[l] = mean[l];
      rate[l] = 0;
    }
    for (int k = 0; k < modes_; ++k)
      for (int64_t l = 0; l < tile; ++l) {
        sum[l] += a[k] * w[k * tile + l];
        rate[l] += a_rate[k] * w[k * tile + l];
      }
    for (int64_t l = 0; l < tile; ++l) {
      values[n * tile + l] = sum[l];
      rates[n * tile + l] = rate[l];
    }
  };
  parallel_for_cpu(columns, column, Grain{64});
}

template class TiledModes<float>;
template class TiledModes<double>;

}  // namespace graupel::rom
