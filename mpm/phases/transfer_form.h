// The forms of the transfers, by the number of dimensions and the spline: constants in the kernels, chosen at run time.
#pragma once

#include <type_traits>

#include "mpm/phases/phases.h"

namespace graupel::mpm {

template <int dimensions, Spline S>
struct TransferForm {
  static constexpr int D = dimensions;
  static constexpr Spline spline = S;
};

/// Calls run(TransferForm) with the form of a run.
template <typename T, typename Run>
void with_form(const SolverView<T>& view, const Run& run) {
  const bool cubic = view.spline == Spline::cubic;
  if (view.dimensions == 2)
    cubic ? run(TransferForm<2, Spline::cubic>{}) : run(TransferForm<2, Spline::quadratic>{});
  else
    cubic ? run(TransferForm<3, Spline::cubic>{}) : run(TransferForm<3, Spline::quadratic>{});
}

/// The part of an arena that lies in the node block at `corner` (bit d: upper along axis d), row by row:
/// visit(offset in the arena, number of the row's first node in its block, nodes of the row as a type, so that loops
/// over them have a fixed length).
template <typename Form, typename Visit>
GRAUPEL_HD inline void for_each_arena_row(int corner, const Visit& visit) {
  constexpr int D = Form::D, overhang = arena_width<Form::spline> - block_width;
  const Vec<int, D> shift = block_width * corner_bits<D>(corner);
  const int rows = shift[0] > 0 ? overhang : block_width;
  const int columns = D == 2 ? 1 : shift[1] > 0 ? overhang : block_width;
  const auto visit_rows = [&](auto nodes) {
    for (int x = 0; x < rows; ++x)
      for (int y = 0; y < columns; ++y) {
        Vec<int, D> c = Vec<int, D>::zero();
        c[0] = x;
        if (D == 3) c[1] = y;
        const int row = D == 3 ? x * block_width + y : x;
        visit(arena_offset<Form::spline>(c + shift), row * block_width, nodes);
      }
  };
  shift[D - 1] > 0 ? visit_rows(std::integral_constant<int, overhang>{})
                   : visit_rows(std::integral_constant<int, block_width>{});
}

}  // namespace graupel::mpm
