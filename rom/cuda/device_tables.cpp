#include "rom/cuda/device_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/system/error.h"
#include "rom/fields/factored_fields.h"
#include "rom/projection/latent_manifold.h"
#include "rom/reduced_model.h"
#include "rom/reduced_solver.h"

namespace graupel::rom::device {

namespace {

MapTable map_table(const BranchMap& branch) {
  if (branch.kind() != BranchKind::rbf)
    throw ConfigError(
        "reduced models with networks for branches run on the CPU only (allowed on the GPU: branch=rbf). Use --device "
        "cpu, or train the model with branch=rbf");
  const auto& map = dynamic_cast<const CoefficientMap&>(branch);
  const CoefficientMap::Parts parts = map.parts();
  return {map.inputs(), map.outputs(), parts.count,   parts.shift,   parts.scale,
          parts.low,    parts.high,    parts.centers, parts.weights, parts.linear};
}

int padded(int modes, int group) { return (modes + group - 1) / group * group; }

/// Rows of some points in pairs of f16 over each mode's largest value, group by group of modes; components in `order`
/// (-1: none).
void add_field(const ModeTable& table, const std::vector<int32_t>& points, const std::vector<int>& order,
               std::vector<uint32_t>& modes, std::vector<float>& scale) {
  const int stride = padded(table.modes, field_group);
  scale = table.amplitude();
  scale.resize(static_cast<std::size_t>(stride), 1.0f);
  modes.reserve(points.size() * order.size() * static_cast<std::size_t>(stride / 2));
  const auto half = [&](int64_t row, int component, int k) -> uint32_t {
    if (row < 0 || component < 0 || k >= table.modes) return 0;
    const auto from = static_cast<std::size_t>((row * table.components + component) * table.modes + k);
    return nn::f16_from_float(table.basis[from] / scale[static_cast<std::size_t>(k)]);
  };
  for (const int32_t point : points) {
    const int64_t row = table.row_of(point);
    for (int first = 0; first < stride; first += field_group)
      for (const int component : order)
        for (int k = first; k < first + field_group; k += 2)
          modes.push_back(half(row, component, k) | half(row, component, k + 1) << 16);
  }
}

void add_means(const FactoredFields& fields, const std::vector<int>& stress_order, ModelTable& to) {
  for (const int32_t point : to.point_particle) {
    const int64_t stress = fields.stress().row_of(point), affine = fields.affine().row_of(point);
    for (const int component : stress_order)
      to.field_mean.push_back(stress < 0 ? 0.0f
                                         : fields.stress().mean[static_cast<std::size_t>(6 * stress + component)]);
    for (int c = 0; c < 9; ++c)
      to.field_mean.push_back(affine < 0 ? 0.0f : fields.affine().mean[static_cast<std::size_t>(9 * affine + c)]);
  }
}

void add_deformation(const ModeTable& table, ModelTable& to) {
  const int stride = padded(table.modes, deformation_group);
  to.deformation_mean = table.mean;
  to.deformation.assign(table.mean.size() * static_cast<std::size_t>(stride), 0.0f);
  const auto modes = static_cast<std::size_t>(table.modes);
  for (std::size_t row = 0; row < table.mean.size(); ++row)
    std::copy_n(table.basis.begin() + static_cast<std::ptrdiff_t>(row * modes), modes,
                to.deformation.begin() + static_cast<std::ptrdiff_t>(row * static_cast<std::size_t>(stride)));
}

void add_samples(const ModeTable& table, const std::vector<int32_t>& samples, ModelTable& to) {
  to.samples = samples;
  const auto modes = static_cast<std::size_t>(table.modes), rows = 3 * samples.size();
  to.sample_modes.resize(modes * rows);
  for (std::size_t s = 0; s < samples.size(); ++s)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t from = 3 * static_cast<std::size_t>(samples[s]) + c, row = 3 * s + c;
      to.sample_mean.push_back(static_cast<double>(table.mean[from]));
      for (std::size_t k = 0; k < modes; ++k) to.sample_modes[k * rows + row] = table.basis[from * modes + k];
    }
}

/// U^T U of the samples.
void add_gram(ModelTable& to) {
  const auto m = static_cast<Eigen::Index>(to.deformation_modes);
  const auto rows = static_cast<Eigen::Index>(3 * to.samples.size());
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::MatrixXd modes = Eigen::Map<const RowMajor>(to.sample_modes.data(), m, rows).cast<double>();
  const Eigen::MatrixXd gram = modes * modes.transpose();
  to.gram.assign(gram.data(), gram.data() + gram.size());
}

void check_size(const char* what, int value, int most) {
  if (value > most)
    throw ConfigError(
        fmt::format("the reduced model has {} {}, too many for the GPU (allowed: up to {}). Use --device "
                    "cpu, or train a model with fewer",
                    value, what, most));
}

/// Where runs go at these parameters, [n, latents]; nothing where that is not known.
std::vector<double> curve_of(const ReducedModel& model, const std::vector<double>& parameters) {
  if (parameters.size() != 1) return {};
  const LatentManifold manifold(model.training_latents, model.latents(), model.training_run, 2);
  const Eigen::MatrixXd curve = manifold.between(model.run_parameters, parameters.front());
  return {curve.data(), curve.data() + curve.size()};
}

}  // namespace

ModelTable model_table(const ReducedModel& model, const std::vector<int32_t>& samples) {
  const auto* const fields = dynamic_cast<const FactoredFields*>(static_cast<const Fields*>(model.fields.get()));
  if (fields == nullptr)
    throw ConfigError(
        "reduced models with networks for fields run on the CPU only (allowed on the GPU: factored fields). Use "
        "--device cpu");
  if (!fields->has_stress())
    throw ConfigError("reduced models without a stress field (stress=law) run on the CPU only. Use --device cpu");
  ModelTable table;
  table.latents = model.latents();
  table.deformation_modes = fields->deformation().modes;
  table.stress_modes = fields->stress().modes;
  table.affine_modes = fields->affine().modes;
  check_size("latents", table.latents, most_latents);
  check_size("parameters", static_cast<int>(model.parameters.size()), most_latents);
  check_size("modes of the deformation", table.deformation_modes, most_deformation_modes);
  check_size("modes of the stress", table.stress_modes, most_field_modes);
  check_size("modes of the affine velocity", table.affine_modes, most_field_modes);
  table.point_particle = model.clusters.representatives();
  const std::vector<int> stress_order = {0, 3, 5, 1, 2, 4};  // as mpm's arrays: xx, yy, zz, xy, xz, yz
  add_deformation(fields->deformation(), table);
  add_field(fields->stress(), table.point_particle, stress_order, table.stress, table.stress_scale);
  add_field(fields->affine(), table.point_particle, {0, 1, 2, 3, 4, 5, 6, 7, 8, -1}, table.affine, table.affine_scale);
  add_means(*fields, stress_order, table);
  add_samples(fields->deformation(), samples, table);
  add_gram(table);
  table.closure = map_table(fields->deformation_branch().map());
  table.stress_map = map_table(fields->stress_branch().map());
  table.affine_map = map_table(fields->affine_branch().map());
  table.affine_is_rate = model.affine_kind == AffineKind::rate;
  return table;
}

void check_scene(const Scene& scene) {
  const char* what = scene.domain.is_plane()                      ? "a plane"
                     : scene.transfer.spline != Spline::quadratic ? "cubic splines"
                     : scene.domain.has_wall(Wall::periodic)      ? "periodic walls"
                     : scene.has_inactive_particles()             ? "particles that come or go"
                                                                  : nullptr;
  if (what != nullptr)
    throw ConfigError(
        fmt::format("reduced models on the GPU know no {} (scene '{}'). Use --device cpu", what, scene.name));
}

InstanceTable instance_table(const ReducedModel& model, mpm::PreparedScene prepared, const LatentState& state) {
  const auto& fields = dynamic_cast<const FactoredFields&>(static_cast<const Fields&>(*model.fields));
  const ClosureBranch& branch = fields.deformation_branch();
  const auto m = static_cast<std::size_t>(branch.count()), r = static_cast<std::size_t>(branch.latents());
  InstanceTable table{std::move(prepared), state.parameters, state.latent, state.velocity, {}, {}, {}, {}};
  table.curve = curve_of(model, state.parameters);
  table.point_weight = model.integration_points(table.prepared.particles.volume).weight;
  table.coefficient.resize(m);
  table.rate.assign(m, 0.0);
  std::vector<double> slope(m * r);
  branch.coefficients(state.latent.data(), table.coefficient.data());
  branch.jacobian(state.latent.data(), slope.data());
  for (std::size_t k = 0; k < m; ++k)
    for (std::size_t j = 0; j < r; ++j) table.rate[k] += slope[k * r + j] * state.velocity[j];
  return table;
}

void check_options(const ReducedModel& model, const ReducedOptions& options) {
  const bool pulled = options.manifold_pull.value_or(model.manifold_pull) > 0;
  const bool by_position = options.projection.value_or(model.projection) == ProjectionKind::position,
             lagrangian = options.quadrature.value_or(model.quadrature) == QuadratureKind::lagrangian;
  const char* what = !by_position                         ? "project positions alone (projection)"
                     : !lagrangian                        ? "have Lagrangian quadrature alone (quadrature)"
                     : options.iterations.value_or(1) > 1 ? "take one iteration of the inversion (iterations)"
                     : pulled && curve_of(model, std::vector<double>(model.parameters.size(), 0)).empty()
                         ? "take no way back to training runs of several parameters or lengths (manifold_pull)"
                         : nullptr;
  if (what != nullptr)
    throw ConfigError(fmt::format("reduced models on the GPU {}. Use --device cpu, or a model without it", what));
}

}  // namespace graupel::rom::device
