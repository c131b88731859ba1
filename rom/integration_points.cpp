#include "rom/integration_points.h"

#include <algorithm>
#include <map>
#include <utility>

namespace graupel::rom {

using mpm::tile;

template <typename T>
IntegrationPoints<T>::IntegrationPoints(const Fields& fields, GridParticles all, std::vector<int32_t> samples,
                                        const mpm::GridGeometry<T, 3>& grid)
    : samples_(std::move(samples)), all_(std::move(all)), grid_(grid) {
  std::map<int32_t, std::size_t> place;
  for (std::size_t i = 0; i < all_.particles.size(); ++i) place[all_.particles[i]] = i;
  std::vector<bool> taken(all_.particles.size(), false);
  GridParticles others;
  for (const int32_t sample : samples_) {
    const auto at = place.find(sample);
    sample_share_.push_back(at == place.end() ? 0.0 : all_.share[at->second]);
    if (at != place.end()) taken[at->second] = true;
  }
  for (std::size_t i = 0; i < all_.particles.size(); ++i) {
    if (taken[i]) continue;
    others.particles.push_back(all_.particles[i]);
    others.share.push_back(all_.share[i]);
  }
  all_ = std::move(others);
  std::vector<int32_t> candidates = samples_;
  candidates.insert(candidates.end(), all_.particles.begin(), all_.particles.end());
  candidates_ = bind_positions<T>(fields, candidates);
  position_.resize(static_cast<std::size_t>(3 * mpm::padded_to_tile(static_cast<int64_t>(candidates.size()))));
  std::size_t cells = 1;
  for (int d = 0; d < 3; ++d) {
    cells_[d] = mpm::block_width * grid_.blocks[d];
    cells *= static_cast<std::size_t>(cells_[d]);
  }
  stamp_.assign(cells, 0);
}

template <typename T>
GridParticles IntegrationPoints<T>::find(const LatentState& state) {
  candidates_->decode(state, position_.data());
  const mpm::TiledView<T, 3> position{position_.data()};
  const auto cell_of = [&](std::size_t i) {
    Vec<int, 3> cell = mpm::base_node(grid_.local(position.vec(static_cast<int64_t>(i))));
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
  for (std::size_t s = 0; s < samples_.size(); ++s) {
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
  // Where most are within reach anyway, taking all saves the work of choosing again.
  std::size_t reached = 0;
  for (std::size_t i = 0; i < all_.particles.size(); ++i)
    reached += stamp_[number(cell_of(samples_.size() + i))] == round_;
  const bool take_all = 10 * reached > 8 * all_.particles.size();
  GridParticles found;
  found.particles = samples_;
  found.samples = static_cast<int64_t>(samples_.size());
  found.share = sample_share_;
  for (std::size_t i = 0; i < all_.particles.size(); ++i) {
    if (!take_all && stamp_[number(cell_of(samples_.size() + i))] != round_) continue;
    found.particles.push_back(all_.particles[i]);
    found.share.push_back(all_.share[i]);
  }
  moved_ = 0;
  return found;
}

template <typename T>
bool IntegrationPoints<T>::stale_after(double distance) {
  moved_ += distance;
  return 2 * moved_ > margin * static_cast<double>(grid_.dx);  // a sample and a particle may move towards each other
}

template class IntegrationPoints<float>;
template class IntegrationPoints<double>;

}  // namespace graupel::rom
