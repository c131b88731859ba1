// Sums the normals of the surface samples cell by cell (HGN paper, section 3).
#include "sparsegrid/cell_normals.h"

#include <cmath>
#include <map>
#include <mutex>

#include "core/parallel/buffer.h"
#include "core/system/error.h"
#include "sparsegrid/level_set_grid.h"

namespace graupel::sparsegrid {

namespace {

/// Sum of the normals of the samples in each cell, by (z, y, x).
std::map<std::array<int, 3>, Vec3d> sum_normals(const SurfaceSamples& samples, const Domain& domain) {
  std::map<std::array<int, 3>, Vec3d> sums;
  for (std::size_t i = 0; i < samples.position.size(); ++i) {
    const Vec3d& n = samples.normal[i];
    // A face on the border of two cells counts for the outer one, whichever way its samples were rounded.
    const Vec3d u = (samples.position[i] - domain.origin) * (1 / domain.dx) + n * 1e-4;
    std::array<int, 3> cell;
    Vec3d to_centre;
    for (int d = 0; d < 3; ++d) {
      cell[2 - d] = static_cast<int>(std::floor(u[d]));
      to_centre[d] = std::floor(u[d]) + 0.5 - u[d];
    }
    const auto [sum, is_new] = sums.try_emplace(cell, Vec3d::zero());
    sum->second += dot(n, to_centre) < 0 ? -n : n;
  }
  return sums;
}

}  // namespace

struct CellNormals::Impl {
  Vec3d origin;
  double inverse_spacing = 0;
  VectorGrid grid;
  mutable std::once_flag uploaded;
  mutable Buffer<char> cuda_grid;
};

CellNormals::CellNormals(const Scene& scene, const ObstacleSet& obstacles, const SurfaceChoice& choice) {
  if (obstacles.count() == 0) return;
  const Domain& domain = scene.domain;
  const auto sums = sum_normals(sample_surface(scene, obstacles, domain.dx / 4, /*seed=*/0, choice), domain);
  std::vector<Vec3i> coordinate;
  std::vector<Vec3f> value;
  for (const auto& [cell, sum] : sums) {
    if (!(norm(sum) > 1e-9)) continue;
    coordinate.push_back({cell[2], cell[1], cell[0]});
    value.push_back(normalized(sum).cast<float>());
  }
  auto impl = std::make_shared<Impl>();
  impl->origin = domain.origin;
  impl->inverse_spacing = 1 / domain.dx;
  impl->grid = build_vector_grid(coordinate, value, domain.dx, domain.origin, "cell_normals");
  impl_ = impl;
}

int64_t CellNormals::active_cells() const { return impl_ ? impl_->grid.active_cells : 0; }

std::size_t CellNormals::bytes() const { return impl_ ? impl_->grid.bytes.size() : 0; }

CellNormalsView CellNormals::view(Device device) const {
  if (!impl_) return {};
  CellNormalsView view{impl_->grid.grid(), impl_->origin, impl_->inverse_spacing};
  if (device == Device::cpu) return view;
  std::call_once(impl_->uploaded, [this] {
    const Buffer<char>& host = impl_->grid.bytes;
    impl_->cuda_grid = Buffer<char>(Device::cuda, host.size());
    device_copy(Device::cuda, impl_->cuda_grid.data(), Device::cpu, host.data(), host.size());
  });
  view.grid = reinterpret_cast<const nanovdb::Vec3fGrid*>(impl_->cuda_grid.data());
  return view;
}

void CellNormals::write_vdb(const std::string& path) const {
  if (!impl_) throw ConfigError("there is no obstacle, so no normals to write to '" + path + "'. Add one to the scene");
  write_vector_grid(path, impl_->grid);
}

}  // namespace graupel::sparsegrid
