// Scenes of the general recipe: each category is what it says, inside its ranges, free of overlaps and stable; the same
// seed gives the same scene; constants and contacts vary.
#include "mpm/scene/categories/category_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/system/error.h"
#include "io/scene/category_reader.h"
#include "io/scene/scene_reader.h"
#include "mpm/sampling.h"
#include "mpm/scene/categories/bodies.h"
#include "mpm/simulation.h"

namespace graupel::mpm {
namespace {

constexpr int categories = 8;

CategoryRecipe recipe(const std::vector<std::string>& set = {}) {
  return io::read_category_recipe(std::string(GRAUPEL_SOURCE_DIR) + "/scenes/recipes/general.json", set);
}
const CategoryRecipe& general() {
  static const CategoryRecipe read = recipe();
  return read;
}
Scene test_scene(int64_t index) { return draw_scene(general(), 3, Split::test, index); }
int64_t index_of(SceneCategory category, int64_t repeat = 0) {
  return static_cast<int64_t>(category) + categories * repeat;
}

/// The recipe's material that a scene's material was drawn from: "sand_2" is one of "sand".
const RecipeMaterial& drawn_from(const std::string& key) {
  const auto exact = general().materials.find(key);
  return exact != general().materials.end() ? exact->second : general().materials.at(key.substr(0, key.rfind('_')));
}

/// A contact is free of friction or has it from the range.
void expect_friction(const RecipeSurface& surface, double friction) {
  EXPECT_TRUE(friction == 0 || surface.friction.contains(friction)) << friction;
}

TEST(CategoryScene, EveryCategoryStaysInsideTheRangesOfTheRecipe) {
  const CategoryRecipe& r = general();
  std::set<Shape> bodies, obstacles;
  for (int64_t i = 0; i < 10 * categories; ++i) {
    const Scene scene = test_scene(i);
    const std::string category = word_of(r.category(i));
    EXPECT_TRUE(scene.name.ends_with("-" + category)) << scene.name;
    EXPECT_TRUE(scene.name.starts_with("general-test-000")) << scene.name;
    EXPECT_NE(std::find(r.domain.sizes.begin(), r.domain.sizes.end(), scene.domain.size), r.domain.sizes.end());
    EXPECT_EQ(scene.domain.dx, 1.0 / 64);
    EXPECT_FALSE(scene.sources.empty() && scene.emitters.empty()) << scene.name;
    EXPECT_LE(scene.sources.size(), 8u);
    EXPECT_TRUE(r.bodies.materials.contains(static_cast<int64_t>(scene.materials.size())));
    for (const auto& [key, material] : scene.materials)
      MaterialConfig::fields([&, &key = key, &material = material](auto member, const FieldInfo& info) {
        if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>) {
          const RecipeMaterial& from = drawn_from(key);
          const auto range = from.ranges.find(std::string(info.name));
          const Interval allowed = range != from.ranges.end() ? range->second : Interval{from.*member, from.*member};
          EXPECT_TRUE(allowed.contains(material.*member)) << key << " " << info.name;
        }
      });
    for (const Source& s : scene.sources) {
      bodies.insert(s.shape);
      double extent = s.shape == Shape::box        ? std::max({s.size[0], s.size[1], s.size[2]})
                      : s.shape == Shape::cylinder ? std::max(2 * s.radius, s.height)
                                                   : 2 * s.radius;
      if (s.shape == Shape::mesh) {
        const auto box = bounds_of(RecipeGeometry{.file = s.file, .mesh = s.mesh});
        extent = std::max({box.high[0] - box.low[0], box.high[1] - box.low[1], box.high[2] - box.low[2]});
      }
      EXPECT_GE(extent, r.bodies.size.low * (1 - 1e-9)) << scene.name;
      EXPECT_LE(extent, r.bodies.size.high * (1 + 1e-9)) << scene.name;
      EXPECT_LE(norm(s.velocity), r.bodies.speed.high * (1 + 1e-9));
      EXPECT_LE(norm(s.angular_velocity), r.bodies.spin.high * (1 + 1e-9));
    }
    for (const Obstacle& o : scene.obstacles) {
      obstacles.insert(o.shape);
      expect_friction(r.obstacles.surface, o.friction);
    }
    expect_friction(r.domain.floor, scene.domain.friction(1, 0));
    expect_friction(r.domain.walls, scene.domain.friction(0, 0));
  }
  EXPECT_EQ(bodies.size(), 4u);
  EXPECT_EQ(obstacles.size(), 9u);
}

/// The reader's checks, those of the start (walls, obstacles), the limit of particles, and every particle outside the
/// other bodies. What a scene file says again is the same scene, meshes included.
TEST(CategoryScene, ScenesPassAllChecksAndNothingOverlaps) {
  for (int64_t i = 0; i < 2 * categories; ++i) {
    const Scene scene = test_scene(i);
    const Scene read = io::parse_scene(io::scene_to_json(scene), scene.name, ".");
    ASSERT_NO_THROW(PreparedScene(read, {.seed = scene.seed})) << scene.name;
    const SampledParticles particles = sample_sources(scene, scene.seed);
    EXPECT_EQ(particles.position, sample_sources(read, scene.seed).position) << scene.name;
    EXPECT_LE(particles.position.size(), 20000u) << scene.name;
    for (std::size_t p = 0; p < particles.position.size(); p += 11)
      for (std::size_t s = 0; s < scene.sources.size(); ++s) {
        if (static_cast<int>(s) == particles.source[p] || scene.sources[s].shape == Shape::mesh) continue;
        const Source& other = scene.sources[s];
        ASSERT_GT(sparsegrid::analytic_distance(other, other.to_local(particles.position[p])), 0) << scene.name;
      }
  }
}

TEST(CategoryScene, EachCategoryIsWhatItSays) {
  for (int64_t k = 0; k < 6; ++k) {
    const auto scene = [&](SceneCategory category) { return test_scene(index_of(category, k)); };
    const Scene dam = scene(SceneCategory::dam_break);
    const Source& block = dam.sources.front();
    EXPECT_EQ(dam.materials.at(block.material).model, MaterialModel::water);
    EXPECT_NEAR(block.position[1] - block.size[1] / 2, dam.wall_low()[1], 1e-6);
    EXPECT_NEAR(std::min(block.position[0] - dam.wall_low()[0], dam.wall_high()[0] - block.position[0]),
                block.size[0] / 2, 1e-6);

    const Scene columns = scene(SceneCategory::column_collapse);
    for (const Source& column : columns.sources) {
      EXPECT_NEAR(column.position[1] - (column.shape == Shape::box ? column.size[1] : column.height) / 2,
                  columns.wall_low()[1], 1e-6);
      EXPECT_EQ(norm(column.velocity), 0);
    }
    EXPECT_NE(columns.materials.at(columns.sources.front().material).model, MaterialModel::water);

    EXPECT_GE(scene(SceneCategory::fall_on_obstacles).obstacles.size(), 1u);
    for (const Source& thrown : scene(SceneCategory::thrown_bodies).sources)
      EXPECT_GE(norm(thrown.velocity), 0.5 - 1e-9);

    const Scene snow = scene(SceneCategory::snow_impact);
    EXPECT_EQ(snow.materials.at(snow.sources.front().material).model, MaterialModel::snow);
    EXPECT_GE(norm(snow.sources.front().velocity), 2.25 - 1e-9);

    EXPECT_FALSE(scene(SceneCategory::stream).emitters.empty());
    EXPECT_TRUE(scene(SceneCategory::moving_obstacle).has_moving_obstacles());
    const Scene filled = scene(SceneCategory::filling_container);
    EXPECT_FALSE(filled.obstacles.empty());
    const double filler = filled.emitters.empty() ? filled.sources.front().position[1] : filled.emitters[0].position[1];
    EXPECT_GT(filler, filled.obstacles.front().position[1]);
  }
}

/// One small scene of each category runs for ten frames: nothing diverges, all stays inside the walls.
TEST(CategoryScene, EachCategoryIsStableForTenFrames) {
  const CategoryRecipe small = recipe({"max_particles=1200", "bodies.count=[1,4]", "frames=10"});
  for (int64_t i = 0; i < categories; ++i) {
    const Scene scene = draw_scene(small, 11, Split::train, i);
    const auto run = Simulation::create(scene, {.seed = scene.seed});
    EXPECT_LE(run->particle_count(), 1200u);
    for (int frame = 0; frame < 10; ++frame) ASSERT_NO_THROW(run->advance_frame()) << scene.name;
    for (const Vec3f& x : run->frame().position)
      for (int d = 0; d < 3; ++d) {
        ASSERT_GE(x[d], scene.wall_low()[d] - 1e-5) << scene.name;
        ASSERT_LE(x[d], scene.wall_high()[d] + 1e-5) << scene.name;
      }
  }
}

TEST(CategoryScene, ASceneFollowsFromSeedSplitIndexAndAttemptAlone) {
  const auto text = [](uint64_t seed, Split split, int64_t index, int64_t attempt) {
    Scene scene = draw_scene(general(), seed, split, index, attempt);
    scene.name = "";
    return io::scene_to_json(scene);
  };
  for (int64_t i = 0; i < categories; ++i) {
    const std::string scene = text(3, Split::test, i, 0);
    EXPECT_EQ(text(3, Split::test, i, 0), scene);
    EXPECT_NE(text(4, Split::test, i, 0), scene);
    EXPECT_NE(text(3, Split::train, i, 0), scene);
    EXPECT_NE(text(3, Split::valid, i, 0), scene);
    EXPECT_NE(text(3, Split::test, i + categories, 0), scene);
    EXPECT_NE(text(3, Split::test, i, 1), scene);
  }
}

TEST(CategoryScene, ConstantsContactsAndCategoriesVary) {
  std::map<std::string, std::vector<double>> values;
  std::set<Wall> floors, walls;
  std::set<Contact> contacts;
  for (int64_t i = 0; i < 20 * categories; ++i) {
    const Scene scene = draw_scene(general(), 5, Split::train, i);
    for (const auto& [key, material] : scene.materials) {
      if (material.model == MaterialModel::sand) values["friction_angle"].push_back(material.friction_angle);
      if (material.model == MaterialModel::water) values["viscosity"].push_back(material.viscosity);
      if (material.model == MaterialModel::snow) values["hardening"].push_back(material.hardening);
      if (material.model == MaterialModel::jelly) values["stiffness"].push_back(material.youngs_modulus);
    }
    floors.insert(scene.domain.wall(1, 0));
    walls.insert(scene.domain.wall(0, 0));
    values["friction"].push_back(scene.domain.friction(1, 0));
    for (const Obstacle& o : scene.obstacles) contacts.insert(o.contact);
  }
  const auto ends = [&](const char* name) { return std::minmax_element(values[name].begin(), values[name].end()); };
  EXPECT_LT(*ends("friction_angle").first, 22);
  EXPECT_GT(*ends("friction_angle").second, 43);
  EXPECT_LT(*ends("hardening").first, 6);
  EXPECT_GT(*ends("hardening").second, 11);
  EXPECT_LT(*ends("viscosity").first, 0.03);
  EXPECT_GT(*ends("viscosity").second, 4);
  EXPECT_EQ(*ends("friction").first, 0);
  EXPECT_GT(*ends("friction").second, 0.6);
  // Three decades, uniform in the logarithm: half of the draws are below the geometric mean.
  const auto low =
      std::count_if(values["viscosity"].begin(), values["viscosity"].end(), [](double v) { return v < 0.316; });
  EXPECT_NEAR(static_cast<double>(low) / static_cast<double>(values["viscosity"].size()), 0.5, 0.2);
  EXPECT_EQ(floors, (std::set<Wall>{Wall::stick, Wall::slip, Wall::separate}));
  EXPECT_EQ(walls, floors);
  EXPECT_EQ(contacts.size(), 3u);
}

TEST(CategoryScene, FixedStepsMustDoForTheStiffestConstants) {
  EXPECT_LT(largest_courant(general()), 1);
  const double once = largest_courant(general()), half = largest_courant(recipe({"time_step.substeps_per_frame=108"}));
  EXPECT_NEAR(half, once / 2, 1e-9);
  const CategoryRecipe stiff = recipe({"materials.jelly.ranges.youngs_modulus=[3e4,9e6]"});
  try {
    draw_scene(stiff, 1, Split::train, 0);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const ConfigError& error) {
    for (const char* part : {"time_step.substeps_per_frame", "54, at least", "allowed up to 1", "Raise it"})
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
  EXPECT_NO_THROW(
      draw_scene(recipe({"materials.jelly.ranges.youngs_modulus=[3e4,9e6]", "time_step={}"}), 1, Split::train, 0));
}

TEST(CategoryScene, FixedStepsMustDoForStreamsAndMovingObstacles) {
  const double slow = largest_courant(general());
  for (const char* set : {"streams.speed=[1,50]", "motions.speed=[1,50]", "motions.spin=[1,500]"}) {
    EXPECT_GT(largest_courant(recipe({set})), slow) << set;
    EXPECT_EQ(largest_courant(recipe({set, "categories=[\"thrown_bodies\"]"})), slow) << set;
  }
}

TEST(CategoryScene, StepsOfAFrameMustDoForWavesAlone) {
  const auto with_streams = [](const char* speed, const char* step) { return recipe({speed, step}); };
  const char* fixed = R"(time_step={"policy": "fixed", "substeps_per_frame": 54})";
  const char* per_frame = R"(time_step={"policy": "per_frame", "substeps_per_frame": 54, "courant": 0.25})";
  EXPECT_GT(largest_courant(with_streams("streams.speed=[1,500]", fixed)), 1);
  const double fast = largest_courant(with_streams("streams.speed=[1,500]", per_frame));
  EXPECT_LT(fast, 1);
  EXPECT_EQ(fast, largest_courant(with_streams("streams.speed=[1,1000]", per_frame)));
  EXPECT_THROW(draw_scene(recipe({"materials.jelly.ranges.youngs_modulus=[3e4,9e6]", per_frame}), 1, Split::train, 0),
               ConfigError);
}

/// Columns that are higher than the domain are not used: the start checks find no particle outside the walls.
TEST(CategoryScene, NoColumnReachesThroughTheCeiling) {
  const CategoryRecipe low =
      recipe({"categories=[\"column_collapse\"]", "domain.sizes=[[1,0.4,1]]", "bodies.size=[0.04,0.9]"});
  int drawn = 0;
  for (int64_t i = 0; i < 20; ++i) {
    try {
      const Scene scene = draw_scene(low, 1, Split::train, i);
      ASSERT_NO_THROW(PreparedScene(scene, {.seed = scene.seed})) << scene.name;
      ++drawn;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find("no room"), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(drawn, 0);
}

/// A stream that does not fit at the first position keeps its share of particles for the next one.
TEST(CategoryScene, NearlyAllScenesHaveTheStreamsThatTheyAskFor) {
  const CategoryRecipe streams = recipe({"categories=[\"stream\"]", "streams.count=[2,2]"});
  int both = 0;
  for (int64_t i = 0; i < 40; ++i) both += draw_scene(streams, 1, Split::train, i).emitters.size() == 2;
  EXPECT_GE(both, 38);
}

TEST(CategoryScene, ARecipeWithoutRoomIsAnError) {
  const CategoryRecipe large = recipe({"bodies.size=[0.7,0.8]", "bodies.shapes=[\"sphere\"]", "max_particles=10000000",
                                       "domain.sizes=[[0.75,0.75,0.75]]"});
  try {
    draw_scene(large, 1, Split::train, index_of(SceneCategory::fall_on_obstacles));
    ADD_FAILURE() << "nothing was thrown";
  } catch (const ConfigError& error) {
    for (const char* part : {"no room for the bodies of scene 2 of 'general'", "fall_on_obstacles", "0.7 to 0.8 m",
                             "streams of 0.05 to 0.12 m and 0.5 to 2.5 m/s", "max_particles 10000000",
                             "particles_per_cell 8", "Use fewer or smaller ones", "or raise max_particles"})
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

/// A shrunk body has the asked volume, keeps what it can of its largest extent, and none is below the least.
TEST(CategoryScene, BodiesShrinkToSlenderOnes) {
  Body box;
  box.size = {0.4, 0.3, 0.2};
  ASSERT_TRUE(shrink(box, 0.006, 0.04));
  EXPECT_NEAR(volume(box), 0.006, 1e-9);
  EXPECT_EQ(box.size[0], 0.4);
  EXPECT_NEAR(box.size[1] / box.size[2], 1.5, 1e-9);
  Body column;
  column.shape = Shape::cylinder;
  column.height = 0.4, column.radius = 0.1;
  ASSERT_TRUE(shrink(column, 0.002, 0.04));
  EXPECT_NEAR(volume(column), 0.002, 1e-9);
  EXPECT_EQ(column.height, 0.4);
  box.size = {0.05, 0.05, 0.05};
  EXPECT_FALSE(shrink(box, 1e-6, 0.04));
  EXPECT_EQ(box.size, Vec3d::filled(0.04));
}

/// Never false for bodies that share a point, and false for bodies that are well apart.
TEST(CategoryScene, MayTouchMissesNoOverlap) {
  Draws draws(1, 1);
  int touching = 0, apart = 0;
  for (int i = 0; i < 150; ++i) {
    Body a, b;
    a.shape = draws.one_of(general().obstacles.shapes);
    b.shape = draws.one_of(general().obstacles.shapes);
    if (!sparsegrid::is_analytic(a.shape) || !sparsegrid::is_analytic(b.shape)) continue;
    set_size(a, draws.uniform(0.05, 0.3));
    set_size(b, draws.uniform(0.05, 0.3));
    for (Body* body : {&a, &b}) draws.rotation(body->rotation_axis, body->rotation_angle);
    b.position = draws.direction() * draws.uniform(0.1, 0.5);
    double nearest = 1e300;
    for (int p = 0; p < 4000; ++p) {
      const sparsegrid::LocalBox box = sparsegrid::analytic_bounds(a);
      const Vec3d local = draws.point(box.low, box.high);
      if (sparsegrid::analytic_distance(a, local) <= 0)
        nearest = std::min(nearest, sparsegrid::analytic_distance(b, b.to_local(a.to_world(local))));
    }
    if (nearest < 0) {
      ++touching;
      EXPECT_TRUE(may_touch(a, b, 0)) << i;
    } else if (nearest > 0.1) {
      ++apart;
      EXPECT_FALSE(may_touch(a, b, 0)) << i;
    }
    EXPECT_TRUE(may_touch(a, b, nearest)) << i;
  }
  EXPECT_GT(touching, 10);
  EXPECT_GT(apart, 10);
}

}  // namespace
}  // namespace graupel::mpm
