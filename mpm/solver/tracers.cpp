#include "mpm/solver/tracers.h"

#include "core/system/error.h"
#include "mpm/phases/transfer_form.h"
#include "mpm/physics/particle_motion.h"
#include "mpm/physics/stencil.h"

namespace graupel::mpm {

namespace {

template <typename T, Spline S>
struct MoveTracer {
  SolverView<T> view;
  T dt;
  Vec<T, 3>*position, *velocity;

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
  GRAUPEL_HD const T* node_at(const Vec<int, 3>& node, int32_t& last_key, int32_t& last_block) const {
    Vec<int, 3> block;
    int inside = 0;
    for (int d = 0; d < 3; ++d) {
      block[d] = node[d] / block_width;
      inside = inside * block_width + node[d] % block_width;
    }
    const int32_t key = view.grid.directory_index(block);
    if (key != last_key) {
      last_key = key;
      last_block = node_block(key);
    }
    return last_block < 0 ? nullptr : view.nodes + (int64_t(last_block) * nodes_per_block<3> + inside) * channels;
  }

  /// Sum of the weights of nodes with mass, and of their velocities times these.
  GRAUPEL_HD T gather(const Vec<T, 3>& x, bool& all, Vec<T, 3>& sum) const {
    const Stencil<T, 3> stencil = stencil_at<S>(view.grid.local(x));
    AxisWeights<T, S> weights[3];
    for (int d = 0; d < 3; ++d) weights[d] = bspline_weights<S>(stencil.fx[d]);
    T weight = T(0);
    sum = Vec<T, 3>::zero();
    all = true;
    int32_t last_key = -1, last_block = -1;
    for (int i = 0; i < stencil_width<S>; ++i)
      for (int j = 0; j < stencil_width<S>; ++j)
        for (int k = 0; k < stencil_width<S>; ++k) {
          const T* node = node_at(stencil.base + Vec<int, 3>{i, j, k}, last_key, last_block);
          if (node == nullptr || !(node[3] > T(0))) {
            all = false;
            continue;
          }
          const T w = weights[0].w[i] * weights[1].w[j] * weights[2].w[k];
          weight += w;
          sum += w * Vec<T, 3>{node[0], node[1], node[2]};
        }
    return weight;
  }

  GRAUPEL_HD void operator()(int64_t i) const {
    constexpr T least_weight = T(1e-3);  // below, rounding of the nodes' small masses would show
    Vec<T, 3> x = position[i], v;
    bool all;
    const T weight = gather(x, all, v);
    if (!all) v = weight > least_weight ? v * (T(1) / weight) : velocity[i] + dt * view.gravity;
    StepStatistics unused;
    const Vec<T, 3> before = x;
    move_point<false, 3, T>(view, {}, false, i, T(1), dt, x, v, unused);
    if (view.push_out && view.moving.count > 0 && near_moving(view.moving, x))
      push_out_of_moving<3, T>(view, view.moving, dt, before, x);
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
Tracers<T>::Tracers(Device device, const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity)
    : position_(device, 0), velocity_(device, 0) {
  if (position.size() != velocity.size())
    throw ConfigError("tracers have other numbers of positions and velocities (" + std::to_string(position.size()) +
                      ", " + std::to_string(velocity.size()) + "). Give one of each");
  position_.upload(in_precision<T>(position));
  velocity_.upload(in_precision<T>(velocity));
}

template <typename T>
std::vector<Vec3f> Tracers<T>::positions() const {
  std::vector<Vec3f> x;
  for (const Vec<T, 3>& p : position_.download()) x.push_back(p.template cast<float>());
  return x;
}

template <typename T>
void Tracers<T>::move(const SolverView<T>& view, T dt) {
  const auto n = static_cast<int64_t>(position_.size());
  const auto run = [&](auto kernel) {
    launch<T>(view.device, n, decltype(kernel){view, dt, position_.data(), velocity_.data()}, Grain{64});
  };
  if (view.spline == Spline::cubic)
    run(MoveTracer<T, Spline::cubic>{});
  else
    run(MoveTracer<T, Spline::quadratic>{});
}

template class Tracers<float>;
template class Tracers<double>;

void check_carries_tracers(const Scene& scene) {
  const char* what = scene.domain.is_plane()                 ? "two dimensions"
                     : scene.domain.has_wall(Wall::periodic) ? "periodic walls"
                     : scene.domain.has_wall(Wall::open)     ? "open walls"
                                                             : nullptr;
  if (what != nullptr)
    throw ConfigError("scene '" + scene.name + "' has " + what +
                      ", where no tracers are carried (allowed: none). Run it at its own resolution");
}

}  // namespace graupel::mpm
