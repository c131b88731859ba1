// Settings of the training of the paper's networks (NSF section 4.4, appendix C).
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/scene/fields.h"

namespace graupel::train {

/// Hidden width of a network from its beta (table 1).
enum class WidthRule {
  paper,  ///< beta times the field's components, as printed
  code    ///< 3 beta for every field, as in the authors' code
};

enum class EncoderKind {
  least_squares,  ///< coefficients of the positions' first modes in training, Gauss-Newton at the start of a rollout
  conv            ///< the paper's convolutions, trained with the deformation
};

/// What the affine velocity is a function of beside X.
enum class AffineInput {
  latent,     ///< q, as in the paper
  parameters  ///< q and mu
};

constexpr auto enum_list(WidthRule) {
  return std::to_array<std::pair<const char*, WidthRule>>({{"paper", WidthRule::paper}, {"code", WidthRule::code}});
}
constexpr auto enum_list(EncoderKind) {
  return std::to_array<std::pair<const char*, EncoderKind>>(
      {{"least_squares", EncoderKind::least_squares}, {"conv", EncoderKind::conv}});
}
constexpr auto enum_list(AffineInput) {
  return std::to_array<std::pair<const char*, AffineInput>>(
      {{"latent", AffineInput::latent}, {"parameters", AffineInput::parameters}});
}

struct MlpConfig {
  WidthRule widths = WidthRule::code;
  int64_t deformation_beta = 48, stress_beta = 64, affine_beta = 64;
  EncoderKind encoder = EncoderKind::least_squares;
  AffineInput affine_input = AffineInput::parameters;
  int64_t deformation_epochs = 300, field_epochs = 600;
  double epochs_scale = 1;
  double learning_rate = 1e-3;
  int64_t batch_snapshots = 32, batch_particles = 2000;
  bool tf32 = true;
  double memory_limit = 40;  ///< [GB]
  int64_t log_interval = 200, checkpoint_interval = 2000;

  /// Of the field with so many components.
  int width(int64_t beta, int components) const {
    return static_cast<int>(beta) * (widths == WidthRule::paper ? components : 3);
  }
  /// Learning rate after the share `progress` of a stage: five steps of equal length, NSF appendix C.
  double rate_at(double progress) const {
    constexpr double factors[] = {1, 0.5, 0.2, 0.1, 0.05};
    return learning_rate * factors[std::clamp(static_cast<int>(5 * progress), 0, 4)];
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = MlpConfig;
    const auto count = [&](int64_t C::*member, const char* name, const char* unit, const char* meaning, double most) {
      visit(member, FieldInfo{name, unit, meaning, Range::between(1, most)});
    };
    visit(&C::widths,
          FieldInfo{"widths", "", "Hidden width: beta times the field's components (paper), or 3 beta (code)"});
    count(&C::deformation_beta, "deformation_beta", "", "beta of the deformation's network (table 1 of the paper)",
          1024);
    count(&C::stress_beta, "stress_beta", "", "beta of the stress's network", 1024);
    count(&C::affine_beta, "affine_beta", "", "beta of the affine velocity's network", 1024);
    visit(&C::encoder, FieldInfo{"encoder", "", "What gives the latents: least_squares, or conv"});
    visit(&C::affine_input,
          FieldInfo{"affine_input", "", "The affine velocity follows the latent alone, or the parameters too"});
    count(&C::deformation_epochs, "deformation_epochs", "", "Epochs of each learning rate, deformation", 1e6);
    count(&C::field_epochs, "field_epochs", "", "Epochs of each learning rate, stress and affine velocity", 1e6);
    visit(&C::epochs_scale,
          FieldInfo{"epochs_scale", "", "Times as many epochs of all learning rates", Range::positive()});
    visit(&C::learning_rate,
          FieldInfo{"learning_rate", "", "First learning rate of Adam; then 1/2, 1/5, 1/10 and 1/20 of it",
                    Range::positive()});
    count(&C::batch_snapshots, "batch_snapshots", "", "Snapshots in a batch; an epoch has each of them once", 4096);
    count(&C::batch_particles, "batch_particles", "", "Particles of each snapshot in a batch, drawn anew; at most all",
          1e7);
    visit(&C::tf32, FieldInfo{"tf32", "", "TF32 matrix products on a GPU"});
    visit(&C::memory_limit,
          FieldInfo{"memory_limit", "GB", "A field up to this size lies on the device, else batches are copied",
                    Range::not_negative()});
    count(&C::log_interval, "log_interval", "steps", "Steps between lines of the metrics", 1e9);
    count(&C::checkpoint_interval, "checkpoint_interval", "steps", "Steps between checkpoints", 1e9);
  }
};

}  // namespace graupel::train
