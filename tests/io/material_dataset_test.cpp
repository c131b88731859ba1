// The materials of particles in trajectory files, where two are of one law: kept by all that writes files, checked by
// all that reads them.
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5_dataset.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

constexpr std::size_t particles = 6;

/// Types 5, 6, 8, 4, 5, 6; the last one is of an obstacle, which has no material.
Trajectory header_of() {
  Trajectory header = sample_header(particles);
  header.particle_type.back() = 3;
  header.materials = {{2, 0, 3, 1, 2, -1}, {"dry sand", "jelly", "sea", "snow \xc3\xbc"}};
  return header;
}

void write_frames(TrajectoryWriter& writer, int first, int last) {
  for (int k = first; k <= last; ++k) writer.append(sample_frame(particles, k));
}

std::string write(const TemporaryFolder& folder, const std::string& name, const Trajectory& header) {
  TrajectoryWriter writer(folder.file(name), header);
  write_frames(writer, 0, 9);
  writer.finish();
  return folder.file(name);
}

ParticleMaterials materials_in(const std::string& path, int trajectory = 0) {
  return TrajectoryReader(path).header(trajectory).materials;
}

TEST(StoredMaterials, ReadBackAndAreAbsentWhereTypesTell) {
  const TemporaryFolder folder;
  EXPECT_EQ(materials_in(write(folder, "named.h5", header_of())), header_of().materials);
  const std::string plain = write(folder, "plain.h5", sample_header(particles));
  EXPECT_TRUE(materials_in(plain).empty());
  const hdf5::Handle file = hdf5::open_file(plain);
  const hdf5::Handle group(H5Gopen2(file, "00000", H5P_DEFAULT), H5Gclose, "cannot open");
  EXPECT_FALSE(hdf5::has_member(group, "material"));
}

TEST(StoredMaterials, AreRecoveredAndMerged) {
  const TemporaryFolder folder;
  const std::string path = folder.file("killed.h5");
  {
    TrajectoryWriter writer(path, header_of());
    write_frames(writer, 0, 12);
  }
  ASSERT_GE(recover_part_file(path, true), 8);
  EXPECT_EQ(materials_in(path), header_of().materials);
  merge_trajectories({write(folder, "plain.h5", sample_header(particles)), path}, folder.file("both.h5"));
  EXPECT_TRUE(materials_in(folder.file("both.h5"), 0).empty());
  EXPECT_EQ(materials_in(folder.file("both.h5"), 1), header_of().materials);
}

TEST(StoredMaterials, AResumedRunHasTheBytesOfAnUninterruptedOne) {
  const TemporaryFolder folder;
  const std::string path = folder.file("run.h5");
  TrajectoryCheckpoint checkpoint;
  {
    TrajectoryWriter writer(path, header_of());
    write_frames(writer, 0, 4);
    checkpoint = {4, writer.checkpoint()};
  }
  Trajectory other = header_of();
  std::swap(other.materials.index[0], other.materials.index[1]);
  expect_error<InputError>([&] { TrajectoryWriter(path, other, {}, checkpoint); }, {"it has other particles"});
  other.materials = {};
  expect_error<InputError>([&] { TrajectoryWriter(path, other, {}, checkpoint); }, {"it has other particles"});
  TrajectoryWriter writer(path, header_of(), {}, checkpoint);
  write_frames(writer, 5, 9);
  writer.finish();
  EXPECT_TRUE(bytes_of(path) == bytes_of(write(folder, "whole.h5", header_of())));
}

/// A trajectory whose group is changed before it is read.
template <typename Change>
std::string changed(const TemporaryFolder& folder, const std::string& name, const Change& change) {
  const std::string path = write(folder, name, header_of());
  const hdf5::Handle file(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose, "cannot open");
  const hdf5::Handle group(H5Gopen2(file, "00000", H5P_DEFAULT), H5Gclose, "cannot open");
  change(group);
  return path;
}

void replace(hid_t group, const std::vector<int32_t>& index) {
  H5Ldelete(group, "material", H5P_DEFAULT);
  const hdf5::Handle dataset =
      hdf5::create_dataset(group, "material", {.element = hdf5::Element::int32, .size = {index.size()}});
  hdf5::write_all(dataset, hdf5::Element::int32, index.data());
}

TEST(StoredMaterials, ThatDoNotFitAreRefused) {
  const TemporaryFolder folder;
  const auto fails = [&](const std::string& path, const std::string& part) {
    expect_error<InputError>([&] { TrajectoryReader(path).header(0); }, {path, part});
    std::filesystem::rename(path, path + ".part");
    expect_error<InputError>([&] { recover_part_file(path, true); }, {path, part});
  };
  for (const int32_t bad : {4, 2147483647, -1, -2147483647})
    fails(changed(folder, "index.h5",
                  [&](hid_t group) {
                    replace(group, {2, 0, bad, 1, 2, -1});
                  }),
          "'material' of particle 2 is " + std::to_string(bad) + " (allowed: 0 to 3, places in");
  fails(changed(folder, "none.h5",
                [&](hid_t group) {
                  replace(group, {2, 0, 3, 1, 2, -2});
                }),
        "'material' of particle 5 is -2 (allowed: -1 to 3");
  fails(changed(folder, "length.h5",
                [&](hid_t group) {
                  replace(group, {2, 0, 3});
                }),
        "'material' has 3 particles, and 'particle_type' 6");
  fails(changed(folder, "names.h5", [](hid_t group) { H5Adelete(group, "material_names"); }),
        "'material' lacks its attribute 'material_names'");
  fails(changed(folder, "text.h5",
                [](hid_t group) {
                  H5Adelete(group, "material_names");
                  hdf5::write_attribute(group, "material_names", std::vector<double>(4, 1.0));
                }),
        "'material' lacks its attribute 'material_names'");
  fails(changed(folder, "real.h5",
                [](hid_t group) {
                  H5Ldelete(group, "material", H5P_DEFAULT);
                  const hdf5::Handle dataset = hdf5::create_dataset(group, "material", {.size = {particles}});
                  hdf5::write_all(dataset, hdf5::Element::float32, std::vector<float>(particles).data());
                }),
        "'material' does not hold whole numbers");
  fails(changed(folder, "group.h5",
                [](hid_t group) {
                  H5Ldelete(group, "material", H5P_DEFAULT);
                  hdf5::create_group(group, "material");
                }),
        "cannot open 'material' as a dataset");
}

}  // namespace
}  // namespace graupel::io
