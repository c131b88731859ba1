// Runs a scene in the latent space of a reduced-order model (NSF section 5, CROM algorithm 2): decode the fields at the
// integration particles, advance them on mpm's grid, project the samples back to the manifold. After the start no step
// of the full model is taken.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"
#include "mpm/simulation.h"
#include "rom/projection/latent_manifold.h"
#include "rom/projection/projection.h"
#include "rom/reduced_model.h"
#include "rom/run_start.h"
#include "rom/solver/body_load.h"
#include "rom/solver/error_indicator.h"
#include "rom/solver/particle_grid.h"
#include "rom/solver/quadrature.h"
#include "rom/solver/step_control.h"

namespace graupel::rom {

/// What becomes of steps longer than the training's when their inversion fails or leaves much more than usual.
enum class LongSteps {
  shortened,  ///< taken back and repeated at half the length (rom/solver/step_control.h)
  kept
};

struct ReducedOptions {
  std::optional<double> step_factor;            ///< steps over those of the training, instead of the model's
  LongSteps long_steps = LongSteps::shortened;  ///< steps above the training's
  std::optional<int> iterations;                ///< of Gauss-Newton at most; by default 1 for NSF, 20 for CROM
  std::optional<ProjectionKind> projection;     ///< instead of the model's
  std::optional<QuadratureKind> quadrature;     ///< instead of the model's
  std::optional<double> manifold_pull;          ///< instead of the model's
  std::optional<std::vector<int32_t>> samples;  ///< instead of the model's
};

/// The value that a word names; none for an empty word.
template <typename E>
std::optional<E> word_choice(const std::string& word) {
  for (const auto& [name, value] : EnumWords<E>::words)
    if (word == name) return value;
  return std::nullopt;
}

/// Seconds of the parts of steps, summed.
struct StepTiming {
  double decode = 0, grid = 0, inversion = 0, search = 0;
  double device = 0;  ///< all of these, on a GPU, whose steps are not taken apart
  int64_t steps = 0;
  double total() const { return decode + grid + inversion + search + device; }
};

struct ReducedStatistics {
  StepTiming timing;
  int64_t reduced_steps = 0;    ///< that were taken back and repeated at half the length; they count as steps, too
  int64_t samples = 0;          ///< at the end
  double mean_integration = 0;  ///< particles
  int64_t most_integration = 0;
  double mean_iterations = 0;  ///< of Gauss-Newton
  double largest_condition = 0;
  int64_t loads_without_carriers = 0;  ///< of the scene, that began where nothing was that can move
  int64_t bytes = 0;
};

template <typename T>
class ReducedSolver {
 public:
  /// `parameters`: of the model, in its order. Throws ConfigError when the scene's particles are not those of the
  /// model, or it has what a reduced model cannot know.
  ReducedSolver(const ReducedModel& model, mpm::PreparedScene prepared, std::vector<double> parameters,
                const ReducedOptions& options);

  double time() const { return time_; }
  const LatentState& state() const { return state_; }
  /// One frame of the scene. Throws DivergedError.
  void advance_frame();
  /// One step of dt [s], which is kept. Throws DivergedError.
  void step(double dt);
  /// Puts a force on the body, from the present time on, beside those that act already and those of the scene. Throws
  /// ConfigError as BodyLoad.
  LoadResponse apply(const Load& load);
  /// Positions and velocities of all particles, in the order of the sources.
  ParticleFrame frame() const;
  /// Of the last frame.
  const ErrorIndicator& trust() const { return trust_; }
  ReducedStatistics statistics() const;

 private:
  std::unique_ptr<Quadrature<T>> make_quadrature();
  void project_samples(double dt);
  void pull(double dt);
  bool try_step(double dt);
  void push(double dt);
  void push_by(const BodyLoad& load, double dt);
  void begin_load(std::size_t number);
  std::vector<double> moving_mass() const;

  const ReducedModel& model_;
  mpm::PreparedScene prepared_;
  ReducedOptions options_;
  double step_factor_, manifold_pull_;
  ProjectionKind projection_;
  LatentManifold manifold_;
  Eigen::MatrixXd curve_;  ///< of the manifold at the run's parameter; may be none
  std::vector<int32_t> samples_;
  ParticleGrid<T> grid_;
  std::unique_ptr<Quadrature<T>> quadrature_;
  std::unique_ptr<SampleField> sample_field_;
  std::unique_ptr<PointPositions<float>> output_;
  LatentState state_;
  SampleMotion motion_;  ///< of the last step
  double time_ = 0;
  std::vector<BodyLoad> loads_;  ///< put on it while it runs, that are not over
  enum class LoadPhase { waits, acts, has_no_carriers };
  struct SceneLoad {
    LoadPhase phase = LoadPhase::waits;
    std::optional<BodyLoad> load;
  };
  std::vector<SceneLoad> scene_loads_;  ///< in the order of the scene
  StepControl control_;
  double misfit_ = 0;  ///< distance that the last inversion left, over its dt [m/s]
  ErrorIndicator trust_;
  ReducedStatistics statistics_;
  double down_weighted_sum_ = 0;
  int64_t integration_sum_ = 0, iteration_sum_ = 0;
};

extern template class ReducedSolver<float>;
extern template class ReducedSolver<double>;

}  // namespace graupel::rom
