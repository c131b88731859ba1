// graupel export: the sizes of particles, and the surfaces that follow from them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/system/atomic_file.h"
#include "io/mesh/mesh_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/falling_model.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

class ExportedSizes : public testing::Test {
 protected:
  Outcome exported(const std::string& run, const std::string& arguments) const {
    return graupel("export " + run + " --frames 0 -o " + folder_.file("out") + " " + arguments);
  }

  /// Twice `pscale` of all particles, in rows of `numbers` numbers.
  std::vector<float> sizes_of(const std::string& run, std::size_t numbers, std::size_t particles) const {
    const Outcome outcome = exported(run, "-f bgeo --name run");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    const std::string bytes = read_file(folder_.file("out/run_0000.bgeo"));
    const std::size_t row = 4 * numbers, first = bytes.size() - 2 - row * particles;
    std::vector<float> sizes;
    for (std::size_t i = 0; i < particles; ++i) {
      std::string raw = bytes.substr(first + (i + 1) * row - 4, 4);
      std::reverse(raw.begin(), raw.end());
      float value;
      std::memcpy(&value, raw.data(), sizeof value);
      sizes.push_back(2 * value);
    }
    return sizes;
  }

  /// Of the surface of the only material.
  double volume_of(const std::string& run, const std::string& material, const std::string& arguments = "") const {
    const Outcome outcome = exported(run, "--surface -f obj --name run " + arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    const TriangleMesh mesh = io::read_mesh(folder_.file("out/run_" + material + "_0000.obj"));
    double volume = 0;
    for (const auto& [a, b, c] : mesh.triangles) {
      const auto corner = [&](int32_t i) { return mesh.vertices[static_cast<std::size_t>(i)]; };
      volume += dot(corner(a), cross(corner(b), corner(c))) / 6;
    }
    return volume;
  }

  std::size_t particles_of(const std::string& run) const {
    return io::TrajectoryReader(run).header(0).particle_count();
  }

  Folder folder_;
  std::string run_ = folder_.file("run.h5");
};

constexpr double dx = 0.03125;
constexpr std::size_t with_velocity = 10;  ///< x y z w, v, id, type, pscale

TEST_F(ExportedSizes, OfPointsThatRefineTheParticles) {
  const std::string scene = folder_.write("falling.json", falling_scene()), model = folder_.file("falling.safetensors");
  nn::write_safetensors(model, falling_model(io::read_scene(scene)).store(nn::DType::f32));
  const Outcome made = graupel("rollout " + model + " " + scene + " --refine 27 --frames 0 -o " + run_);
  ASSERT_EQ(made.exit_code, 0) << made.output;
  const std::size_t points = particles_of(run_);
  ASSERT_EQ(points % 27, 0u);
  for (const float size : sizes_of(run_, with_velocity - 3, points)) ASSERT_NEAR(size, dx / 2 / 3, 1e-7);
  EXPECT_NEAR(volume_of(run_, "sand") / 0.001, 1, 0.08);
}

TEST_F(ExportedSizes, OfSourcesOfOneMaterialAreTheirOwn) {
  const std::string scene = folder_.write("two.json", R"({ "domain": { "dx": 0.03125 },
    "materials": { "water": { "preset": "water" } },
    "sources": [ { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.3, 0.5, 0.5], "material": "water",
                   "particles_per_cell": 64 },
                 { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.7, 0.5, 0.5], "material": "water",
                   "particles_per_cell": 1 } ], "frames": 0 })");
  ASSERT_EQ(graupel("simulate " + scene + " -o " + run_).exit_code, 0);
  const std::vector<float> sizes = sizes_of(run_, with_velocity, particles_of(run_));
  EXPECT_FLOAT_EQ(sizes.front(), dx / 4);
  EXPECT_FLOAT_EQ(sizes.back(), dx);
}

/// The keys of the scene tell the spacing.
TEST_F(ExportedSizes, AreKnownWithoutTheGeometry) {
  std::string points;
  for (int i = 0; i < 1000; ++i)
    points += std::to_string(0.4 + dx / 2 * (i % 10)) + " " + std::to_string(0.4 + dx / 2 * (i / 10 % 10)) + " " +
              std::to_string(0.4 + dx / 2 * (i / 100)) + "\n";
  const std::string file = folder_.write("points.xyz", points);
  const std::string scene = folder_.write(
      "points.json",
      small_scene("", R"({ "shape": "points", "file": "points.xyz", "position": [0, 0, 0], "material": "water" })"));
  const Outcome made = graupel("simulate " + scene + " --frames 0 -o " + run_);
  ASSERT_EQ(made.exit_code, 0) << made.output;
  std::filesystem::remove(file);
  EXPECT_FLOAT_EQ(sizes_of(run_, with_velocity, 1000).back(), dx / 2);
  EXPECT_NEAR(volume_of(run_, "water") / std::pow(10 * dx / 2, 3), 1, 0.08);
}

TEST_F(ExportedSizes, ThatAreNotKnownAreTold) {
  Trajectory header;
  header.particle_type = {5, 5};
  io::TrajectoryWriter writer(run_, header);
  writer.append({.position = {{0, 0, 0}, {1, 0, 0}}, .velocity = {{0, 0, 0}, {0, 0, 0}}});
  writer.finish();
  const std::string says = "the size of the particles in '" + run_ + "' is not known (the file stores no scene)";
  const Outcome outcome = exported(run_, "-f usda");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_TRUE(outcome.says(says + ": 0.01 m is written")) << outcome.output;
  EXPECT_FALSE(exported(run_, "-f ply").says("the size"));
  EXPECT_TRUE(exported(run_, "-f ply --surface").says(says + ". Give it by --radius"));
}

}  // namespace
}  // namespace graupel::test
