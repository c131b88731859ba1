#include "train/reduced/crom/crom_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "rom/reduced_solver.h"
#include "train/reduced/crom/mode_fit.h"
#include "train/reduced/crom/reconstruction.h"
#include "train/reduced/mlp/standardize.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

constexpr std::size_t streams = tangent_streams;
constexpr Index most_decomposed = 1000;  ///< snapshots: the time of a decomposition grows as their cube

NsfConfig shared_settings(const CromConfig& config) {
  NsfConfig shared;
  shared.samples = config.samples;
  shared.sample_rule = config.sample_rule;
  shared.sample_low = config.sample_low;
  shared.sample_high = config.sample_high;
  shared.step_factor = config.step_factor;
  shared.encoder_particles = config.encoder_particles;
  shared.seed = config.seed;
  return shared;
}

std::vector<float> reference_of(const SnapshotSet& set) {
  std::vector<float> all;
  for (const Vec3f& x : set.reference()) all.insert(all.end(), x.a, x.a + 3);
  return all;
}

std::vector<float> floats_of(const MatrixXd& m) {
  std::vector<float> values;
  for (Index i = 0; i < m.rows(); ++i)
    for (Index j = 0; j < m.cols(); ++j) values.push_back(static_cast<float>(m(i, j)));
  return values;
}

/// Mean 0 and variance 1 for every component; one that hardly varies is scaled as if it did by a thousandth of the one
/// that varies most, so that errors in it are not larger than the body.
rom::Standardization displacement_scale(const std::vector<float>& values) {
  rom::Standardization s = standardization_of(values, 3);
  double deviation[3] = {}, largest = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double d = static_cast<double>(values[i]) - s.shift[i % 3];
    deviation[i % 3] += 3 * d * d / static_cast<double>(values.size());
  }
  for (double& d : deviation) largest = std::max(largest, d = std::sqrt(d));
  for (std::size_t c = 0; c < 3 && largest > 0; ++c) s.scale[c] = 1 / std::max(deviation[c], 1e-3 * largest);
  return s;
}

}  // namespace

CromSweep::CromSweep(const std::string& data, const CromConfig& config)
    : config_(config),
      shared_(shared_settings(config)),
      snapshots_(data, shared_, {ParticleField::deformation_gradient}) {
  const std::string& file = snapshots_.set().file();
  rom::check_deformation_scene(io::parse_stored_scene(snapshots_.set().scene_json(), file, file));
  const int r = static_cast<int>(config_.latents);
  FieldBlocks positions = snapshots_.blocks(SnapshotField::position, nullptr);
  EveryNthBlocks some(positions, (positions.snapshots() + most_decomposed - 1) / most_decomposed);
  modes_ = pod(some, r);
  snapshots_.add_read_seconds(positions.seconds());
  if (modes_.modes() < r)
    throw ConfigError(fmt::format(
        "{} latents are more than the modes that the snapshots have ({}). Set latents lower, or train on more runs", r,
        modes_.modes()));
  latents_ = latents_of(snapshots_.set());
  input_ = standardization_of(reference_of(snapshots_.set()), 3);
  input_.shift.resize(static_cast<std::size_t>(3 + r), 0.0);
  input_.scale.resize(static_cast<std::size_t>(3 + r), 1.0);
}

MatrixXd CromSweep::latents_of(const SnapshotSet& set) const {
  FieldBlocks positions(set, SnapshotField::position, nullptr, std::numeric_limits<double>::infinity());
  const SnapshotMatrix all = positions.load(0);
  const Eigen::Map<const Eigen::RowVectorXf> mean(modes_.mean.data(), all.cols());
  const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rest = all.rowwise() - mean;
  MatrixBlocks blocks(SnapshotMatrix(rest.data(), rest.rows(), rest.cols()));
  return project(blocks, modes_, modes_.modes());
}

MlpShape CromSweep::shape() const {
  MlpShape shape;
  shape.latents = static_cast<int>(config_.latents);
  shape.width = static_cast<int>(config_.width);
  shape.outputs = 3;
  shape.tangents = true;
  return shape;
}

MlpModule CromSweep::module(Device device, NumberType number) {
  MlpModule module(shape(), device, config_.seed, number);
  std::vector<float> points = reference_of(snapshots_.set());
  standardize(points,
              {{input_.shift.begin(), input_.shift.begin() + 3}, {input_.scale.begin(), input_.scale.begin() + 3}});
  module.set_points(points);
  module.set_states(floats_of(latents()));
  module.set_rates(floats_of(latent_rates(snapshots_.set(), latents())));
  module.set_targets(targets(), config_.memory_limit * 1e9);
  module.set_loss_weights(loss_weights());
  return module;
}

/// [snapshots, particles, streams, 3]: displacements, (F - I) along each axis, velocities, in standardised numbers.
std::vector<float> CromSweep::targets() {
  const SnapshotSet& set = snapshots_.set();
  const std::vector<float> reference = reference_of(set);
  std::vector<float> displacement = snapshots_.read(SnapshotField::position);
  const std::size_t row = reference.size(), rows = displacement.size() / 3;
  for (std::size_t i = 0; i < displacement.size(); ++i) displacement[i] -= reference[i % row];
  output_ = displacement_scale(displacement);
  const std::vector<float> gradient = snapshots_.read(SnapshotField::deformation_gradient);
  std::vector<float> targets(rows * 3 * streams, 0.0f);
  const auto put = [&](std::size_t i, std::size_t stream, std::size_t c, double value) {
    targets[(i * streams + stream) * 3 + c] = static_cast<float>(value * output_.scale[c]);
  };
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      put(i, 0, c, static_cast<double>(displacement[3 * i + c]) - output_.shift[c]);
      for (std::size_t d = 0; d < 3; ++d)
        put(i, 1 + d, c, (static_cast<double>(gradient[9 * i + 3 * c + d]) - (c == d ? 1 : 0)) / input_.scale[d]);
    }
  const std::size_t particles = reference.size() / 3;
  for (int run = 0; run < set.runs(); ++run)
    for (auto s = static_cast<std::size_t>(set.first_snapshot(run));
         s + 1 < static_cast<std::size_t>(set.first_snapshot(run + 1)); ++s)
      for (std::size_t i = s * particles; i < (s + 1) * particles; ++i)
        for (std::size_t c = 0; c < 3; ++c)
          put(i, 4, c, static_cast<double>(displacement[3 * i + row + c] - displacement[3 * i + c]) / set.frame_time());
  return targets;
}

/// So that the loss is (|u - u*|^2 + w_F |F - F*|^2 + w_v |v - v*|^2) / s, each a mean over its entries, s the mean
/// square of the displacement's deviation from its mean.
std::vector<float> CromSweep::loss_weights() const {
  double size = 0;
  for (const double scale : output_.scale) size += 1 / (3 * scale * scale);
  const double entries = 3 * tangent_streams;
  std::vector<float> weights;
  for (std::size_t stream = 0; stream < streams; ++stream)
    for (std::size_t c = 0; c < 3; ++c) {
      double weight = entries / 3;
      if (stream == 4) weight *= config_.velocity_weight;
      if (stream >= 1 && stream <= 3)
        weight *= config_.gradient_weight / 3 * input_.scale[stream - 1] * input_.scale[stream - 1];
      weights.push_back(static_cast<float>(weight / (output_.scale[c] * output_.scale[c] * size)));
    }
  return weights;
}

rom::Mlp CromSweep::network(const nn::Weights& weights) const {
  const MlpShape s = shape();
  return {rom::Mlp::load_layers(weights, "", s.inputs(), s.width, s.outputs), input_, inverse_scale(output_)};
}

rom::ModeDeformation CromSweep::modes(const std::vector<double>& rest) const {
  const std::string& file = snapshots_.set().file();
  const Scene scene = io::parse_stored_scene(snapshots_.set().scene_json(), file, file);
  return fit_modes(snapshots_, latents(), rest,
                   {.spacing = config_.mode_spacing * scene.domain.dx,
                    .origin = scene.domain.origin,
                    .gradient_weight = config_.gradient_weight});
}

void CromSweep::describe(rom::ReducedModel& model) const {
  snapshots_.describe(latents(), std::vector<double>(static_cast<std::size_t>(config_.latents), 1.0), model);
}

}  // namespace graupel::train
