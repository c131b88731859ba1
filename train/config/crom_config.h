// Settings of the training of a reduced-order model of the deformation alone (CROM section 4, appendix B).
#pragma once

#include <cstdint>

#include "core/scene/fields.h"
#include "rom/cubature/sample_selection.h"
#include "rom/deformation/deformation.h"
#include "rom/reduced_model.h"

namespace graupel::train {

struct CromConfig {
  rom::DeformationKind map = rom::DeformationKind::mlp;
  int64_t latents = 4, width = 30;
  double mode_spacing = 1;        ///< [cells]
  double gradient_weight = 0.1;   ///< [m^2]
  double velocity_weight = 0.01;  ///< [s^2]
  double epochs_scale = 1;
  double learning_rate = 1e-3;
  int64_t batch_snapshots = 8, batch_particles = 100;
  int64_t samples = 100;
  rom::SampleRule sample_rule = rom::SampleRule::random;
  Vec3d sample_low = Vec3d::filled(-1e30), sample_high = Vec3d::filled(1e30);
  double step_factor = 1;
  double contact_weight = 10;
  rom::ProjectionKind projection = rom::ProjectionKind::position;
  rom::QuadratureKind quadrature = rom::QuadratureKind::lagrangian;
  rom::GradientKind gradient = rom::GradientKind::map;
  int64_t encoder_particles = 2000;
  int64_t calibration_runs = 4;
  bool tf32 = true;
  double memory_limit = 40;  ///< [GB]
  int64_t log_interval = 1000, checkpoint_interval = 10000;
  uint64_t seed = 0;

  /// Epochs of each learning rate.
  static constexpr int rates = 4;
  static constexpr int64_t epochs[rates] = {500, 200, 100, 50};
  static constexpr int64_t all_epochs() { return epochs[0] + epochs[1] + epochs[2] + epochs[3]; }
  /// Learning rate after the share `progress` of the training: it falls to a tenth between the epochs above.
  double rate_at(double progress) const {
    double rate = learning_rate, passed = 0;
    for (int i = 0; i + 1 < rates; ++i) {
      passed += static_cast<double>(epochs[i]) / static_cast<double>(all_epochs());
      if (progress >= passed) rate *= 0.1;
    }
    return rate;
  }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = CromConfig;
    const auto count = [&](int64_t C::*member, const char* name, const char* unit, const char* meaning, double most) {
      visit(member, FieldInfo{name, unit, meaning, Range::between(1, most)});
    };
    visit(&C::map, FieldInfo{"map", "", "What the deformation map is: a network (the paper's), or modes on a lattice"});
    count(&C::latents, "latents", "", "Numbers of the latent state", 32);
    visit(&C::width, FieldInfo{"width", "", "Width of the five hidden layers", Range::between(1, 1024)}.only_in("mlp"));
    visit(&C::mode_spacing, FieldInfo{"mode_spacing", "cells",
                                      "Distance of the nodes that modes are splines of, over the scene's cell size",
                                      Range::between(0.25, 16)}
                                .only_in("modes"));
    visit(&C::gradient_weight,
          FieldInfo{"gradient_weight", "m^2",
                    "Weight of the squared error of the deformation gradient, that of the position being 1",
                    Range::not_negative()});
    visit(&C::velocity_weight,
          FieldInfo{"velocity_weight", "s^2", "Weight of the squared error of the velocity", Range::not_negative()});
    visit(&C::epochs_scale,
          FieldInfo{"epochs_scale", "", "Times as many epochs as the 500, 200, 100 and 50 of the learning rates",
                    Range::positive()});
    visit(&C::learning_rate,
          FieldInfo{"learning_rate", "", "First learning rate of Adam; then 1/10, 1/100 and 1/1000 of it",
                    Range::positive()});
    count(&C::batch_snapshots, "batch_snapshots", "", "Snapshots in a batch; an epoch has each of them once", 4096);
    count(&C::batch_particles, "batch_particles", "", "Particles of each snapshot in a batch, drawn anew; at most all",
          1e7);
    count(&C::samples, "samples", "", "Sample particles", 1e6);
    visit(&C::sample_rule, FieldInfo{"sample_rule", "", "How the samples are chosen"});
    visit(&C::sample_low,
          FieldInfo{"sample_low", "m", "Lower corner of the box of the reference body that samples lie in"});
    visit(&C::sample_high, FieldInfo{"sample_high", "m", "Upper corner of the samples' box"});
    visit(&C::step_factor,
          FieldInfo{"step_factor", "", "Time steps of the model over those of its data, unless told otherwise",
                    Range::positive()});
    visit(
        &C::contact_weight,
        FieldInfo{"contact_weight", "",
                  "Weight in the projection of samples that a moving obstacle pushes, that of the others being 1, with "
                  "gradients of the map",
                  Range::between(1, 1e6)});
    visit(&C::projection,
          FieldInfo{"projection", "", "How a step of the samples becomes one of the latent, unless told otherwise"});
    visit(&C::quadrature, FieldInfo{"quadrature", "", "What carries mass and stress to the grid"});
    visit(&C::gradient, FieldInfo{"gradient", "", "Deformation gradient in a step: of the map, or integrated"});
    count(&C::encoder_particles, "encoder_particles", "",
          "Particles whose positions give the latent of a state, at most", 1e6);
    visit(&C::calibration_runs,
          FieldInfo{"calibration_runs", "",
                    "Training runs that the model rolls out to learn what is usual (0: no verdict on trust)",
                    Range::between(0, 1000)});
    visit(&C::tf32, FieldInfo{"tf32", "", "TF32 matrix products on a GPU"});
    visit(&C::memory_limit,
          FieldInfo{"memory_limit", "GB", "Targets up to this size lie on the device, else batches are copied",
                    Range::not_negative()});
    count(&C::log_interval, "log_interval", "steps", "Steps between lines of the metrics", 1e9);
    count(&C::checkpoint_interval, "checkpoint_interval", "steps", "Steps between checkpoints", 1e9);
    visit(&C::seed, FieldInfo{"seed", "", "Seed of samples, weights and batches"});
  }
};

}  // namespace graupel::train
