// Measurements of a reduced-order model on the stored runs of its data set: errors of motion and stress, trust, time,
// memory, and its speed beside the full-order solver.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "experiments/models/reduced_model.h"
#include "io/trajectory/trajectory_file.h"
#include "rom/cubature/sample_selection.h"

namespace graupel::bench {

using namespace experiments;

struct RomRunOptions {
  double step_factor = 1;  ///< of the training's step
  rom::LongSteps long_steps = rom::LongSteps::shortened;
  int64_t samples = 0;                             ///< 0: the model's
  rom::SampleRule rule = rom::SampleRule::spread;  ///< of these, as the two below
  std::vector<double> box = {};                    ///< of the reference body that they lie in: low, high [m]; or none
  std::optional<int> iterations = {};
  std::optional<double> manifold_pull = {};  ///< instead of the model's, as the two below
  std::optional<rom::ProjectionKind> projection = {};
  std::optional<rom::QuadratureKind> quadrature = {};
  Arithmetic arithmetic = Arithmetic::f32;
  ForeignScene foreign = ForeignScene::refuse;
  Device device = Device::cpu;
};
/// Of the solver. Throws ConfigError for a box without integration points, and for a rule that the fields do not allow.
rom::ReducedOptions reduced_options(const RomRunOptions& options, const rom::ReducedModel& model);

/// A run of a split with its scene.
struct StoredRun {
  StoredRun(const io::TrajectoryReader& reader, int run, const std::string& file);
  const io::TrajectoryReader& reader;
  int run;
  Scene scene;
  uint64_t seed = 0;
  int64_t frames = 0;  ///< with the start
};

/// Relative errors of the decoded Kirchhoff stress over the frames after the start.
struct StressErrors {
  double particles = 0;  ///< against the recorded stress of every particle
  double clusters = 0;   ///< against its means over the integration points' clusters
};

/// One run of the reduced model against a stored truth. Errors are of the frames before a divergence.
struct RomMeasurement {
  std::vector<double> parameters;
  bool diverged = false;
  std::string trouble;
  double delta = 0, displacement_relative = 0, error_cells = 0;
  std::optional<StressErrors> stress;  ///< none where the truth stores no stress
  double seconds = 0;                  ///< of all frames
  double added_bytes = 0;              ///< resident memory at its peak over that before the run, of the whole process
  rom::ReducedStatistics statistics;
  std::vector<double> frame_error;  ///< relative to the displacement in that frame
  std::vector<rom::ErrorIndicator> trust;
  std::vector<double> trust_numbers;
  double trust_number = 0;
  std::optional<double> error_bound;  ///< the model's own, on displacement_relative
  rom::Verdict verdict = rom::Verdict::unknown;
};
RomMeasurement measure_rom(const LoadedModel& model, const StoredRun& truth, const RomRunOptions& options);

/// Median seconds a frame of the full-order solver and of the reduced model on one device, whose frames took turns.
struct SpeedComparison {
  std::string against;  ///< mpm, mpm:fast
  double mpm_frame = 0, rom_frame = 0;
  double substeps = 0;        ///< of the full-order solver a frame
  double search_seconds = 0;  ///< for the largest stable step
  bool diverged = false;      ///< one of the two: the medians are of the frames before
};
/// Throws ConfigError for a word that is neither mpm nor mpm:fast.
SpeedComparison compare_speed(const LoadedModel& model, const StoredRun& truth, const RomRunOptions& options,
                              const std::string& against);

}  // namespace graupel::bench
