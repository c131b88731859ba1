// The least-squares problem of a reduced-order model's step, as far as it can be solved before the samples have moved.
// With U the modes at the samples, G = U^T U, a(q) the deformation's coefficients, a_0 those before the step, q* = q +
// dt q' and S = da/dq there, Gauss-Newton's first step from q* is
//   M dq = S^T (U^T way - G d),   M = S^T G S,   d = a(q*) - a_0   =>   dq = P (U^T way) - p
// with P = M^-1 S^T and p = M^-1 S^T G d. A block of the decode kernel finds P and p while the others decode; the fit,
// on which the next step waits, then is a product. Lengths are ways, not positions, so that nothing is lost to
// rounding; all in f64.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

/// G has room in shared memory up to so many modes.
inline constexpr int small_gram = 32;

/// What a block needs of shared memory for it.
struct EquationCapacity {
  double* slope;   ///< S [modes, r]
  double* turned;  ///< G (S, d) [modes, r + 1]
  double* ahead;   ///< d [modes]
  double* table;   ///< M, S^T and S^T G d, side by side [r, r + modes + 1]; before that, room for G

  /// Numbers of all of it.
  GRAUPEL_HD static int size(const ModelView& model) {
    const int r = model.latents, m = model.deformation_modes;
    return m * (2 * r + 2) + table_size(r, m);
  }
  GRAUPEL_HD EquationCapacity(double* room, const ModelView& model)
      : slope(room),
        turned(slope + model.deformation_modes * model.latents),
        ahead(turned + model.deformation_modes * (1 + model.latents)),
        table(ahead + model.deformation_modes) {}

 private:
  GRAUPEL_HD static int table_size(int r, int m) {
    const int table = r * (r + m + 1), gram = m <= small_gram ? m * m : 0;
    return table > gram ? table : gram;
  }
};

/// Gauss-Jordan of the r rows of A, `width` wide, without a search for pivots, for its first r columns are a symmetric
/// positive matrix, to which a small ridge is added: all that is left of it is its diagonal. An entry a thread.
template <typename Block>
GRAUPEL_HD void eliminate(const Block& block, double* A, int r, int width) {
  constexpr double ridge = 1e-12;  // of the mean diagonal
  double trace = 0;
  for (int j = 0; j < r; ++j) trace += A[j * width + j];
  block.sync();
  for (int j = block.thread(); j < r; j += block.threads()) A[j * width + j] += ridge * trace / r;
  block.sync();
  for (int j = 0; j < r; ++j) {
    const double inverse = 1 / A[j * width + j];
    const int right = width - j - 1;  // columns that are not done
    for (int e = block.thread(); e < (r - 1) * right; e += block.threads()) {
      const int i = e / right + (e / right >= j ? 1 : 0), c = j + 1 + e % right;
      A[i * width + c] -= A[i * width + j] * inverse * A[j * width + c];
    }
    block.sync();
  }
}

/// What the pivots that eliminate() has left say of the matrix.
struct Pivots {
  double low, high;
  bool fine = true;  ///< the matrix was neither singular nor not finite
  GRAUPEL_HD Pivots(const double* A, int r, int width) : low(A[0]), high(A[0]) {
    for (int j = 0; j < r; ++j) {
      const double pivot = A[j * width + j];
      fine = fine && pivot > 0 && pivot < 1e300;
      low = pivot < low ? pivot : low;
      high = pivot > high ? pivot : high;
    }
  }
  GRAUPEL_HD double condition() const { return high / low; }
};

template <typename Block>
struct Equations {
  const Block& block;
  const ModelView& model;
  const InstanceView& instance;
  EquationCapacity room;

  /// f(i) for i = 0 .. n - 1, by the threads of the block.
  template <typename F>
  GRAUPEL_HD void each(int n, const F& f) const {
    for (int i = block.thread(); i < n; i += block.threads()) f(i);
  }

  /// Into instance.equations; `gram` is G of the samples that count.
  GRAUPEL_HD void solve(const double* gram) const {
    const int m = model.deformation_modes;
    each(m, [&](int k) { room.ahead[k] = instance.ahead[k] - instance.coefficient[k]; });
    each(m * model.latents, [&](int i) { room.slope[i] = instance.slope[i]; });
    if (m <= small_gram) {
      each(m * m, [&](int i) { room.table[i] = gram[i]; });
      gram = room.table;
    }
    block.sync();
    apply_gram(gram);
    block.sync();
    assemble();
    block.sync();
    eliminate(block, room.table, model.latents, columns());
    store();
  }

 private:
  GRAUPEL_HD void apply_gram(const double* gram) const {
    const int r = model.latents, m = model.deformation_modes;
    each(m * (1 + r), [&](int i) {
      const int k = i % m, j = i / m;
      double sum = 0;
      for (int l = 0; l < m; ++l) sum += gram[int64_t(l) * m + k] * (j == r ? room.ahead[l] : room.slope[l * r + j]);
      room.turned[k * (1 + r) + j] = sum;
    });
  }

  GRAUPEL_HD int columns() const { return model.latents + model.deformation_modes + 1; }

  /// M, S^T and S^T G d; d^T G d.
  GRAUPEL_HD void assemble() const {
    const int r = model.latents, m = model.deformation_modes;
    NormalEquations& to = *instance.equations;
    each((1 + r) * (1 + r), [&](int e) {
      const int i = e / (1 + r), j = e % (1 + r);
      if (i == r && j < r) return;
      double sum = 0;
      for (int k = 0; k < m; ++k)
        sum += (i == r ? room.ahead[k] : room.slope[k * r + i]) * room.turned[k * (1 + r) + j];
      if (i == r) {
        to.square = sum;
      } else if (j == r) {
        to.turned[i] = room.table[i * columns() + r + m] = sum;
      } else {
        to.matrix[i * r + j] = room.table[i * columns() + j] = sum;
      }
    });
    each(r * m, [&](int e) { room.table[e / m * columns() + r + e % m] = room.slope[e % m * r + e / m]; });
  }

  /// P, p, and whether they can be trusted.
  GRAUPEL_HD void store() const {
    const int r = model.latents, m = model.deformation_modes, width = columns();
    const double* const A = room.table;
    NormalEquations& to = *instance.equations;
    each(r * (m + 1), [&](int e) {
      const int j = e / (m + 1), c = e % (m + 1);
      const double x = A[j * width + r + c] / A[j * width + j];
      (c == m ? to.offset[j] : to.solution[j * m + c]) = x;
    });
    if (block.thread() != 0) return;
    const Pivots pivots(A, r, width);
    to.condition = pivots.condition();
    to.solved = pivots.fine ? 1 : 0;
  }
};

}  // namespace graupel::rom::device
