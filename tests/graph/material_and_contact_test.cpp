// What networks see of materials' constants and of the nearest surface.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/error.h"
#include "graph/features/features.h"
#include "tests/graph/changing_scene_case.h"
#include "tests/graph/rollout_case.h"

namespace graupel::graph {
namespace {

using ::testing::HasSubstr;

MaterialConfig law(MaterialModel model) {
  MaterialConfig material;
  material.model = model;
  return material;
}

/// Features behind those of the paper: history 1, walls, then what is asked for.
FeatureConfig bare(bool material_constants, bool contact) {
  FeatureConfig config;
  config.history = 1;
  config.cell_normal = false;
  config.material_constants = material_constants;
  config.contact = contact;
  return config;
}
constexpr std::size_t first_column = 3 + 6;

std::vector<float> contact_at(const Scene& scene, const Vec3f& x, double time = 0, const AxisMap& symmetry = {}) {
  Normalization normalization;
  for (int d = 0; d < 3; ++d) normalization.velocity_std[d] = 0.01f * static_cast<float>(d + 1);
  const Environment environment(scene);
  MovingEnvironment moving(environment);
  const auto row = particle_features(bare(false, true), normalization, moving.at(time), {{x}, {x}}, {}, symmetry);
  EXPECT_EQ(row.size(), first_column + 7);
  return {row.begin() + first_column, row.end()};
}

void expect_row(const std::vector<float>& actual, const std::vector<double>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i) EXPECT_NEAR(actual[i], expected[i], 1e-4) << "number " << i;
}

const std::vector<double> nothing(7, 0.0);

TEST(MaterialConstants, AreTheDocumentedFunctionsOfEachLaw) {
  MaterialConfig water = law(MaterialModel::water), sand = law(MaterialModel::sand), snow = law(MaterialModel::snow),
                 jelly = law(MaterialModel::jelly);
  water.bulk_modulus = 3e5 * std::exp(1.0);
  water.youngs_modulus = 7;  // which water has not
  water.viscosity = 0.01 * (std::exp(1.5) - 1);
  sand.youngs_modulus = 3e5 * std::exp(-2.0);
  sand.friction_angle = 45;
  sand.cohesion = 50 * (std::exp(2.0) - 1);
  snow.youngs_modulus = 3e5;
  snow.hardening = 8;
  snow.critical_compression = 0.05;
  snow.critical_stretch = 0.0075;
  jelly.youngs_modulus = 3e4;
  const auto expect = [](const MaterialConfig& material, const std::vector<double>& expected) {
    const MaterialConstants made = material_constants(material);
    expect_row({std::begin(made.feature), std::end(made.feature)}, expected);
  };
  expect(water, {1, 0.5, 0, 0, 0, 0, 0});
  expect(sand, {-2, 0, 1, 2, 0, 0, 0});
  expect(snow, {0, 0, 0, 0, 0.8, 2, 1.5});
  expect(jelly, {std::log(0.1), 0, 0, 0, 0, 0, 0});
  expect(law(MaterialModel::stationary), nothing);
}

TEST(MaterialConstants, OfTwoJelliesAreToldByTheParticle) {
  Scene scene;
  scene.materials["hard"] = scene.materials["soft"] = law(MaterialModel::jelly);
  scene.materials["hard"].youngs_modulus = 9e5;
  scene.materials["soft"].youngs_modulus = 3e4;
  const Environment environment(scene);
  const std::vector<Vec3f> x(3, Vec3f{0.5f, 0.5f, 0.5f});
  const auto rows = particle_features(bare(true, false), {}, environment, {x, x}, {1, 0, no_material});
  const std::size_t width = first_column + 7;
  ASSERT_EQ(rows.size(), 3 * width);
  EXPECT_NEAR(rows[first_column], std::log(0.1), 1e-5);
  EXPECT_NEAR(rows[width + first_column], std::log(3.0), 1e-5);
  for (std::size_t k = 0; k < 7; ++k) EXPECT_EQ(rows[2 * width + first_column + k], 0);
  EXPECT_THROW(particle_features(bare(true, false), {}, environment, {x, x}), std::logic_error);
  try {
    environment.materials.by_type({4, 4});
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("materials 'hard' and 'soft' of one law (jelly)"));
  }
  EXPECT_THROW(environment.materials.by_type({5}), InputError);  // no water there
}

TEST(MaterialConstants, FollowTypesWhereTheseTell) {
  Scene scene;
  scene.materials["a"] = law(MaterialModel::water);
  scene.materials["b"] = law(MaterialModel::sand);
  EXPECT_EQ(MaterialTable(scene).by_type({6, 5, obstacle_particle_type}), (std::vector<int32_t>{1, 0, no_material}));
}

/// The new columns stand behind the old ones, which stay as they are.
TEST(OptionalFeatures, StandBehindTheOthers) {
  Scene scene = scene_with_ball({0.5, 0.5, 0.5}, 0.2);
  scene.materials["w"] = law(MaterialModel::water);
  const Environment environment(scene);
  FeatureConfig config;
  config.signed_distance = true;
  std::vector<std::vector<Vec3f>> history(6);
  const Random random(2, RandomPurpose::test);
  for (uint64_t p = 0; p < 30; ++p)
    for (std::size_t t = 0; t < 6; ++t)
      history[t].push_back({static_cast<float>(random.uniform(p, 0)), static_cast<float>(random.uniform(p, 1)),
                            static_cast<float>(random.uniform(p, 2) + 0.001 * static_cast<double>(t))});
  const auto before = particle_features(config, {}, environment, history);
  const std::vector<int32_t> material(30, 0);
  FeatureConfig both = config;
  both.material_constants = both.contact = true;
  EXPECT_EQ(both.input_width(), config.input_width() + 14);
  const auto after = particle_features(both, {}, environment, history, material);
  const std::size_t width = before.size() / 30;
  for (std::size_t p = 0; p < 30; ++p)
    for (std::size_t k = 0; k < width; ++k) EXPECT_EQ(after[p * (width + 14) + k], before[p * width + k]);
  FeatureConfig one = config;
  one.contact = true;
  const auto contact = particle_features(one, {}, environment, history);
  for (std::size_t p = 0; p < 30; ++p)
    for (std::size_t k = 0; k < 7; ++k)
      EXPECT_EQ(contact[p * (width + 7) + width + k], after[p * (width + 14) + width + 7 + k]);
}

TEST(ContactFeatures, AreThoseOfTheNearestWallWithinTheClamp) {
  Scene scene;  // walls that hold the material lie three cells inside the domain
  scene.domain.wall_friction = 0.3;
  scene.domain.faces.y_low = WallConfig{Wall::slip, 0.6};
  scene.domain.faces.x_high = WallConfig{Wall::stick, {}};
  const double inside = 3 * scene.domain.dx;
  const auto below = [&](double distance) { return static_cast<float>(inside + distance); };
  expect_row(contact_at(scene, {0.5f, below(0.01), 0.5f}), {0.6, 1, 0, 0, 0, 0, 0});
  expect_row(contact_at(scene, {below(0.01), below(0.05), 0.5f}), {0.3, 0, 1, 0, 0, 0, 0});
  expect_row(contact_at(scene, {1 - below(0.01), 0.5f, 0.5f}), {0, 0, 0, 1, 0, 0, 0});
  expect_row(contact_at(scene, {0.5f, below(-0.02), 0.5f}), {0.6, 1, 0, 0, 0, 0, 0});  // behind it
  expect_row(contact_at(scene, {0.5f, below(0.279), 0.5f}), {0.6, 1, 0, 0, 0, 0, 0});
  expect_row(contact_at(scene, {0.5f, below(0.281), 0.5f}), nothing);
  // What leaves a domain, or comes in at the other end, meets nothing.
  for (const Wall kind : {Wall::open, Wall::periodic}) {
    scene.domain.faces.z_low = scene.domain.faces.z_high = WallConfig{kind, {}};
    expect_row(contact_at(scene, {0.5f, 0.5f, below(0.01)}), nothing);
    expect_row(contact_at(scene, {0.5f, below(0.1), below(0.01)}), {0.6, 1, 0, 0, 0, 0, 0});
  }
}

TEST(ContactFeatures, InThePlaneTheFacesAlongZAreNone) {
  Scene scene;
  scene.domain.dimensions = 2;
  scene.domain.size = {1, 1, 0.1};
  scene.domain.walls = Contact::stick;
  expect_row(contact_at(scene, {0.5f, 0.5f, 0.05f}), nothing);
  expect_row(contact_at(scene, {0.5f, 0.1f, 0.05f}), {0, 0, 0, 1, 0, 0, 0});
}

TEST(ContactFeatures, OfAnObstacleAtRest) {
  Scene scene = scene_with_ball({0.5, 0.5, 0.5}, 0.1);
  scene.domain.size = {1, 1, 1};
  scene.obstacles[0].friction = 0.45;
  expect_row(contact_at(scene, {0.5f, 0.61f, 0.5f}), {0.45, 0, 1, 0, 0, 0, 0});
  expect_row(contact_at(scene, {0.5f, 0.58f, 0.5f}), {0.45, 0, 1, 0, 0, 0, 0});  // inside
  scene.obstacles[0].contact = Contact::stick;
  expect_row(contact_at(scene, {0.5f, 0.61f, 0.5f}), {0, 0, 0, 1, 0, 0, 0});
  // Beyond its clamp of 0.1 m it counts no more, but the ceiling, 0.24 m away, does.
  expect_row(contact_at(scene, {0.5f, 0.71f, 0.5f}), {0, 0, 1, 0, 0, 0, 0});
}

/// The velocity is the way of the surface's point in a frame, turns included, over the deviation of velocities.
TEST(ContactFeatures, HaveTheVelocityOfTheSurface) {
  Scene scene = scene_with_ball({0.5, 0.5, 0.5}, 0.1);
  scene.obstacles[0].motion = motion_of({0.6, 0, 0.3}, 3);
  const double dt = scene.frame_time, time = 3 * dt, angle = 3 * dt;
  const Vec3d center = Vec3d{0.5, 0.5, 0.5} + time * Vec3d{0.6, 0, 0.3};
  const Vec3f above = (center + Vec3d{0, 0.12, 0}).cast<float>();
  // The point (0, 0.1, 0) from the centre was turned back by `angle` about z a frame before.
  const Vec3d arm = {0, 0.1, 0}, arm_before = {0.1 * std::sin(angle), 0.1 * std::cos(angle), 0};
  const Vec3d way = dt * Vec3d{0.6, 0, 0.3} + arm - arm_before;
  const auto row = contact_at(scene, above, time);
  ASSERT_EQ(row.size(), 7u);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(row[static_cast<std::size_t>(4 + d)], way[d] / (0.01 * (d + 1)), 0.01) << d;
  EXPECT_LT(row[4], 0.6 * dt / 0.01 - 0.1);  // the turn goes against the way above the centre
  const AxisMap symmetry{{2, 1, 0}, {-1, 1, 1}};
  const auto turned = contact_at(scene, above, time, symmetry);
  const Vec3d turned_way = symmetry.apply(way);
  for (int d = 0; d < 3; ++d)
    EXPECT_NEAR(turned[static_cast<std::size_t>(4 + d)], turned_way[d] / (0.01 * (d + 1)), 0.01) << d;
  // It rests before the script begins and after it has ended.
  scene.obstacles[0].motion->end_time = 1.5 * dt;
  const Vec3f stopped = (Vec3d{0.5, 0.62, 0.5} + 1.5 * dt * Vec3d{0.6, 0, 0.3}).cast<float>();
  expect_row(contact_at(scene, stopped, time), {0, 0, 1, 0, 0, 0, 0});
  expect_row(contact_at(scene, {0.5f, 0.62f, 0.5f}, 0), {0, 0, 1, 0, 0, 0, 0});
}

template <typename Config>
Config seeing() {
  Config config;
  config.latent = 16;
  config.embedding = 4;
  config.history = 2;
  config.message_passing = 1;
  config.material_constants = config.contact = true;
  return config;
}

template <typename Config>
void expect_in_metadata(const std::string& prefix) {
  const Config config = seeing<Config>();
  auto metadata = config.to_metadata();
  EXPECT_EQ(metadata.at(prefix + "material_constants"), "true");
  EXPECT_EQ(metadata.at(prefix + "contact"), "true");
  EXPECT_EQ(Config::from_metadata(metadata, "f").input_width(), config.input_width());
  metadata.erase(prefix + "material_constants");
  EXPECT_EQ(Config::from_metadata(metadata, "f").input_width(), config.input_width() - 7);
  metadata.erase(prefix + "contact");
  EXPECT_EQ(Config::from_metadata(metadata, "f").input_width(), config.input_width() - 14);
}

TEST(OptionalFeatures, AreInTheMetadataAndOffInFilesFromBefore) {
  expect_in_metadata<HgnConfig>("hgn.");
  expect_in_metadata<GnsConfig>("gns.");
}

Scene scene_with_two_jellies() {
  Scene scene = scene_with_ball({0.5, 0.3, 0.5}, 0.1);
  scene.materials["a"] = scene.materials["b"] = law(MaterialModel::jelly);
  scene.materials["a"].youngs_modulus = 3e4;
  scene.materials["b"].youngs_modulus = 9e5;
  return scene;
}

/// Frame 1 of a rollout of a few particles near the ball; `order` renumbers them.
template <typename Config>
std::vector<Vec3f> next_frame(const Config& config, const std::vector<int32_t>& material,
                              const std::vector<std::size_t>& order) {
  static const WeightsFile file;
  const LearnedSimulator simulator = file.read_back(random_weights(config, wide_statistics()));
  Scene scene = scene_with_two_jellies();
  scene.emitters.emplace_back();
  std::vector<Vec3f> position;
  LearnedSimulator::RolloutOptions options;
  ParticleSchedule schedule;
  for (const std::size_t p : order) {
    position.push_back({0.4f + 0.02f * static_cast<float>(p), 0.45f, 0.5f});
    options.material.push_back(material.at(p));
    schedule.birth_time.push_back(p % 3 == 2 ? 0.5 : 0);  // some are not there yet
    schedule.birth_velocity.push_back(Vec3f::zero());
  }
  const auto history = start_history(position, std::vector<Vec3f>(position.size(), Vec3f::zero()), scene.gravity,
                                     scene.frame_time, static_cast<int>(config.history) + 1);
  options.frames = 1;
  options.free_flight = options.project = false;
  options.density_limit = 0;
  options.schedule = &schedule;
  const Trajectory run =
      simulator.rollout(scene, Environment(scene), std::vector<int32_t>(position.size(), 4), history, options);
  std::vector<Vec3f> by_number(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) by_number[order[i]] = run.frames.at(1).position[i];
  return by_number;
}

template <typename Config>
void expect_materials_of_particles(const Config& config) {
  std::vector<std::size_t> straight(12), backwards(12);
  std::vector<int32_t> mixed, soft(12, 0);
  for (std::size_t p = 0; p < 12; ++p) {
    straight[p] = p;
    backwards[p] = 11 - p;
    mixed.push_back(p % 2);
  }
  const auto a = next_frame(config, mixed, straight), b = next_frame(config, mixed, backwards),
             c = next_frame(config, soft, straight);
  double moved = 0;
  for (std::size_t p = 0; p < 12; ++p) {
    EXPECT_LT(norm(a[p] - b[p]), 1e-6) << p;
    moved = std::max(moved, static_cast<double>(norm(a[p] - c[p])));
  }
  EXPECT_GT(moved, 1e-5) << "stiffness is seen";
}

TEST(OptionalFeatures, FollowParticlesThatComeAndGo) {
  expect_materials_of_particles(seeing<HgnConfig>());
  GnsConfig gns = seeing<GnsConfig>();
  expect_materials_of_particles(gns);
  gns.obstacle_particles = true;
  expect_materials_of_particles(gns);
}

TEST(OptionalFeatures, RolloutsRefuseToGuessAMaterial) {
  const WeightsFile file;
  const LearnedSimulator simulator = file.read_back(random_weights(seeing<HgnConfig>(), wide_statistics()));
  const Scene scene = scene_with_two_jellies();
  const Environment environment(scene);
  const std::vector<std::vector<Vec3f>> history(3, {{0.5f, 0.5f, 0.5f}});
  EXPECT_THROW(simulator.rollout(scene, environment, {4}, history, {.frames = 1, .progress = {}}), ConfigError);
  EXPECT_THROW(simulator.one_step(environment, {4}, history), ConfigError);
  EXPECT_NO_THROW(simulator.one_step(environment, {4}, history, nullptr, {1}));
}

}  // namespace
}  // namespace graupel::graph
