// The solver as an opponent of learned models: a scene on another grid, with its own step or the largest stable one.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

/// Substeps a frame: the scene's (with another grid, at the scene's Courant number), or as few as hold (fast_step.h).
enum class StepRule { given, largest_stable };

struct SolverVariant {
  double resolution = 1;  ///< dx over the scene's: 0.5, 1 or 2
  StepRule step = StepRule::given;
  bool operator==(const SolverVariant&) const = default;
};
inline constexpr SolverVariant same_solver{}, fast_solver{1, StepRule::largest_stable}, coarse_solver{2},
    coarse_fast_solver{2, StepRule::largest_stable}, fine_solver{0.5};

/// "mpm", "mpm:fast", "mpm:coarse", "mpm:coarse:fast" or "mpm:fine"; nothing for any other word.
std::optional<SolverVariant> parse_variant(const std::string& word);
std::string variant_word(const SolverVariant& variant);
/// All of them; in one text, separated by commas.
std::vector<std::string> variant_list();
std::string variant_words();

/// The scene at dx/2 with eight times the particles (four in the plane) and twice the substeps. Given points are
/// replaced by points a quarter of their distance off them along each axis; obstacles keep their grids, streams their
/// flux (mpm/scene/emission.h).
Scene fine_variant(const Scene& scene);

/// The scene with points for particles: `points` [sources] [m] are those of each source, which keeps its velocity and
/// the centres of its spin and its script. Emitters stay as they are.
Scene scene_of_points(const Scene& scene, std::vector<std::vector<Vec3d>> points);

/// Which of a source's `count` points stand for all where each takes the volume of `group`: one at random of every
/// `group`, or about as many, that follow one another.
std::vector<std::size_t> thinned_points(const Scene& scene, std::size_t source, std::size_t count, double group);

/// The ratio nearest to `ratio` that leaves whole cells between periodic walls.
double ratio_of_whole_cells(const Domain& domain, double ratio);

/// The scene on a grid with `ratio` (from 1) times its spacing (ratio_of_whole_cells): walls and obstacles stay where
/// they are, bodies are sampled with as many particles a cell as before, streams keep their flux
/// (mpm/scene/emission.h), given points are thinned. Fewer substeps a frame, in proportion. `particle_share`: particles
/// a cell over those before, at most as many as the scene has.
Scene on_coarser_grid(const Scene& scene, double ratio, double particle_share = 1);

/// The scene on the variant's grid; the step is still the given one.
Scene variant_scene(const Scene& scene, const SolverVariant& variant);

/// Throws ConfigError, naming need, available memory and remedies, when the variant's run does not fit. A run that
/// keeps `stored` positions of particles in memory needs these, too.
void check_variant_fits(const Scene& scene, const SolverVariant& variant, const SimulationOptions& options,
                        double stored, uint64_t available_on_host, uint64_t available_on_device);
/// With the memory there is now.
void check_variant_fits(const Scene& scene, const SolverVariant& variant, const SimulationOptions& options,
                        double stored);

}  // namespace graupel::mpm
