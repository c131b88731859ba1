// The material of each particle of a stored trajectory.
#include "mpm/scene/particle_materials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/system/error.h"
#include "mpm/sampling.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using ::testing::HasSubstr;

/// A soft and a hard jelly, an emitter of the soft one, and water.
Scene three_materials() {
  Scene scene;
  scene.materials["soft"] = scene.materials["hard"] = preset("taichi_jelly");
  scene.materials["soft"].youngs_modulus = 3e4;
  scene.materials["water"] = preset("taichi_water");
  const Vec3d size = Vec3d::filled(0.05);
  scene.sources = {box_source("soft", {0.3, 0.5, 0.5}, size), box_source("hard", {0.6, 0.5, 0.5}, size),
                   box_source("water", {0.5, 0.3, 0.5}, size)};
  Emitter emitter;
  emitter.material = "soft";
  emitter.shape = Shape::box;
  emitter.size = {0.06, 0.03, 0.06};
  emitter.position = {0.5, 0.8, 0.5};
  emitter.velocity = {0, -1, 0};
  emitter.end_time = 0.2;
  scene.emitters.push_back(emitter);
  return scene;
}

struct Stored {
  Trajectory header;
  std::vector<Vec3f> start;
};

Stored stored(const Scene& scene, uint64_t seed) {
  Stored made;
  made.header.seed = seed;
  made.header.made_by = "mpm";
  const SampledParticles sampled = sample_sources(scene, seed);
  for (std::size_t p = 0; p < sampled.position.size(); ++p) {
    const std::string& name = sampled.material_names[static_cast<std::size_t>(sampled.material[p])];
    made.header.particle_type.push_back(particle_type_of(scene.materials.at(name).model));
    made.start.push_back(sampled.position[p].cast<float>());
  }
  return made;
}

std::string refusal(const Scene& scene, const Stored& data) {
  try {
    network_materials(scene, data.header, data.start, "'data.h5': trajectory 3");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ParticleMaterials, OfOneLawAreThoseOfTheirSources) {
  const Scene scene = three_materials();
  const Stored data = stored(scene, 7);
  const auto found = particle_materials(scene, data.header, data.start, "");
  const SampledParticles sampled = sample_sources(scene, 7);
  ASSERT_EQ(found.size(), sampled.source.size());
  constexpr int32_t hard = 0, soft = 1, water = 2;  // in map order
  constexpr int32_t of_source[] = {soft, hard, water, soft};
  std::set<int32_t> sources;
  for (std::size_t p = 0; p < found.size(); ++p) {
    EXPECT_EQ(found[p], of_source[sampled.source[p]]);
    sources.insert(sampled.source[p]);
  }
  EXPECT_EQ(sources.size(), 4u);
}

TEST(ParticleMaterials, AreToldByTypesWhereLawsDiffer) {
  Scene scene = three_materials();
  scene.materials.erase("soft");
  scene.sources.erase(scene.sources.begin());
  scene.emitters.clear();
  Stored data;  // particles that the scene's sources do not make
  data.header.particle_type = {5, 4, obstacle_particle_type, 5};
  EXPECT_EQ(particle_materials(scene, data.header, {}, ""), (std::vector<int32_t>{1, 0, -1, 1}));
  data.header.particle_type = {8};
  EXPECT_THAT(refusal(scene, data), HasSubstr("'data.h5': trajectory 3 has particles of a type"));
}

TEST(ParticleMaterials, OfOtherParticlesThanTheScenesAreNotGuessed) {
  const Scene scene = three_materials();
  const Stored good = stored(scene, 7);
  EXPECT_EQ(refusal(scene, good), "");
  Stored other = good;
  other.start[3][0] += 0.01f;
  EXPECT_THAT(refusal(scene, other), HasSubstr("two materials of one law, and its scene and seed place particle 3"));
  other = good;
  other.header.particle_type.pop_back();
  EXPECT_THAT(refusal(scene, other), HasSubstr("another number of particles"));
}

TEST(ParticleMaterials, ThatTheFileKeepsNeedNoSampling) {
  const Scene scene = three_materials();
  Stored data = stored(scene, 7);
  const SampledParticles sampled = sample_sources(scene, 7);
  data.header.materials = kept_materials(scene, 7);
  EXPECT_EQ(data.header.materials.names, (std::vector<std::string>{"hard", "soft", "water"}));
  EXPECT_EQ(data.header.materials.index, sampled.material);
  data.start[3][0] += 0.01f;
  EXPECT_EQ(particle_materials(scene, data.header, data.start, ""), sampled.material);
  data.header.materials.names = {"hard", "water", "soft"};  // another order than the scene's
  auto& index = data.header.materials.index;
  for (int32_t& i : index) i = i == 0 ? 0 : 3 - i;
  EXPECT_EQ(particle_materials(scene, data.header, data.start, ""), sampled.material);
  data.header.materials.names[0] = "hardest";
  EXPECT_THAT(refusal(scene, data), HasSubstr("of the material 'hardest', which its scene lacks"));
  Scene one = scene;
  one.materials.erase("hard");
  one.sources.erase(one.sources.begin() + 1);
  EXPECT_TRUE(kept_materials(one, 7).empty());
}

TEST(ParticleMaterials, OfOtherProgramsDataMustBeTold) {
  Scene scene;
  MaterialConfig& sand = scene.materials["sand"];
  sand.name = "sand";
  sand.model = MaterialModel::sand;
  Stored data;
  data.header.particle_type = {6, 6};
  EXPECT_EQ(refusal(scene, data), "");  // a scene of MPM ran with the defaults
  data.header.made_by = "converted from GNS";
  const std::string text = refusal(scene, data);
  for (const char* part :
       {"'data.h5': trajectory 3", "materials.sand", "--set materials.sand.preset", "material_constants=false"})
    EXPECT_THAT(text, HasSubstr(part));
  sand.friction_angle = 30;
  EXPECT_EQ(refusal(scene, data), "");
}

}  // namespace
}  // namespace graupel::mpm
