// Trains a reduced-order model with factored fields from the runs of a parameter sweep: proper orthogonal decomposition
// of deformation, stress and affine velocity, then branches from the latent to their coefficients. Neural Stress Fields
// (Zong et al. 2023, section 4.5) with a decomposition and a regression in place of its networks and Adam.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "rom/reduced_model.h"
#include "train/config/nsf_config.h"
#include "train/reduced/error_calibration.h"
#include "train/reduced/snapshot_set.h"

namespace graupel::train {

/// What the training tells about a field.
struct FieldReport {
  int modes = 0;
  double tail = 0;            ///< root of the share of squares that the modes leave out of the training snapshots
  double held_out_error = 0;  ///< of the branch in runs that were held out, relative to the coefficients
  double ridge = 0;           ///< of radial basis functions
  double branch_seconds = 0;
};

/// The roll-outs of training runs that tell what is usual.
struct NsfReport {
  FieldReport deformation, stress, affine;
  CalibrationReport calibration;
  double latent_tail = 0;  ///< as FieldReport::tail, of the latent's modes alone
  int64_t snapshots = 0;
  double read_seconds = 0, seconds = 0;  ///< reading the snapshots; all
};

struct NsfTrainingOptions {
  std::string data;  ///< folder of the data set; its train.h5 is read
  NsfConfig config;
  std::function<void(const std::string&)> message = {};
  std::map<std::string, std::string> provenance = {};  ///< kept in the weights' metadata
};

/// Throws InputError for a data set that is no sweep, ConfigError for more latents than the snapshots have modes,
/// DivergedError when the training of a branch diverges.
rom::ReducedModel train_factored(const NsfTrainingOptions& options, NsfReport& report);

}  // namespace graupel::train
