#include "graph/corrections/density_projection.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/parallel/memory.h"
#include "core/parallel/parallel_for_in.h"
#include "core/system/error.h"
#include "graph/corrections/density_cells.h"
#include "graph/corrections/density_solver.h"
#include "graph/topology/device_lists.h"

namespace graupel::graph {

using namespace density;

namespace {

constexpr Grain light{.items = 2048};
constexpr int64_t few_particles = 16384;
/// From the last frame's pressure, as good as 40 sweeps of relaxation 1 from none.
constexpr int sweeps = 10;
constexpr float relaxation = 1.7f;

}  // namespace

/// One of the grids, with its pressure.
class DensityProjection::Lattice {
 public:
  explicit Lattice(Device device)
      : device_(device),
        scratch_(device),
        open_fractions_(device, 0),
        mass_(device, 0),
        pressure_(device, 0),
        words_(device, 0),
        rank_(device, 0),
        cell_(device, 0),
        equation_(device, 0) {}

  /// Whether start() allocates nothing for these.
  bool holds(const Cells& cells) const { return cells.count() <= most_cells_; }
  void start(const Environment& environment, double largest_density, const Cells& cells, void* stream) {
    cells_ = cells;
    most_cells_ = std::max(most_cells_, cells.count());
    unit_ =
        static_cast<uint64_t>(std::clamp(full / (largest_density * std::pow(cells.spacing, 3)), 1.0, std::exp2(31)));
    skip_ = nullptr;
    const auto count = static_cast<std::size_t>(cells.count());
    open_fractions_.resize_discard(count);
    mass_.resize_discard(count);
    pressure_.resize_discard(count);
    words_.resize_discard(static_cast<std::size_t>(2 * cells.words_of_color()));
    rank_.resize_discard(words_.size() + 1);
    room_ = 0;  // which is that of the particles, and chooses the solver
    low_ = environment.hold_low;
    high_ = environment.hold_high;
    const StartCells start{fractions_of(environment.obstacles.view(device_)),
                           static_cast<int64_t>(words_.size()),
                           mass_.data(),
                           words_.data(),
                           pressure_.data(),
                           rank_.data()};
    parallel_for_in(stream, device_, start.items(), start);
    if (!solves_at_once()) count_cells(stream);  // takes its memory
  }
  /// For the cells that n particles may fill. What was listed last stays: the next solution drops its pressures.
  void make_room(int64_t n) {
    room_ = std::max(room_, std::min(corners * n, cells_.count()));
    const auto room = static_cast<std::size_t>(room_);
    if (room > cell_.size()) {
      Buffer<int32_t> longer(device_, std::max(room, cell_.size() + cell_.size() / 4));
      device_copy(device_, longer.data(), device_, cell_.data(), cell_.size() * sizeof(int32_t));
      std::swap(cell_, longer);
    }
    equation_.resize_discard(room);
  }

  void place(const sparsegrid::ObstacleSetView& obstacles, void* stream) {
    parallel_for_in(stream, device_, cells_.count(), fractions_of(obstacles));
  }

  void restart() {
    pressure_.fill_zero();
    rank_.fill_zero();
    synchronize(device_);
  }

  void skip_where(const int32_t* flag) { skip_ = flag; }

  void spread(const Vec3f* position, int64_t n, void* stream) {
    parallel_for_in(stream, device_, n, spreading(position, n),
                    Grain{.items = is_alone(n) ? few_particles : Grain().items});
  }
  /// Moves the particles and, where there is a `next` lattice, spreads them there.
  void move(Vec3f* position, int64_t n, Lattice* next, void* stream) {
    if (next != nullptr && device_ == Device::cuda) {
      parallel_for_in(stream, device_, n, MoveAndSpread{moving(position), next->spreading(position, n)});
      return;
    }
    parallel_for_in(stream, device_, n, moving(position));
    if (next != nullptr) next->spread(position, n, stream);
  }

  bool solves_at_once() const {
    return device_ == Device::cuda && solves_density_at_once(room_, static_cast<int64_t>(words_.size()));
  }
  DensitySystem system() {
    return {cells_,       sweeps, relaxation,   open_fractions_.data(), words_.data(),    mass_.data(),
            rank_.data(), room_,  cell_.data(), equation_.data(),       pressure_.data(), skip_};
  }
  /// False where nothing will move.
  bool solve(void* stream) {
    if (solves_at_once()) {
      solve_density({system()}, stream);
      return true;
    }
    find_cells(stream);
    if (device_ == Device::cpu && at_rest()) return false;
    for (int sweep = 0; sweep < sweeps; ++sweep)
      for (int color = 0; color < 2; ++color)
        parallel_for_in(stream, device_, most_active(color),
                        Sweep{active(), color, relaxation, open_fractions_.data(), equation_.data(), pressure_.data()},
                        light);
    return true;
  }

  Spread spreading(const Vec3f* position, int64_t n) {
    make_room(n);
    return {cells_, position, unit_, mass_.data(), words_.data(), is_alone(n), skip_};
  }
  MoveParticle moving(Vec3f* position) const {
    return {cells_, open_fractions_.data(), pressure_.data(), position, skip_};
  }

 private:
  /// A few particles are spread by one thread sooner than by several with atomic sums.
  bool is_alone(int64_t n) const { return device_ == Device::cpu && n <= few_particles; }
  FindOpenFractions fractions_of(const sparsegrid::ObstacleSetView& obstacles) {
    return {cells_, obstacles, low_, high_, open_fractions_.data()};
  }
  void count_cells(void* stream) {
    count_bits(device_, static_cast<int64_t>(words_.size()), words_.data(), rank_.data(), scratch_, stream);
  }
  void find_cells(void* stream) {
    const auto words = static_cast<int64_t>(words_.size());
    parallel_for_in(stream, device_, most_active(0) + most_active(1),
                    DropPressure{active(), mass_.data(), pressure_.data()}, light);
    count_cells(stream);
    parallel_for_in(stream, device_, words,
                    ListCells{active(), open_fractions_.data(), words_.data(), mass_.data(), equation_.data()}, light);
  }

  /// Whether no cell has too much matter or a pressure: all pressures stay 0, and nothing moves.
  bool at_rest() {
    const int32_t count = active().begin(2);
    for (int32_t k = 0; k < count; ++k)
      if (equation_[static_cast<std::size_t>(k)].excess > 0 || pressure_[static_cast<std::size_t>(cell_[k])] > 0)
        return false;
    return true;
  }

  ActiveCells active() { return {cells_, rank_.data(), cell_.data()}; }
  /// No fewer than there are cells of a color that hold matter; the CPU knows how many.
  int64_t most_active(int color) {
    if (device_ == Device::cpu) return active().size(color);
    return std::min(room_, cells_.count() / 2);
  }

  Device device_;
  Cells cells_{};
  Vec3d low_{}, high_{};    ///< [m] the walls
  int64_t most_cells_ = 0;  ///< that there is memory for
  uint64_t unit_ = 0;       ///< mass of a particle
  int64_t room_ = 0;        ///< cells that the lists may hold
  ListScratch scratch_;
  Buffer<OpenFractions> open_fractions_;
  Buffer<uint32_t> mass_;   ///< zero between calls
  Buffer<float> pressure_;  ///< of the last frame; zero where it had no matter
  Buffer<uint32_t> words_;  ///< cells of both colours that hold matter as bits, zero between calls
  Buffer<int32_t> rank_, cell_;
  Buffer<Equation> equation_;
  const int32_t* skip_ = nullptr;
};

DensityProjection::DensityProjection(Device device, const Environment& environment, double largest_density,
                                     double spacing)
    : device_(device) {
  start(environment, largest_density, spacing);
  synchronize(device);
}
DensityProjection::~DensityProjection() = default;

void DensityProjection::start(const Environment& environment, double largest_density, double spacing, void* stream) {
  GRAUPEL_ASSERT(largest_density > 0 && spacing > 0);
  for (std::size_t k = 0; k < lattices_.size(); ++k) {
    Vec3d low = environment.box_low, high = environment.box_high;
    for (int d = 0; d < 3; ++d)
      if (environment.period[d] > 0) {
        low[d] -= image_cells * spacing;
        high[d] += image_cells * spacing;
      }
    const Cells cells = cells_over(low, high, spacing, 0.5 * static_cast<double>(k));
    if (!lattices_[k] || !lattices_[k]->holds(cells)) {
      lattices_[k].reset();
      check_fits(cells, available_bytes(device_));
      lattices_[k] = std::make_unique<Lattice>(device_);
    }
    lattices_[k]->start(environment, largest_density, cells, stream);
  }
}

void DensityProjection::reserve(int64_t n) {
  for (const auto& lattice : lattices_) lattice->make_room(n);
}

void DensityProjection::place(const sparsegrid::ObstacleSetView& obstacles, void* stream) {
  for (const auto& lattice : lattices_) lattice->place(obstacles, stream);
}

void DensityProjection::apply(Vec3f* position, int64_t n, void* stream) {
  lattices_.front()->spread(position, n, stream);
  for (std::size_t k = 0; k < lattices_.size(); ++k) {
    Lattice* const next = k + 1 < lattices_.size() ? lattices_[k + 1].get() : nullptr;
    if (lattices_[k]->solve(stream))
      lattices_[k]->move(position, n, next, stream);
    else if (next != nullptr)
      next->spread(position, n, stream);
  }
}

Spread DensityProjection::spreading(const Vec3f* position, int64_t n) {
  return lattices_.front()->spreading(position, n);
}

void DensityProjection::between(const std::vector<Frame>& scenes, void* stream) {
  constexpr std::size_t count = std::tuple_size_v<decltype(lattices_)>;
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<DensitySystem> systems;
    for (const Frame& scene : scenes) {
      Lattice& lattice = *scene.density->lattices_[k];
      if (lattice.solves_at_once())
        systems.push_back(lattice.system());
      else
        lattice.solve(stream);
    }
    if (!systems.empty()) solve_density(systems, stream);
    if (k + 1 == count) break;
    std::vector<Loop<MoveAndSpread>> moves;
    moves.reserve(scenes.size());
    for (const auto& [density, position, n] : scenes)
      moves.push_back(
          {n, {density->lattices_[k]->moving(position), density->lattices_[k + 1]->spreading(position, n)}});
    parallel_loops_in(stream, Device::cuda, moves);
  }
}

MoveParticle DensityProjection::moving(Vec3f* position) { return lattices_.back()->moving(position); }

void DensityProjection::skip_where(const int32_t* flag) {
  for (const auto& lattice : lattices_) lattice->skip_where(flag);
}

void DensityProjection::restart() {
  for (const auto& lattice : lattices_) lattice->restart();
}

}  // namespace graupel::graph
