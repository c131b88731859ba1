#include "rom/cuda/device_tables.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel/parallel_for.h"
#include "core/system/error.h"
#include "rom/deformation/mode_deformation.h"
#include "rom/fields/deformation_fields.h"
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

namespace {

/// u_k of particles, as a table of a field with the reference body as its mean, [particles, 3, modes].
ModeTable table_of(const ModeDeformation& map, const std::vector<float>& reference) {
  const auto n = static_cast<int64_t>(reference.size() / 3);
  ModeTable table;
  table.components = 3;
  table.modes = map.latents();
  table.mean = reference;
  table.basis.resize(reference.size() * static_cast<std::size_t>(table.modes));
  const auto one = [&](int64_t p) {
    const ModeStencil stencil(map.lattice(), point_of(reference, p));
    for (int k = 0; k < table.modes; ++k) {
      const Vec3d u = map.mode(stencil, k);
      for (int c = 0; c < 3; ++c)
        table.basis[static_cast<std::size_t>((3 * p + c) * table.modes + k)] = static_cast<float>(u[c]);
    }
  };
  parallel_for_cpu(n, one, Grain{64});
  return table;
}

/// Modes, their slopes and places of the integration points, in groups of 32.
void add_points(const ModeDeformation& map, const std::vector<float>& reference, ModelTable& to) {
  const int64_t groups = (to.points() + warp_width - 1) / warp_width, modes = map.latents();
  to.point_modes.assign(static_cast<std::size_t>(groups * modes * mode_components * warp_width), 0.0f);
  to.point_reference.assign(static_cast<std::size_t>(groups * 3 * warp_width), 0.0f);
  const auto one = [&](int64_t i) {
    const int64_t group = i / warp_width, lane = i % warp_width;
    const Vec3d X = point_of(reference, to.point_particle[static_cast<std::size_t>(i)]);
    const ModeStencil stencil(map.lattice(), X);
    const auto put = [&](std::vector<float>& into, int64_t row, double value) {
      into[static_cast<std::size_t>(row * warp_width + lane)] = static_cast<float>(value);
    };
    for (int c = 0; c < 3; ++c) put(to.point_reference, 3 * group + c, X[c]);
    for (int k = 0; k < modes; ++k) {
      const int64_t row = (group * modes + k) * mode_components;
      const Vec3d u = map.mode(stencil, k);
      const Mat3d slope = map.mode_slope(stencil, k);
      for (int c = 0; c < 3; ++c) put(to.point_modes, row + c, u[c]);
      for (int c = 0; c < 9; ++c) put(to.point_modes, row + 3 + c, slope(c / 3, c % 3));
    }
  };
  parallel_for_cpu(int64_t{to.points()}, one, Grain{64});
}

/// (U^T U)^-1, with the ridge that all fits have (rom/projection/gauss_newton.cpp).
void add_inverse(ModelTable& to) {
  constexpr double ridge = 1e-12;  // of the mean diagonal
  const auto m = static_cast<Eigen::Index>(to.deformation_modes);
  Eigen::MatrixXd gram = Eigen::Map<const Eigen::MatrixXd>(to.gram.data(), m, m);
  gram.diagonal().array() += ridge * gram.trace() / static_cast<double>(m);
  const Eigen::LLT<Eigen::MatrixXd> factor(gram);
  if (factor.info() != Eigen::Success)
    throw ConfigError(
        "the samples of the reduced model do not tell its latents apart (their normal equations are singular). Use "
        "more samples");
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(m, m));
  to.inverse.assign(inverse.data(), inverse.data() + inverse.size());
  const auto diagonal = factor.matrixLLT().diagonal();
  to.condition = std::pow(diagonal.maxCoeff() / diagonal.minCoeff(), 2);
}

ModelTable deformation_table(const ReducedModel& model, const Deformation& deformation,
                             const std::vector<int32_t>& samples) {
  const auto* const map = dynamic_cast<const ModeDeformation*>(&deformation);
  if (map == nullptr)
    throw ConfigError(
        "deformation maps that are networks run on the CPU only (allowed on the GPU: map=modes). Use --device cpu, or "
        "train the model with map=modes");
  ModelTable table;
  table.latents = table.deformation_modes = map->latents();
  check_size("latents", table.latents, most_latents);
  table.point_particle = model.clusters.representatives();
  const ModeTable modes = table_of(*map, model.reference);
  add_deformation(modes, table);
  add_samples(modes, samples, table);
  add_gram(table);
  add_inverse(table);
  add_points(*map, model.reference, table);
  return table;
}

}  // namespace

ModelTable model_table(const ReducedModel& model, const std::vector<int32_t>& samples) {
  if (const auto* const alone = dynamic_cast<const DeformationFields*>(model.fields.get()))
    return deformation_table(model, alone->deformation(), samples);
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
  check_size("latents", table.latents, most_closure_latents);
  check_size("parameters", static_cast<int>(model.parameters.size()), most_closure_latents);
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
                     : !scene.loads.empty()                       ? "loads"
                     : scene.has_changing_gravity()               ? "gravity that changes"
                                                                  : nullptr;
  if (what != nullptr)
    throw ConfigError(
        fmt::format("reduced models on the GPU know no {} (scene '{}'). Use --device cpu", what, scene.name));
}

InstanceTable instance_table(const ReducedModel& model, mpm::PreparedScene prepared, const LatentState& state) {
  InstanceTable table{std::move(prepared), state.parameters, state.latent, state.velocity, {}, {}, {}, {}};
  table.point_weight = model.integration_points(table.prepared.particles.volume).weight;
  if (const auto* const alone = dynamic_cast<const DeformationFields*>(model.fields.get())) {
    table.coefficient = dynamic_cast<const ModeDeformation&>(alone->deformation()).away_from_rest(state);
    table.rate = state.velocity;
    return table;
  }
  const auto& fields = dynamic_cast<const FactoredFields&>(*model.fields);
  const ClosureBranch& branch = fields.deformation_branch();
  const auto m = static_cast<std::size_t>(branch.count()), r = static_cast<std::size_t>(branch.latents());
  table.curve = curve_of(model, state.parameters);
  table.coefficient.resize(m);
  table.rate.assign(m, 0.0);
  std::vector<double> slope(m * r);
  branch.coefficients(state.latent.data(), table.coefficient.data());
  branch.jacobian(state.latent.data(), slope.data());
  for (std::size_t k = 0; k < m; ++k)
    for (std::size_t j = 0; j < r; ++j) table.rate[k] += slope[k * r + j] * state.velocity[j];
  return table;
}

namespace {

/// What no kernel does for this model, or null.
const char* unknown_option(const ReducedModel& model, const ReducedOptions& options) {
  const bool pulled = options.manifold_pull.value_or(model.manifold_pull) > 0;
  if (options.quadrature.value_or(model.quadrature) != QuadratureKind::lagrangian)
    return "have Lagrangian quadrature alone (quadrature)";
  if (model.fields->stress_follows_deformation()) {
    if (model.gradient == GradientKind::integrated) return "take F of the map alone (gradient integrated)";
    return pulled ? "take no way back to training runs where they have no stress field (manifold_pull)" : nullptr;
  }
  if (options.projection.value_or(model.projection) != ProjectionKind::position)
    return "project positions alone where they have a stress field (projection)";
  if (options.iterations.value_or(1) > 1) return "take one iteration of the inversion (iterations)";
  return pulled && curve_of(model, std::vector<double>(model.parameters.size(), 0)).empty()
             ? "take no way back to training runs of several parameters or lengths (manifold_pull)"
             : nullptr;
}

}  // namespace

void check_options(const ReducedModel& model, const ReducedOptions& options) {
  if (const char* const what = unknown_option(model, options))
    throw ConfigError(fmt::format("reduced models on the GPU {}. Use --device cpu, or a model without it", what));
}

}  // namespace graupel::rom::device
