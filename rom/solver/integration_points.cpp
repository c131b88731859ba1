#include "rom/solver/integration_points.h"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "mpm/physics/stencil.h"

namespace graupel::rom {

using mpm::tile;

template <typename T>
IntegrationPoints<T>::IntegrationPoints(const Fields& fields, const GridParticles& all,
                                        const std::vector<int32_t>& samples, const mpm::GridGeometry<T, 3>& grid)
    : grid_(grid) {
  std::unordered_map<int32_t, std::size_t> place;
  for (std::size_t i = 0; i < all.particles.size(); ++i) place[all.particles[i]] = i;
  std::vector<bool> taken(all.particles.size(), false);
  const auto append = [&](int32_t particle, double weight) {
    all_.particles.push_back(particle);
    all_.weight.push_back(weight);
  };
  for (const int32_t sample : samples) {
    const auto at = place.find(sample);
    append(sample, at == place.end() ? 0.0 : all.weight[at->second]);
    if (at != place.end()) taken[at->second] = true;
  }
  all_.samples = static_cast<int64_t>(samples.size());
  for (std::size_t i = 0; i < all.particles.size(); ++i)
    if (!taken[i]) append(all.particles[i], all.weight[i]);
  positions_ = bind_positions<T>(fields, all_.particles);
  position_.resize(static_cast<std::size_t>(3 * mpm::padded_to_tile(static_cast<int64_t>(all_.particles.size()))));
  std::size_t cells = 1;
  for (int d = 0; d < 3; ++d) {
    cells_[d] = mpm::block_width * grid_.blocks[d];
    cells *= static_cast<std::size_t>(cells_[d]);
  }
  stamp_.assign(cells, 0);
}

template <typename T>
std::vector<int32_t> IntegrationPoints<T>::find(const LatentState& state) {
  positions_->decode(state, position_.data());
  const mpm::TiledView<T, 3> position{position_.data()};
  const auto cell_of = [&](std::size_t i) {
    Vec<T, 3> local = grid_.local(position.vec(static_cast<int64_t>(i)));
    // A step that is refused later may have led a sample anywhere, to no number too.
    for (int d = 0; d < 3; ++d) local[d] = local[d] > 0 ? std::min(local[d], static_cast<T>(cells_[d])) : T(0);
    Vec<int, 3> cell = mpm::base_node(local);
    for (int d = 0; d < 3; ++d) cell[d] = std::clamp(cell[d], 0, cells_[d] - 1);
    return cell;
  };
  const auto number = [&](const Vec<int, 3>& c) {
    return (static_cast<std::size_t>(c[0]) * static_cast<std::size_t>(cells_[1]) + static_cast<std::size_t>(c[1])) *
               static_cast<std::size_t>(cells_[2]) +
           static_cast<std::size_t>(c[2]);
  };
  ++round_;
  constexpr int reach = 2 + margin;  // quadratic stencils of three nodes meet up to two base cells apart
  const auto samples = static_cast<std::size_t>(all_.samples), count = all_.particles.size(),
             width = static_cast<std::size_t>(tile);
  for (std::size_t s = 0; s < samples; ++s) {
    const Vec<int, 3> c = cell_of(s);
    Vec<int, 3> low, high;
    for (int d = 0; d < 3; ++d) {
      low[d] = std::max(0, c[d] - reach);
      high[d] = std::min(cells_[d] - 1, c[d] + reach);
    }
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y) {
        uint32_t* row = stamp_.data() + number({x, y, 0});
        for (int z = low[2]; z <= high[2]; ++z) row[z] = round_;
      }
  }
  // Where most are within reach anyway, taking all for good saves the work of choosing again.
  std::vector<int32_t> found;
  std::size_t reached = 0;
  for (std::size_t first = 0; first < count; first += width) {
    std::size_t inside = 0;
    const std::size_t end = std::min(first + width, count);
    for (std::size_t i = first; i < end; ++i) inside += stamp_[number(cell_of(i))] == round_;
    if (inside > 0) found.push_back(static_cast<int32_t>(first / width));
    reached += inside;
  }
  all_taken_ = 10 * reached > 8 * count;
  if (all_taken_) {
    found.resize((count + width - 1) / width);
    std::iota(found.begin(), found.end(), 0);
  }
  moved_ = 0;
  return found;
}

template <typename T>
bool IntegrationPoints<T>::stale_after(double distance) {
  moved_ += distance;
  return !all_taken_ &&
         2 * moved_ > margin * static_cast<double>(grid_.dx);  // a sample and a particle may move towards each other
}

template class IntegrationPoints<float>;
template class IntegrationPoints<double>;

}  // namespace graupel::rom
