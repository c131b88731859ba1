#include "rom/fields/mode_table.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/system/error.h"
#include "rom/networks/tensors.h"

namespace graupel::rom {

namespace {

std::vector<int32_t> first_points(std::size_t count) {
  std::vector<int32_t> points(count);
  std::iota(points.begin(), points.end(), 0);
  return points;
}

}  // namespace

int64_t ModeTable::row_of(int32_t point) const {
  const auto at = std::lower_bound(points.begin(), points.end(), point);
  return at == points.end() || *at != point ? -1 : at - points.begin();
}

std::vector<float> ModeTable::amplitude() const {
  const auto m = static_cast<std::size_t>(modes);
  std::vector<float> largest(m, 0);
  for (std::size_t i = 0; i < basis.size(); ++i) largest[i % m] = std::max(largest[i % m], std::abs(basis[i]));
  for (float& a : largest) a = a > 0 ? a : 1;
  return largest;
}

ModeTable ModeTable::averaged(const Clusters& clusters) const {
  ModeTable means;
  means.components = components;
  means.modes = modes;
  means.precision = precision;
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
  const int64_t rows = extent(weights, prefix + ".mean", 0);
  table.mean = weights.get(prefix + ".mean", {rows, components});
  table.points = weights.tensors.count(prefix + ".points") > 0 ? get_indices(weights, prefix + ".points")
                                                               : first_points(static_cast<std::size_t>(rows));
  if (table.rows() != rows || !std::is_sorted(table.points.begin(), table.points.end()))
    throw InputError("'" + weights.file + "' has other points ('" + prefix + ".points') than values ('" + prefix +
                     ".mean'), or they are not in order. Train the model again");
  const int64_t modes = extent(weights, prefix + ".amplitude", 0);
  const std::vector<float> amplitude = weights.get(prefix + ".amplitude", {modes});
  table.modes = static_cast<int>(modes);
  table.basis = weights.get(prefix + ".basis", {rows, components, table.modes});
  for (std::size_t i = 0; i < table.basis.size(); ++i)
    table.basis[i] *= amplitude[i % static_cast<std::size_t>(table.modes)];
  if (weights.tensors.at(prefix + ".basis").dtype == nn::DType::f16) table.precision = ModePrecision::half;
  return table;
}

void ModeTable::store(nn::Weights& weights, const std::string& prefix, nn::DType dtype) const {
  const auto m = static_cast<std::size_t>(modes);
  const std::vector<float> largest = amplitude();
  std::vector<float> scaled = basis;
  for (std::size_t i = 0; i < basis.size(); ++i) scaled[i] /= largest[i % m];
  if (points != first_points(points.size())) weights.tensors[prefix + ".points"] = index_tensor(points);
  weights.tensors[prefix + ".mean"] = nn::Tensor::from_float(mean, {rows(), components});
  weights.tensors[prefix + ".amplitude"] = nn::Tensor::from_float(largest, {modes});
  weights.tensors[prefix + ".basis"] = nn::Tensor::from_float(scaled, {rows(), components, modes}, dtype);
}

}  // namespace graupel::rom
