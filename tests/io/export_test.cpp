#include "io/export/export.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointCount.h>

#include <cstring>
#include <limits>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/export/export_frames.h"
#include "io/mesh/mesh_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr std::size_t particles = 50;

Trajectory sample() {
  Trajectory out = sample_header(particles);
  for (int k = 0; k < 3; ++k) out.frames.push_back(sample_frame(particles, k));
  return out;
}

/// All frames of a trajectory, as `graupel export` writes them.
void export_points(const std::string& format, const Trajectory& trajectory, const std::string& folder,
                   const std::string& name) {
  const auto writer = make_point_writer(format, {.folder = folder, .name = name, .frame_time = 0.1});
  for (std::size_t k = 0; k < trajectory.frames.size(); ++k)
    writer->write(static_cast<int64_t>(k), points_of(trajectory.particle_type, trajectory.frames[k]));
  writer->finish();
}

/// Values of a named array of a raw-appended VTK file.
template <typename T>
std::vector<T> vtk_array(const std::string& bytes, const std::string& name) {
  const auto tag = bytes.find("Name=\"" + name + "\"");
  EXPECT_NE(tag, std::string::npos) << name;
  const std::size_t offset = std::stoul(bytes.substr(bytes.find("offset=\"", tag) + 8, 20));
  const std::string mark = "<AppendedData encoding=\"raw\">\n_";
  const char* block = bytes.data() + bytes.find(mark) + mark.size() + offset;
  uint64_t size = 0;
  std::memcpy(&size, block, sizeof size);
  std::vector<T> values(size / sizeof(T));
  std::memcpy(values.data(), block + sizeof size, size);
  return values;
}

TEST(Export, VtpHoldsPointsVelocitiesTypesAndTimes) {
  TemporaryFolder folder;
  const Trajectory trajectory = sample();
  export_points("vtp", trajectory, folder.file("out"), "run-1");
  const std::string bytes = bytes_of(folder.file("out/run-1_0002.vtp"));
  EXPECT_NE(bytes.find("header_type=\"UInt64\""), std::string::npos);
  EXPECT_NE(bytes.find("NumberOfPoints=\"50\" NumberOfVerts=\"50\""), std::string::npos);
  EXPECT_EQ(vtk_array<Vec3f>(bytes, "Points"), trajectory.frames[2].position);
  EXPECT_EQ(vtk_array<Vec3f>(bytes, "velocity"), trajectory.frames[2].velocity);
  EXPECT_EQ(vtk_array<int32_t>(bytes, "particle_type"), trajectory.particle_type);
  EXPECT_EQ(vtk_array<int32_t>(bytes, "id")[49], 49);
  EXPECT_EQ(vtk_array<double>(bytes, "TimeValue"), std::vector<double>{trajectory.frames[2].time});
  EXPECT_EQ(vtk_array<int64_t>(bytes, "connectivity")[49], 49);
  EXPECT_EQ(vtk_array<int64_t>(bytes, "offsets")[49], 50);
  const std::string times = bytes_of(folder.file("out/run-1.pvd"));
  EXPECT_NE(times.find("<DataSet timestep=\"0.1\" file=\"run-1_0000.vtp\"/>"), std::string::npos) << times;
  EXPECT_NE(times.find("file=\"run-1_0002.vtp\"/>"), std::string::npos);
}

TEST(Export, PlyReadsBack) {
  TemporaryFolder folder;
  const Trajectory trajectory = sample();
  export_points("ply", trajectory, folder.path(), "run");
  const auto points = read_points(folder.file("run_0001.ply"));
  ASSERT_EQ(points.size(), particles);
  for (std::size_t i = 0; i < particles; ++i)
    EXPECT_EQ(points[i], trajectory.frames[1].position[i].cast<double>()) << i;
  const std::string bytes = bytes_of(folder.file("run_0001.ply"));
  const std::string mark = "end_header\n";
  const std::size_t start = bytes.find(mark) + mark.size();
  EXPECT_EQ(bytes.size() - start, particles * 32);
  Vec3f velocity;
  int32_t type;
  std::memcpy(&velocity, bytes.data() + start + 7 * 32 + 12, sizeof velocity);
  std::memcpy(&type, bytes.data() + start + 7 * 32 + 24, sizeof type);
  EXPECT_EQ(velocity, trajectory.frames[1].velocity[7]);
  EXPECT_EQ(type, trajectory.particle_type[7]);
}

TEST(Export, ParticlesThatAreNotInTheRunAreLeftOut) {
  Trajectory trajectory = sample_header(6);
  trajectory.frames.push_back(sample_frame(6, 0));
  trajectory.frames[0].active = {1, 0, 0, 1, 1, 0};
  const PointFrame active = points_of(trajectory.particle_type, trajectory.frames[0]);
  EXPECT_EQ(active.id, (std::vector<int32_t>{0, 3, 4}));
  EXPECT_EQ(active.particle_type, (std::vector<int32_t>{5, 4, 5}));
  EXPECT_EQ(active.position[1], trajectory.frames[0].position[3]);
  EXPECT_EQ(active.velocity[2], trajectory.frames[0].velocity[4]);
  const TemporaryFolder folder;
  export_points("ply", trajectory, folder.file("out"), "some");
  EXPECT_NE(bytes_of(folder.file("out") + "/some_0000.ply").find("element vertex 3\n"), std::string::npos);
}

TEST(Export, VolumeRatioIsWhatTheFieldsTell) {
  // Water (5) stores J itself, sand (6) and snow (8) have det F, obstacles (3) keep their volume.
  ParticleFrame frame = sample_frame(4, 0);
  const std::vector<int32_t> type = {5, 6, 8, 3};
  EXPECT_TRUE(points_of(type, frame).volume_ratio.empty());
  frame.fields[ParticleField::plastic] = {0.9f, 7, 7, 7};
  EXPECT_TRUE(points_of(type, frame).volume_ratio.empty()) << "sand's J is not known";
  auto& F = frame.fields[ParticleField::deformation_gradient];
  F.assign(36, 0);
  const float diagonal[4] = {1, 2, 0.5f, 1};
  for (std::size_t p = 0; p < 4; ++p)
    for (std::size_t i = 0; i < 3; ++i) F[9 * p + 4 * i] = diagonal[p];
  F[9 + 1] = 5;  // a shear changes no volume
  EXPECT_EQ(points_of(type, frame).volume_ratio, (std::vector<float>{0.9f, 8, 0.125f, 1}));
  frame.active = {0, 1, 0, 1};
  EXPECT_EQ(points_of(type, frame).volume_ratio, (std::vector<float>{8, 1}));
  const TemporaryFolder folder;
  const auto writer = make_point_writer("vtp", {.folder = folder.path(), .name = "run"});
  writer->write(0, points_of(type, frame));
  EXPECT_EQ(vtk_array<float>(bytes_of(folder.file("run_0000.vtp")), "J"), (std::vector<float>{8, 1}));
  frame.fields[ParticleField::plastic].clear();
  EXPECT_FALSE(points_of(type, frame).has_volume_ratio()) << "in no frame, as in those with water";
}

/// Sequences have the same attributes in all frames.
TEST(Export, FramesWithoutParticlesHaveAllAttributes) {
  ParticleFrame frame = sample_frame(4, 0);
  frame.fields[ParticleField::plastic] = {1, 1, 1, 1};
  frame.active = {0, 0, 0, 0};
  const PointFrame none = points_of({5, 5, 5, 3}, frame);
  EXPECT_TRUE(none.position.empty() && none.has_velocity() && none.has_volume_ratio());
  const TemporaryFolder folder;
  const auto write = [&](const std::string& format, const std::string& file) {
    const auto writer = make_point_writer(format, {.folder = folder.path(), .name = "run"});
    writer->write(0, none);
    writer->finish();
    return bytes_of(folder.file(file));
  };
  const auto expect = [](const std::string& bytes, const std::vector<std::string>& words) {
    for (const std::string& word : words) EXPECT_NE(bytes.find(word), std::string::npos) << word;
  };
  expect(write("vtp", "run_0000.vtp"), {"Name=\"velocity\"", "Name=\"J\""});
  expect(write("ply", "run_0000.ply"), {"property float vx", "property float J"});
  expect(write("bgeo", "run_0000.bgeo"), {std::string("\0\1v\0\3", 5), std::string("\0\1J\0\1", 5)});
  expect(write("usda", "run.usda"), {"velocities.timeSamples", "primvars:J.timeSamples"});
  write("vdb", "run_0000.vdb");
}

TEST(Export, PointsHaveTheMaterialWhereItIsStored) {
  ParticleFrame frame = sample_frame(4, 0);
  frame.active = {1, 0, 1, 1};
  const PointFrame points = points_of({6, 6, 6, 3}, frame, {{1, 0, 0, -1}, {"dry", "wet"}});
  const std::vector<int32_t> material = {1, 0, -1};
  EXPECT_EQ(points.materials.index, material);
  const TemporaryFolder folder;
  for (const std::string& format : point_formats()) {
    const auto writer = make_point_writer(format, {.folder = folder.path(), .name = "run"});
    writer->write(0, points);
    writer->finish();
    const std::string bytes = bytes_of(folder.file(format == "usda" ? "run.usda" : "run_0000." + format));
    EXPECT_NE(bytes.find("material"), std::string::npos) << format;
  }
  EXPECT_EQ(vtk_array<int32_t>(bytes_of(folder.file("run_0000.vtp")), "material"), material);
  const std::string ply = bytes_of(folder.file("run_0000.ply"));
  EXPECT_NE(ply.find("property int type\nproperty int id\nproperty int material\nend_header\n"), std::string::npos);
  int32_t last = 0;
  std::memcpy(&last, ply.data() + ply.size() - 4, 4);
  EXPECT_EQ(last, -1);
  EXPECT_NE(bytes_of(folder.file("run.usda")).find("0: [1, 0, -1],"), std::string::npos);
}

TEST(Export, PlyWithoutVelocitiesHasNoSuchProperties) {
  TemporaryFolder folder;
  Trajectory trajectory = sample();
  for (auto& frame : trajectory.frames) frame.velocity.clear();
  export_points("ply", trajectory, folder.path(), "run");
  EXPECT_EQ(bytes_of(folder.file("run_0000.ply")).find("vx"), std::string::npos);
  EXPECT_EQ(read_points(folder.file("run_0000.ply")).size(), particles);
}

TEST(Export, VdbPointsReadBack) {
  TemporaryFolder folder;
  const Trajectory trajectory = sample();
  export_points("vdb", trajectory, folder.path(), "run");
  EXPECT_FALSE(std::filesystem::exists(folder.file("run_0002.vdb.part")));
  openvdb::initialize();
  openvdb::io::File file(folder.file("run_0002.vdb"));
  file.open(false);
  const auto grid = openvdb::gridPtrCast<openvdb::points::PointDataGrid>(file.readGrid("particles"));
  ASSERT_TRUE(grid);
  EXPECT_EQ(openvdb::points::pointCount(grid->tree()), particles);
  std::size_t seen = 0;
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
    const openvdb::points::AttributeHandle<openvdb::Vec3f> p(leaf->constAttributeArray("P"));
    const openvdb::points::AttributeHandle<openvdb::Vec3f> v(leaf->constAttributeArray("v"));
    const openvdb::points::AttributeHandle<int32_t> id(leaf->constAttributeArray("id"));
    const openvdb::points::AttributeHandle<int32_t> type(leaf->constAttributeArray("type"));
    for (auto point = leaf->beginIndexOn(); point; ++point, ++seen) {
      const auto i = static_cast<std::size_t>(id.get(*point));
      ASSERT_LT(i, particles);
      EXPECT_EQ(type.get(*point), trajectory.particle_type[i]);
      const openvdb::Vec3d world = grid->indexToWorld(openvdb::Vec3d(p.get(*point)) + point.getCoord().asVec3d());
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(world[axis], trajectory.frames[2].position[i][axis], 1e-5);
        EXPECT_EQ(v.get(*point)[axis], trajectory.frames[2].velocity[i][axis]);
      }
    }
  }
  EXPECT_EQ(seen, particles);
}

TEST(Export, VdbTakesParticlesThatShareAPlace) {
  TemporaryFolder folder;
  for (const std::size_t count : {1u, 5u}) {
    Trajectory trajectory = sample_header(count);
    trajectory.frames.push_back(
        {.time = 0, .position = std::vector<Vec3f>(count, Vec3f{0.3f, 0.2f, 0.1f}), .velocity = {}});
    export_points("vdb", trajectory, folder.path(), "run");
    openvdb::initialize();
    openvdb::io::File file(folder.file("run_0000.vdb"));
    file.open(false);
    const auto grid = openvdb::gridPtrCast<openvdb::points::PointDataGrid>(file.readGrid("particles"));
    EXPECT_EQ(openvdb::points::pointCount(grid->tree()), count);
  }
}

TEST(Export, RefusesBadNamesAndFolders) {
  TemporaryFolder folder;
  const Trajectory trajectory = sample();
  expect_error<ConfigError>([&] { export_points("ply", trajectory, folder.path(), "../run"); },
                            {"'../run'", "allowed: letters"});
  expect_error<ConfigError>([&] { export_points("vtp", trajectory, folder.path(), ""); }, {"allowed: letters"});
  expect_error<ConfigError>([&] { export_points("abc", trajectory, folder.path(), "run"); },
                            {"'abc'", "allowed: vtp, ply, vdb, bgeo, usda"});
  expect_error<ConfigError>([&] { make_surface_writer("stl", {.folder = folder.path(), .name = "run"}); },
                            {"'stl'", "allowed: obj, ply, vtp, vdb, usda"});
  folder.write("file", "x");
  expect_error<IoError>([&] { export_points("ply", trajectory, folder.file("file/sub"), "run"); }, {"file/sub"});
}

TEST(Export, VdbRefusesPositionsThatAreNotFinite) {
  TemporaryFolder folder;
  Trajectory trajectory = sample();
  trajectory.frames[1].position[3][0] = std::numeric_limits<float>::quiet_NaN();
  expect_error<DivergedError>([&] { export_points("vdb", trajectory, folder.path(), "run"); },
                              {"frame 1", "particle 3", "not finite"});
}

}  // namespace
}  // namespace graupel::io
