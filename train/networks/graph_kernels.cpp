#include "train/networks/graph_kernels.h"

#include <cmath>

#include "core/parallel/parallel_for_in.h"

namespace graupel::train {

namespace {

/// W numbers that one thread handles: four neighbouring columns where the width allows it (16-byte loads), else one.
template <typename T, int W>
struct alignas(sizeof(T) * W) Pack {
  T v[W];
};
template <typename T, int W>
GRAUPEL_HD Pack<T, W> load(const T* p) {
  return *reinterpret_cast<const Pack<T, W>*>(p);
}
template <typename T, int W>
GRAUPEL_HD void store(T* p, const Pack<T, W>& x) {
  *reinterpret_cast<Pack<T, W>*>(p) = x;
}

GRAUPEL_HD inline int64_t row_of(const RowIndex& row, int64_t r) { return row.index ? row.index[r] : r >> row.shift; }
template <typename T>
GRAUPEL_HD T leaky(T x, T slope) {
  return x > T(0) ? x : slope * x;
}

template <typename T, int W>
struct GatherSumLeaky {
  int64_t packs;  // per row
  GatherTerm<T> a, b;
  T* out;
  T slope;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int64_t r = i / packs, column = (i - r * packs) * W;
    Pack<T, W> x = load<T, W>(a.table + row_of(a.row, r) * a.stride + column);
    if (b.table) {
      const Pack<T, W> y = load<T, W>(b.table + row_of(b.row, r) * b.stride + column);
      for (int k = 0; k < W; ++k) x.v[k] += y.v[k];
    }
    const Pack<T, W> own = load<T, W>(out + i * W);
    for (int k = 0; k < W; ++k) x.v[k] += own.v[k];
    for (int k = 0; k < W; ++k) x.v[k] = leaky(x.v[k], slope);
    store<T, W>(out + i * W, x);
  }
};

template <typename T, int W>
struct SegmentSum {
  int64_t packs;
  Segments segments;
  const T* source;
  int64_t stride;
  const T* weight;
  T* out;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int64_t s = i / packs, column = (i - s * packs) * W;
    const int64_t first = segments.begin ? segments.begin[s] : s * segments.fixed;
    const int64_t last = segments.begin ? segments.begin[s + 1] : first + segments.fixed;
    Pack<T, W> sum{};
    for (int64_t j = first; j < last; ++j) {
      const int64_t r = segments.item ? segments.item[j] : j;
      const T w = weight ? weight[r] : T(1);
      const Pack<T, W> x = load<T, W>(source + r * stride + column);
      for (int k = 0; k < W; ++k) sum.v[k] += w * x.v[k];
    }
    store<T, W>(out + i * W, sum);
  }
};

template <typename T, int W>
struct GatherRows {
  int64_t packs;
  GatherTerm<T> source;
  const T* weight;
  T* out;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int64_t r = i / packs, column = (i - r * packs) * W;
    Pack<T, W> x = load<T, W>(source.table + row_of(source.row, r) * source.stride + column);
    const T w = weight ? weight[r] : T(1);
    for (int k = 0; k < W; ++k) x.v[k] *= w;
    store<T, W>(out + i * W, x);
  }
};

template <typename T>
struct AdamStep {
  AdamSettings s;
  const T* gradient;
  const T* gradient_norm;
  T *weights, *moment1, *moment2, *ema;
  GRAUPEL_HD void operator()(int64_t i) const {
    const T norm = *gradient_norm;
    if (!(norm - norm == T(0))) return;  // infinite or not a number
    const T scale = s.clip > 0 && norm > T(s.clip) ? T(s.clip) / norm : T(1);
    const T g = gradient[i] * scale;
    const T rate = T(s.scheduled ? s.scheduled[0] : s.learning_rate),
            correction1 = T(s.scheduled ? s.scheduled[1] : s.correction1),
            correction2 = T(s.scheduled ? s.scheduled[2] : s.correction2);
    const T m = T(s.beta1) * moment1[i] + T(1 - s.beta1) * g;
    const T v = T(s.beta2) * moment2[i] + T(1 - s.beta2) * g * g;
    const T w = weights[i] - rate * (m / correction1) / (std::sqrt(v / correction2) + T(s.epsilon));
    moment1[i] = m;
    moment2[i] = v;
    weights[i] = w;
    ema[i] = T(s.ema_decay) * ema[i] + T(1 - s.ema_decay) * w;
  }
};

constexpr Grain light{.items = 4096};

bool packable(int64_t width, int64_t stride) { return width % 4 == 0 && stride % 4 == 0; }

}  // namespace

template <typename T>
void gather_sum_leaky(Device device, int64_t rows, int64_t width, const GatherTerm<T>& a, const GatherTerm<T>& b,
                      T* out, double slope) {
  if (packable(width, a.stride) && (!b.table || packable(width, b.stride)))
    parallel_for(device, rows * (width / 4), GatherSumLeaky<T, 4>{width / 4, a, b, out, T(slope)}, light);
  else
    parallel_for(device, rows * width, GatherSumLeaky<T, 1>{width, a, b, out, T(slope)}, light);
}

template <typename T>
void segment_sum(Device device, const Segments& segments, int64_t width, const T* source, int64_t source_stride,
                 const T* weight, T* out) {
  if (packable(width, source_stride))
    parallel_for(device, segments.count * (width / 4),
                 SegmentSum<T, 4>{width / 4, segments, source, source_stride, weight, out}, light);
  else
    parallel_for(device, segments.count * width, SegmentSum<T, 1>{width, segments, source, source_stride, weight, out},
                 light);
}

template <typename T>
void gather_rows(Device device, int64_t rows, int64_t width, const GatherTerm<T>& source, const T* weight, T* out) {
  if (packable(width, source.stride))
    parallel_for(device, rows * (width / 4), GatherRows<T, 4>{width / 4, source, weight, out}, light);
  else
    parallel_for(device, rows * width, GatherRows<T, 1>{width, source, weight, out}, light);
}

template <typename T>
void adam_step(Device device, int64_t count, const AdamSettings& settings, const T* gradient, const T* gradient_norm,
               T* weights, T* moment1, T* moment2, T* ema, void* stream) {
  parallel_for_in(stream, device, count, AdamStep<T>{settings, gradient, gradient_norm, weights, moment1, moment2, ema},
                  light);
}

// NOLINTBEGIN(bugprone-macro-parentheses): T is a type
#define GRAUPEL_INSTANTIATE(T)                                                                                      \
  template void gather_sum_leaky(Device, int64_t, int64_t, const GatherTerm<T>&, const GatherTerm<T>&, T*, double); \
  template void segment_sum(Device, const Segments&, int64_t, const T*, int64_t, const T*, T*);                     \
  template void gather_rows(Device, int64_t, int64_t, const GatherTerm<T>&, const T*, T*);                          \
  template void adam_step(Device, int64_t, const AdamSettings&, const T*, const T*, T*, T*, T*, T*, void*);
// NOLINTEND(bugprone-macro-parentheses)
GRAUPEL_INSTANTIATE(float)
GRAUPEL_INSTANTIATE(double)

}  // namespace graupel::train
