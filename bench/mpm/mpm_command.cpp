// graupel-bench mpm: speed of the material point method.
#include <memory>

#include "bench/commands.h"
#include "bench/mpm/falling_cube.h"
#include "bench/mpm/mpm_tables.h"

namespace graupel::bench {

using namespace experiments;

void add_mpm(const Command& program) {
  auto options = std::make_shared<BenchMpmOptions>();
  const Command verb = program.command("mpm", "Whole substeps of a falling cube: dx = 1/256 m, steps of 1e-4 s");
  verb.option("--material", options->material,
              "A constitutive model, tait_water (exponent 7.15, viscous), or all: water, jelly, snow and sand")
      .check(one_of(material_words()))
      .show_default();
  verb.option("--particles", options->particles, "Number of particles (8 a cell of a cube; repeatable)")
      .check(shown_range(int64_t{8}, int64_t{100000000}))
      .show_default();
  verb.option("--phase", options->phase, "fall: substeps 250-650; late: 2500-2700, on the floor")
      .check(one_of({"fall", "late"}))
      .show_default();
  verb.option("--precision", options->precision, "f32 or f64 (CPU)").check(one_of({"f32", "f64"})).show_default();
  verb.option("--recipe", options->recipe, "Instead of the cube: test scenes of a recipe, all at once")
      .names_file({".json"});
  verb.option("--batch", options->batch, "With --recipe: number of scenes (repeatable)")
      .check(shown_range(int64_t{1}, int64_t{100000}))
      .show_default();
  verb.option("--frames", options->frames, "With --recipe: frames to measure, after five more")
      .check(shown_range(int64_t{1}, int64_t{100000}))
      .show_default();
  verb.option("--table", options->table,
              "Instead, one table. cpu: f32 and f64 on one thread and on all; cuda: falling and late")
      .check(one_of({"cpu", "cuda"}))
      .excludes("--recipe");
  verb.flag("--portable", options->portable, "The portable kernels instead of the tuned ones");
  verb.option(
          "--category", options->categories,
          "With --recipe: its test scenes of a category, by the tuned kernels and by the portable ones (repeatable)")
      .check(one_of(category_words()))
      .excludes("--portable");
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel bench mpm --material sand --particles 1000000 --device cuda\n"
      "  graupel bench mpm --particles 39304 --phase late --threads 1 --json speed.json\n"
      "  graupel bench mpm --table cpu --particles 100000 --json cpu.json\n"
      "  graupel bench mpm --table cuda --particles 4096 39304 262144 1000000 10077696 --json gpu.json\n"
      "  graupel bench mpm --recipe scenes/recipes/hgn.json --batch 1 64 --device cuda\n"
      "  graupel bench mpm --recipe scenes/recipes/general.json --category moving_obstacle stream --batch 1 16");
  verb.callback([options] { print_mpm_table(*options); });
}

}  // namespace graupel::bench
