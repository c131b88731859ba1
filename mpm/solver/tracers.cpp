#include "mpm/solver/tracers.h"

#include "core/system/error.h"
#include "mpm/phases/transfer_form.h"
#include "mpm/physics/exits.h"
#include "mpm/physics/particle_motion.h"
#include "mpm/physics/stencil.h"

namespace graupel::mpm {

namespace {

template <typename T, typename Form>
struct MoveTracer {
  static constexpr int D = Form::D;
  static constexpr Spline S = Form::spline;

  SolverView<T> view;
  T dt;
  Vec<T, 3>*position, *velocity;
  const double* birth_time;
  Presence* presence;  ///< null: all are always there

  /// Node block with a directory index, -1 where none is.
  GRAUPEL_HD int32_t node_block(int32_t key) const {
    int32_t low = 0, high = view.blocks.node_count;
    while (low < high) {
      const int32_t middle = (low + high) / 2;
      if (view.blocks.node_key[middle] < key)
        low = middle + 1;
      else
        high = middle;
    }
    return low < view.blocks.node_count && view.blocks.node_key[low] == key ? low : -1;
  }

  /// Velocity and mass of a node; null where its block is not in use.
  GRAUPEL_HD const T* node_at(const Vec<int, D>& node, int32_t& last_key, int32_t& last_block) const {
    Vec<int, D> block;
    int inside = 0;
    for (int d = 0; d < D; ++d) {
      block[d] = node[d] / block_width;
      inside = inside * block_width + node[d] % block_width;
    }
    const int32_t key = in_axes<D>(view.grid).directory_index(block);
    if (key != last_key) {
      last_key = key;
      last_block = node_block(key);
    }
    if (last_block < 0) return nullptr;
    const T* found = view.nodes + (int64_t(last_block) * nodes_per_block<D> + inside) * channels;
    return found[3] > T(0) ? found : nullptr;
  }

  /// The node with mass that is this node across periodic walls, of those within a cell of one; null for none.
  GRAUPEL_HD const T* image_of(const Vec<int, D>& node, int32_t& last_key, int32_t& last_block) const {
    int shift[3] = {0, 0, 0}, images = 1;
    for (int d = 0; d < D; ++d) {
      const PeriodicAxis& p = view.walls.periodic[d];
      if (p.cells == 0) continue;
      const int from_low = node[d] - p.low_node, from_high = from_low - p.cells;
      shift[d] = from_low >= -1 && from_low <= 1 ? p.cells : from_high >= -1 && from_high <= 1 ? -p.cells : 0;
      images = 1 << D;
    }
    for (int image = 1; image < images; ++image) {
      Vec<int, D> other = node;
      bool is_one = true;
      for (int d = 0; d < D; ++d) {
        if (((image >> d) & 1) == 0) continue;
        is_one = is_one && shift[d] != 0;
        other[d] += shift[d];
      }
      if (!is_one) continue;
      if (const T* found = node_at(other, last_key, last_block)) return found;
    }
    return nullptr;
  }

  /// Sum of the weights of nodes with mass, and of their velocities times these.
  GRAUPEL_HD T gather(const Vec<T, 3>& x, bool& all, Vec<T, 3>& sum) const {
    const Stencil<T, D> stencil = stencil_at<S>(in_axes<D>(view.grid.local(x)));
    AxisWeights<T, S> weights[D];
    for (int d = 0; d < D; ++d) weights[d] = bspline_weights<S>(stencil.fx[d]);
    T weight = T(0);
    sum = Vec<T, 3>::zero();
    all = true;
    int32_t last_key = -1, last_block = -1;
    constexpr int width = stencil_width<S>, nodes = D == 2 ? width * width : width * width * width;
    for (int k = 0; k < nodes; ++k) {
      Vec<int, D> offset;
      int rest = k;
      for (int d = D - 1; d >= 0; --d) {
        offset[d] = rest % width;
        rest /= width;
      }
      const T* node = node_at(stencil.base + offset, last_key, last_block);
      if (node == nullptr && view.walls.has_gates) node = image_of(stencil.base + offset, last_key, last_block);
      if (node == nullptr) {
        all = false;
        continue;
      }
      T w = weights[0].w[offset[0]];
      for (int d = 1; d < D; ++d) w = w * weights[d].w[offset[d]];
      weight += w;
      sum += w * Vec<T, 3>{node[0], node[1], node[2]};
    }
    return weight;
  }

  /// Velocity of a point at x, where its last one was v.
  GRAUPEL_HD Vec<T, 3> velocity_at(const Vec<T, 3>& x, const Vec<T, 3>& v) const {
    constexpr T least_weight = T(1e-3);  // below, rounding of the nodes' small masses would show
    Vec<T, 3> sum;
    bool all;
    const T weight = gather(x, all, sum);
    if (all) return sum;
    return weight > least_weight ? sum * (T(1) / weight) : v + dt * view.gravity;
  }

  GRAUPEL_HD void operator()(int64_t i) const {
    Vec<T, 3> x = position[i], v = velocity[i];
    if (presence != nullptr && presence[i] != Presence::active) {
      if (presence[i] == Presence::gone || !appears(view.lifecycle.step_end, birth_time[i], dt, v, x)) return;
      presence[i] = Presence::active;
    } else {
      v = velocity_at(x, v);
    }
    StepStatistics unused;
    move_point<true, D, T>(view, view.moving, false, i, T(1), dt, x, v, unused);
    if (has_exits(view.walls, view.lifecycle) && leaves(view.walls, view.lifecycle, view.grid.dx, x))
      presence[i] = Presence::gone;
    position[i] = x;
    velocity[i] = v;
  }
};

template <typename T>
std::vector<Vec<T, 3>> in_precision(const std::vector<Vec3f>& from) {
  std::vector<Vec<T, 3>> to;
  to.reserve(from.size());
  for (const Vec3f& x : from) to.push_back(x.template cast<T>());
  return to;
}

}  // namespace

template <typename T>
Tracers<T>::Tracers(Device device, const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                    const std::vector<double>& birth_time, double now)
    : position_(device, 0), velocity_(device, 0), birth_time_(device, 0), presence_(device, 0) {
  if (position.size() != velocity.size() || (!birth_time.empty() && birth_time.size() != position.size()))
    throw ConfigError("tracers have other numbers of positions, velocities and times of birth (" +
                      std::to_string(position.size()) + ", " + std::to_string(velocity.size()) + ", " +
                      std::to_string(birth_time.size()) + "). Give one of each, or no times of birth");
  position_.upload(in_precision<T>(position));
  velocity_.upload(in_precision<T>(velocity));
  if (birth_time.empty()) return;
  std::vector<Presence> presence;
  presence.reserve(birth_time.size());
  for (const double birth : birth_time) presence.push_back(birth <= now ? Presence::active : Presence::unborn);
  birth_time_.upload(birth_time);
  presence_.upload(presence);
}

template <typename T>
std::vector<Vec3f> Tracers<T>::positions() const {
  std::vector<Vec3f> x;
  for (const Vec<T, 3>& p : position_.download()) x.push_back(p.template cast<float>());
  return x;
}

template <typename T>
std::vector<uint8_t> Tracers<T>::active() const {
  std::vector<uint8_t> active;
  for (const Presence p : presence_.download()) active.push_back(p == Presence::active ? 1 : 0);
  return active;
}

template <typename T>
void Tracers<T>::move(const SolverView<T>& view, T dt) {
  Presence* const presence = presence_.size() > 0 ? presence_.data() : nullptr;
  with_form(view, [&](auto form) {
    const MoveTracer<T, decltype(form)> kernel{view,    dt, position_.data(), velocity_.data(), birth_time_.data(),
                                               presence};
    launch<T>(view.device, static_cast<int64_t>(position_.size()), kernel, Grain{64});
  });
}

template class Tracers<float>;
template class Tracers<double>;

}  // namespace graupel::mpm
