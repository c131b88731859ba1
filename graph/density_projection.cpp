#include "graph/density_projection.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel_for_in.h"
#include "graph/density_kernels.h"
#include "graph/device_lists.h"

namespace graupel::graph {

using namespace density;

namespace {

constexpr Grain light{.items = 2048};
constexpr int64_t most_cells = int64_t{1} << 24;
constexpr int border = 2;  ///< [cells] around the walls
/// From the last frame's pressure, as good as 40 sweeps of relaxation 1 from none.
constexpr int sweeps = 10;
constexpr float relaxation = 1.7f;

Cells cells_of(const Surroundings& surroundings, double spacing) {
  Cells cells{};
  for (;; spacing *= 2) {
    cells.spacing = spacing;
    cells.inverse_spacing = 1 / spacing;
    double count = 1;
    for (int d = 0; d < 3; ++d) {
      const double inside = std::ceil((surroundings.hold_high[d] - surroundings.hold_low[d]) / spacing);
      count *= inside + 2 * border + 1;
      if (count > most_cells) break;
      cells.origin[d] = surroundings.hold_low[d] - border * spacing;
      cells.size[d] = static_cast<int>(inside) + 2 * border;
    }
    if (count <= most_cells) break;
  }
  cells.size[0] += cells.size[0] & 1;
  return cells;
}

}  // namespace

struct DensityProjection::Arrays {
  Arrays(Device device, const Cells& of)
      : cells(of),
        scratch(device),
        shares(device, static_cast<std::size_t>(of.count())),
        mass(device, shares.size()),
        pressure(device, shares.size()),
        words(device, static_cast<std::size_t>(2 * of.words_of_color())),
        word_count(device, words.size() + 1),
        rank(device, words.size() + 1),
        cell(device, 0),
        equation(device, 0) {
    mass.fill_zero();
    words.fill_zero();
  }
  ActiveCells active() { return {cells, rank.data(), cell.data()}; }
  /// No fewer than there are cells of a color that hold matter; the CPU knows how many.
  int64_t most_active(int color) {
    if (cell.device() == Device::cpu) return active().size(color);
    return std::min(static_cast<int64_t>(cell.size()), cells.count() / 2);
  }

  Cells cells;
  uint64_t unit = 0;  ///< mass of a particle
  ListScratch scratch;
  Buffer<Shares> shares;
  Buffer<uint32_t> mass;   ///< zero between calls
  Buffer<float> pressure;  ///< of the last frame; zero where it had no matter
  Buffer<uint32_t> words;  ///< active cells of both colours as bits, zero between calls
  Buffer<int32_t> word_count, rank, cell;
  Buffer<Equation> equation;
};

DensityProjection::DensityProjection(Device device, const Surroundings& surroundings, double largest_density,
                                     double spacing)
    : device_(device), arrays_(std::make_unique<Arrays>(device, cells_of(surroundings, spacing))) {
  GRAUPEL_ASSERT(largest_density > 0 && spacing > 0);
  Arrays& a = *arrays_;
  const double particles = largest_density * std::pow(a.cells.spacing, 3);
  a.unit = static_cast<uint64_t>(std::clamp(full / particles, 1.0, std::exp2(31)));
  parallel_for(device_, a.cells.count(),
               FindShares{a.cells, surroundings.view(device_).obstacles, surroundings.hold_low, surroundings.hold_high,
                          a.shares.data()});
  restart();
}
DensityProjection::~DensityProjection() = default;

void DensityProjection::restart() {
  arrays_->pressure.fill_zero();
  arrays_->rank.fill_zero();
  synchronize(device_);
}

void DensityProjection::apply(Vec3f* position, int64_t n, void* stream) {
  Arrays& a = *arrays_;
  find_cells(position, n, stream);
  solve(stream);
  parallel_for_in(stream, device_, n, MoveParticle{a.cells, a.shares.data(), a.pressure.data(), position});
}

void DensityProjection::find_cells(const Vec3f* position, int64_t n, void* stream) {
  Arrays& a = *arrays_;
  const auto most_active = static_cast<std::size_t>(std::min(corners * n, a.cells.count()));
  if (most_active > a.cell.size()) {
    a.cell.resize_discard(most_active);
    a.equation.resize_discard(most_active);
    restart();
  }
  const auto words = static_cast<int64_t>(a.words.size());
  parallel_for_in(stream, device_, n, Spread{a.cells, position, a.unit, a.mass.data(), a.words.data()});
  parallel_for_in(stream, device_, a.most_active(0) + a.most_active(1),
                  DropPressure{a.active(), a.mass.data(), a.pressure.data()}, light);
  parallel_for_in(stream, device_, words, grid::CountBits{a.words.data(), a.word_count.data()}, light);
  running_sums(device_, words, a.word_count.data(), a.rank.data(), a.scratch, stream);
  parallel_for_in(stream, device_, words,
                  ListCells{a.active(), a.shares.data(), a.words.data(), a.mass.data(), a.equation.data()}, light);
}

void DensityProjection::solve(void* stream) {
  Arrays& a = *arrays_;
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (int color = 0; color < 2; ++color)
      parallel_for_in(stream, device_, a.most_active(color),
                      Sweep{a.active(), color, relaxation, a.shares.data(), a.equation.data(), a.pressure.data()},
                      light);
}

}  // namespace graupel::graph
