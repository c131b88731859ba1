// Red-black sweeps over the cells that hold matter, a thread's first cells of each colour in its registers
// (density_solver.h).
#pragma once

#include <cstdint>

#include "graph/corrections/density_solver.h"

namespace graupel::graph::density {

/// A cell and what is not changed by sweeps.
struct SweptCell {
  int32_t cell = -1;  ///< none
  Equation equation;
  float pressure, lower[3], upper[3];  ///< open fractions of the faces
};

/// The sweeps of one of `threads` threads, which wait for each other between the colours.
template <int cells_a_thread>
class Sweeps {
 public:
  /// Cells begin[0] to begin[1] - 1 are of the first colour, begin[1] to begin[2] - 1 of the second.
  __device__ Sweeps(const DensitySystem& system, int32_t thread, int32_t threads, const int32_t (&begin)[3])
      : s_(system), threads_(threads), begin_{begin[0], begin[1], begin[2]}, thread_(thread) {}

  /// `wait`: until all threads are there.
  template <typename Wait>
  __device__ void run(const Wait& wait) {
    SweptCell register_cells[2][cells_a_thread];
#pragma unroll
    for (int color = 0; color < 2; ++color) {
#pragma unroll
      for (int j = 0; j < cells_a_thread; ++j)
        if (number(color, j) < begin_[color + 1]) register_cells[color][j] = taken(number(color, j));
      for (int32_t k = number(color, cells_a_thread); k < begin_[color + 1]; k += threads_)
        s_.equation[k] = taken(k).equation;
    }
    for (int sweep = 0; sweep < s_.sweeps; ++sweep)
#pragma unroll
      for (int color = 0; color < 2; ++color) {
#pragma unroll
        for (int j = 0; j < cells_a_thread; ++j)
          if (register_cells[color][j].cell >= 0) relax(register_cells[color][j]);
        for (int32_t k = number(color, cells_a_thread); k < begin_[color + 1]; k += threads_) relax_again(k);
        if (color == 0 || sweep + 1 < s_.sweeps) wait();
      }
  }

 private:
  __device__ int32_t number(int color, int j) const { return begin_[color] + thread_ + j * threads_; }

  /// Cell number k; its mass is used up.
  __device__ SweptCell taken(int32_t k) {
    SweptCell swept = with_faces(k);
    swept.equation = equation_of(s_.mass[swept.cell], s_.open_fractions[swept.cell], swept.upper);
    s_.mass[swept.cell] = 0;
    return swept;
  }
  __device__ SweptCell with_faces(int32_t k) {
    SweptCell swept;
    swept.cell = __ldcg(s_.cell + k);
    const OpenFractions own = s_.open_fractions[swept.cell];
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      swept.lower[d] = own.face[d];
      swept.upper[d] = s_.open_fractions[swept.cell + s_.cells.stride(d)].face[d];
    }
    swept.pressure = __ldcg(s_.pressure + swept.cell);
    return swept;
  }
  __device__ void relax(SweptCell& swept) {
    if (swept.equation.inverse_sum == 0) return;
    float below[3], above[3], sum = swept.equation.excess;
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      below[d] = __ldcg(s_.pressure + swept.cell - s_.cells.stride(d));
      above[d] = __ldcg(s_.pressure + swept.cell + s_.cells.stride(d));
    }
#pragma unroll
    for (int d = 0; d < 3; ++d) sum += swept.lower[d] * below[d] + swept.upper[d] * above[d];
    swept.pressure = relaxed(swept.pressure, sum, swept.equation.inverse_sum, s_.relaxation);
    s_.pressure[swept.cell] = swept.pressure;
  }
  /// A cell beyond those in registers.
  __device__ void relax_again(int32_t k) {
    SweptCell swept = with_faces(k);
    swept.equation = s_.equation[k];
    relax(swept);
  }

  const DensitySystem& s_;
  int32_t threads_, begin_[3], thread_;
};

}  // namespace graupel::graph::density
