// The few values that offsets between cells have, as inputs of an nn::InputTable.
#pragma once

#include <vector>

namespace graupel::graph {

using Offsets = std::vector<std::vector<float>>;

/// Unit vectors from the sender in a neighbour slot (-x, +x, -y, ..) to the receiver.
inline Offsets slot_directions() { return {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}; }

/// sign * (bits of 0 to 7 - middle) along the axes.
inline Offsets bit_offsets(float sign, float middle) {
  Offsets all;
  for (int bits = 0; bits < 8; ++bits) {
    all.emplace_back();
    for (int axis = 0; axis < 3; ++axis) all.back().push_back(sign * (static_cast<float>(bits >> axis & 1) - middle));
  }
  return all;
}
/// sign * (centre_fine - centre_coarse)/spacing_fine, by the octant of the fine cell.
inline Offsets octant_offsets(float sign) { return bit_offsets(sign, 0.5f); }
/// sign * (place of the corner), by the corner of a particle's cells.
inline Offsets corner_offsets(float sign) { return bit_offsets(sign, 0); }
inline Offsets axis_offsets(float sign) { return {{sign, 0, 0}, {0, sign, 0}, {0, 0, sign}}; }

}  // namespace graupel::graph
