// Data sets: their metadata, and errors that name a trajectory.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5.h"
#include "io/trajectory/trajectory_file.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

/// Two particles, the second an obstacle; the first moves along x by 1, 2, 4 and then 100 per frame (after a blow-up).
void write_set(const std::string& path) {
  Trajectory header;
  header.particle_type = {6, 3};
  header.frame_time = 0.02;
  TrajectoryWriter writer(path, header, {.velocity = false});
  const float x[] = {0, 1, 3, 7, 107};
  for (int k = 0; k < 5; ++k) {
    ParticleFrame frame;
    frame.time = 0.02 * k;
    frame.position = {{x[k], 0.5f, 0}, {-1000.0f * static_cast<float>(k), 0, 0}};
    writer.append(frame);
  }
  writer.finish(4);
}

TEST(DataSetMetadata, HoldsTheKeysAndStatistics) {
  TemporaryFolder folder;
  write_set(folder.file("train.h5"));
  write_set(folder.file("a.h5"));
  merge_trajectories({folder.file("a.h5"), folder.file("a.h5")}, folder.file("test.h5"));
  Scene scene;
  scene.name = "slide";
  scene.domain.dx = 0.1;
  scene.domain.wall_cells = 2;
  write_data_set_metadata(folder.path(), scene, 0.035);
  const auto m = nlohmann::json::parse(bytes_of(folder.file("metadata.json")));
  EXPECT_EQ(m["dim"], 3);
  EXPECT_DOUBLE_EQ(m["dt"], 0.02);
  EXPECT_EQ(m["sequence_length"], 4);  // frames - 1, as DeepMind counts
  EXPECT_EQ(m["num_trajs_train"], 1);
  EXPECT_EQ(m["num_trajs_test"], 2);
  EXPECT_FALSE(m.contains("num_trajs_valid"));
  EXPECT_EQ(m["num_particles_max"], 2);
  EXPECT_DOUBLE_EQ(m["default_connectivity_radius"], 0.035);
  EXPECT_DOUBLE_EQ(m["bounds"][0][0], 0.2);
  EXPECT_DOUBLE_EQ(m["bounds"][2][1], 0.8);
  EXPECT_EQ(m["periodic_boundary_conditions"], nlohmann::json({false, false, false}));
  // velocities 1, 2, 4 (not the obstacle's, not those after the blow-up), accelerations 1, 2
  EXPECT_DOUBLE_EQ(m["vel_mean"][0], 7.0 / 3);
  EXPECT_NEAR(m["vel_std"][0], std::sqrt(7.0 - 49.0 / 9), 1e-12);
  EXPECT_DOUBLE_EQ(m["acc_mean"][0], 1.5);
  EXPECT_DOUBLE_EQ(m["acc_std"][0], 0.5);
  EXPECT_EQ(m["vel_std"][1], 0);
  EXPECT_EQ(m["material_names"]["6"], "sand");
}

TEST(DataSetMetadata, NeedsATrainingSet) {
  TemporaryFolder folder;
  EXPECT_THROW(write_data_set_metadata(folder.path(), Scene{}, 0.03), InputError);
}

TEST(DataSet, ErrorsNameTheTrajectory) {
  const TemporaryFolder folder;
  for (const char* part : {"a.h5", "b.h5"}) write_set(folder.file(part));
  merge_trajectories({folder.file("a.h5"), folder.file("b.h5")}, folder.file("set.h5"));
  {
    const hdf5::Handle file(H5Fopen(folder.file("set.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose, "cannot open");
    hdf5::check(H5Ldelete(file, "/00001/particle_type", H5P_DEFAULT), "cannot delete");
  }
  const TrajectoryReader reader(folder.file("set.h5"));
  EXPECT_NO_THROW(reader.header(0));
  expect_error<InputError>([&] { reader.header(1); }, {"set.h5' (trajectory 1: ", "particle_type"});
}

}  // namespace
}  // namespace graupel::io
