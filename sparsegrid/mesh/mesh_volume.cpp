// Divergence theorem for each part, and a correction for what overlapping parts share, integrated along lines in z.
#include "sparsegrid/mesh/mesh_volume.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "sparsegrid/mesh/line_crossing.h"
#include "sparsegrid/mesh/mesh_parts.h"

namespace graupel::sparsegrid {

namespace {

constexpr int lines = 256;  ///< along x and y

/// Where a line enters or leaves a part.
struct Crossing {
  int32_t line;
  double z;
  int32_t part;
  int32_t turn;  ///< of the winding number
  bool operator<(const Crossing& other) const { return std::pair(line, z) < std::pair(other.line, other.z); }
};

/// Lines in z through the middles of lines x lines cells of a rectangle.
struct Lines {
  LocalBox box = {Vec3d::filled(1e300), Vec3d::filled(-1e300)};
  double step(int d) const { return (box.high[d] - box.low[d]) / lines; }
  double place(int d, int i) const { return box.low[d] + (i + 0.5) * step(d); }
  int first(int d, double x) const { return index((x - box.low[d]) / step(d) - 0.5); }
  int last(int d, double x) const { return index((x - box.low[d]) / step(d) + 0.5); }
  static int index(double i) { return static_cast<int>(std::min(std::max(0.0, i), double(lines - 1))); }
};

LocalBox shared_box(const LocalBox& a, const LocalBox& b) {
  LocalBox box;
  for (int d = 0; d < 3; ++d) box.low[d] = std::max(a.low[d], b.low[d]), box.high[d] = std::min(a.high[d], b.high[d]);
  return box;
}

/// Around all that the boxes of two parts share; `meets` are those parts.
Lines lines_of(const std::vector<MeshPart>& parts, std::vector<uint8_t>& meets) {
  std::vector<std::size_t> order(parts.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return parts[a].box.low[0] < parts[b].box.low[0]; });
  meets.assign(parts.size(), 0);
  Lines all;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      const MeshPart &a = parts[order[i]], &b = parts[order[j]];
      if (b.box.low[0] >= a.box.high[0]) break;
      const LocalBox box = shared_box(a.box, b.box);
      if (!(box.low[0] < box.high[0] && box.low[1] < box.high[1] && box.low[2] < box.high[2])) continue;
      meets[order[i]] = meets[order[j]] = 1;
      for (int d = 0; d < 3; ++d) {
        all.box.low[d] = std::min(all.box.low[d], box.low[d]);
        all.box.high[d] = std::max(all.box.high[d], box.high[d]);
      }
    }
  return all;
}

void cross_triangle(const Vec3d& a, const Vec3d& b, const Vec3d& c, int32_t part, const Lines& all,
                    std::vector<Crossing>& crossings) {
  int first[2], last[2];
  for (int d = 0; d < 2; ++d) {
    first[d] = all.first(d, std::min({a[d], b[d], c[d]}));
    last[d] = all.last(d, std::max({a[d], b[d], c[d]}));
  }
  for (int i = first[0]; i <= last[0]; ++i)
    for (int j = first[1]; j <= last[1]; ++j) {
      if (const auto hit = crossing(a, b, c, all.place(0, i), all.place(1, j)))
        crossings.push_back({i * lines + j, hit->z, part, hit->turn});
    }
}

/// Along a line: the length inside, less the sum of the parts' lengths with their signs.
double excess_length(const std::vector<MeshPart>& parts, const Crossing* begin, const Crossing* end) {
  std::map<int32_t, int> winding;
  double excess = 0;
  for (const Crossing* at = begin; at != end; ++at) {
    winding[at->part] += at->turn;
    if (at + 1 == end) break;
    int level = -1, sum = 0;
    for (const auto& [number, turns] : winding) {
      const MeshPart& part = parts[static_cast<std::size_t>(number)];
      if (turns == 0) continue;
      level = std::max(level, part.level);
      sum += turns * (part.volume < 0 ? -1 : 1) * (part.is_solid() ? 1 : -1);
    }
    const int inside = level >= 0 && level % 2 == 0 ? 1 : 0;
    if (inside != sum) excess += (inside - sum) * (at[1].z - at[0].z);
  }
  for (const auto& [number, turns] : winding)
    if (turns != 0) return 0;  // through a vertex
  return excess;
}

double excess_volume(const TriangleMesh& mesh, const std::vector<MeshPart>& parts) {
  std::vector<uint8_t> meets;
  const Lines all = lines_of(parts, meets);
  std::vector<Crossing> crossings;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (!meets[p]) continue;
    for (const int32_t t : parts[p].triangles) {
      const auto& v = mesh.triangles[static_cast<std::size_t>(t)];
      const auto corner = [&](int i) -> const Vec3d& { return mesh.vertices[static_cast<std::size_t>(v[i])]; };
      cross_triangle(corner(0), corner(1), corner(2), static_cast<int32_t>(p), all, crossings);
    }
  }
  std::sort(crossings.begin(), crossings.end());
  double length = 0;
  for (std::size_t i = 0, end; i < crossings.size(); i = end) {
    for (end = i; end < crossings.size() && crossings[end].line == crossings[i].line;) ++end;
    length += excess_length(parts, crossings.data() + i, crossings.data() + end);
  }
  return length == 0 ? 0 : length * all.step(0) * all.step(1);
}

}  // namespace

double mesh_volume(const TriangleMesh& mesh) {
  const std::vector<MeshPart> parts = parts_of(mesh);
  std::vector<double> sign(mesh.triangles.size(), 1);
  for (const MeshPart& part : parts)
    for (const int32_t t : part.triangles)
      sign[static_cast<std::size_t>(t)] = (part.volume < 0) == part.is_solid() ? -1 : 1;
  double six = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) six += sign[t] * six_volumes(mesh, t);
  const double sum = std::abs(six) / 6;
  return parts.size() < 2 ? sum : std::max(0.0, sum + excess_volume(mesh, parts));
}

}  // namespace graupel::sparsegrid
