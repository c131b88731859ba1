#include "train/reduced/mlp_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/system/error.h"
#include "train/reduced/mlp/standardize.h"

namespace graupel::train {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

/// [snapshots, particles, 3] to [snapshots, 3, particles].
std::vector<float> by_channel(const std::vector<float>& values, std::size_t particles) {
  const std::size_t row = 3 * particles;
  std::vector<float> channels(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) channels[i / row * row + i % 3 * particles + i % row / 3] = values[i];
  return channels;
}

}  // namespace

rom::Mlp MlpStage::network(const nn::Weights& weights) const {
  return {rom::Mlp::load_layers(weights, "", shape.inputs(), shape.width, shape.outputs), input, inverse_scale(output)};
}

MlpSweep::MlpSweep(const std::string& data, const NsfConfig& config, std::function<void(const std::string&)> message)
    : config_(config), message_(std::move(message)), snapshots_(data, config, nsf_fields) {}

MlpStage MlpSweep::prepare(int number, Device device) {
  const MlpConfig& mlp = config_.mlp;
  const MlpStageKind& kind = mlp_stage_kinds[number];
  const int64_t betas[] = {mlp.deformation_beta, mlp.stress_beta, mlp.affine_beta};
  MlpStage stage;
  stage.shape.latents = static_cast<int>(config_.latents);
  const bool sees_parameters = number == 1 || (number == 2 && mlp.affine_input == AffineInput::parameters);
  stage.shape.parameters = sees_parameters ? static_cast<int>(snapshots_.set().parameters().size()) : 0;
  stage.shape.outputs = components_of(kind.field);
  stage.shape.width = mlp.width(betas[number], stage.shape.outputs);
  if (number == 0 && conv()) stage.shape.encoder_particles = snapshots_.set().particles();
  stage.module.emplace(stage.shape, device, config_.seed);
  set_points(number, stage);
  if (number == 0) set_positions(stage);
  set_states(stage);
  if (number > 0) set_output(stage, snapshots_.read_means(kind.field));
  return stage;
}

std::vector<float> MlpSweep::reference() const {
  std::vector<float> all;
  for (const Vec3f& x : snapshots_.set().reference()) all.insert(all.end(), x.a, x.a + 3);
  return all;
}

/// X of the particles or of the clusters' representatives, standardised.
void MlpSweep::set_points(int number, MlpStage& stage) const {
  const std::vector<float> all = reference();
  stage.input = standardization_of(all, 3);
  std::vector<float> points;
  if (number == 0) {
    points = all;
  } else {
    for (const int32_t p : snapshots_.representatives()) {
      const auto begin = all.begin() + 3 * static_cast<std::ptrdiff_t>(p);
      points.insert(points.end(), begin, begin + 3);
    }
  }
  standardize(points, stage.input);
  stage.module->set_points(points);
  stage.points = static_cast<int64_t>(points.size()) / 3;
}

/// (q, mu) of the snapshots, q as it is and mu standardised.
void MlpSweep::set_states(MlpStage& stage) const {
  stage.input.shift.resize(static_cast<std::size_t>(stage.shape.inputs()), 0.0);
  stage.input.scale.resize(static_cast<std::size_t>(stage.shape.inputs()), 1.0);
  if (stage.shape.encoder_particles > 0) return;
  const MatrixXd z = snapshots_.inputs(latents_);
  const std::vector<SweptParameter>& parameters = snapshots_.set().parameters();
  for (int i = 0; i < stage.shape.parameters; ++i) {
    const std::vector<double>& values = parameters[static_cast<std::size_t>(i)].values;
    const rom::Standardization s = standardization_of({values.begin(), values.end()}, 1);
    stage.input.shift[static_cast<std::size_t>(3 + stage.shape.latents + i)] = s.shift[0];
    stage.input.scale[static_cast<std::size_t>(3 + stage.shape.latents + i)] = s.scale[0];
  }
  std::vector<float> states;
  for (Index i = 0; i < z.rows(); ++i)
    for (Index j = 0; j < stage.shape.latents + stage.shape.parameters; ++j) {
      const auto at = static_cast<std::size_t>(3 + j);
      states.push_back(static_cast<float>((z(i, j) - stage.input.shift[at]) * stage.input.scale[at]));
    }
  stage.module->set_states(states);
}

/// Displacements as targets; the latents of the snapshots, or what the encoder finds them from.
void MlpSweep::set_positions(MlpStage& stage) {
  std::vector<float> position = snapshots_.read(SnapshotField::position);
  const std::size_t particles = snapshots_.set().reference().size();
  if (conv()) {
    position_ = standardization_of(position, 3);
    std::vector<float> channels = position;
    standardize(channels, position_);
    stage.module->set_encoder_positions(by_channel(channels, particles));
  }
  set_latents(position);
  for (std::size_t i = 0; i < position.size(); ++i)
    position[i] -= snapshots_.set().reference()[i % (3 * particles) / 3][static_cast<int>(i % 3)];
  set_output(stage, std::move(position));
}

/// The positions' modes and, without the encoder, the coefficients that are the latents.
void MlpSweep::set_latents(const std::vector<float>& position) {
  const auto r = static_cast<Index>(config_.latents);
  MatrixBlocks blocks(snapshots_.matrix(position));
  const Pod modes = pod(blocks, static_cast<int>(config_.deformation_modes));
  if (modes.modes() < r)
    throw ConfigError(fmt::format(
        "{} latents are more than the modes that the snapshots have ({}). Set latents lower, or train on more runs", r,
        modes.modes()));
  if (!conv()) {
    latents_ = modes.coefficients.leftCols(r);
    latent_tail_ = modes.tail(static_cast<int>(r));
    if (message_) message_(fmt::format("latent: {} modes leave out {:.3g} %", r, 100 * latent_tail_));
  }
}

void MlpSweep::set_output(MlpStage& stage, std::vector<float> values) const {
  stage.output = standardization_of(values, static_cast<std::size_t>(stage.shape.outputs));
  standardize(values, stage.output);
  stage.module->set_targets(values, config_.mlp.memory_limit * 1e9);
}

std::optional<rom::ConvEncoder> MlpSweep::take_encoder(const MlpStage& stage, const nn::Weights& weights) {
  if (stage.shape.encoder_particles == 0) return std::nullopt;
  const int64_t count = snapshots_.set().snapshots();
  latents_.resize(count, stage.shape.latents);
  for (int64_t i = 0; i < count; ++i) {
    const std::vector<double> q = stage.module->encode({i});
    for (std::size_t j = 0; j < q.size(); ++j) latents_(i, static_cast<Index>(j)) = q[j];
  }
  return rom::ConvEncoder::load(weights, "encoder", stage.shape.encoder_particles, stage.shape.latents, position_);
}

/// Root of the mean square of every latent.
std::vector<double> MlpSweep::latent_scale() const {
  std::vector<double> scale;
  for (Index j = 0; j < latents_.cols(); ++j) {
    const Eigen::VectorXd q = latents_.col(j).array() - latents_.col(j).mean();
    scale.push_back(conv() ? std::max(std::sqrt(q.squaredNorm() / static_cast<double>(q.size())), 1e-6) : 1.0);
  }
  return scale;
}

void MlpSweep::describe(rom::ReducedModel& model) const { snapshots_.describe(latents_, latent_scale(), model); }

}  // namespace graupel::train
