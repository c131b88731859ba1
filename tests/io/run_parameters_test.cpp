// Parameters of a run in its trajectory: written, merged and read back; attributes that do not fit are refused.
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

void write_run(const std::string& path, const std::vector<NamedValue>& parameters) {
  TrajectoryWriter writer(path, sample_header(10));
  writer.parameters(parameters);
  writer.append(sample_frame(10, 0));
  writer.finish();
}

TEST(RunParameters, AreReadBackFromMergedFiles) {
  const TemporaryFolder folder;
  const std::vector<NamedValue> one = {{"friction_angle", "degrees", 22.5}};
  const std::vector<NamedValue> three = {{"a, b", "", 0.1}, {"speed", "m/s", -3e-300}, {"\xc2\xb5", "Pa s", 4}};
  write_run(folder.file("one.h5"), one);
  write_run(folder.file("three.h5"), three);
  write_run(folder.file("none.h5"), {});
  merge_trajectories({folder.file("three.h5"), folder.file("none.h5"), folder.file("one.h5")}, folder.file("all.h5"));
  const TrajectoryReader reader(folder.file("all.h5"));
  EXPECT_EQ(reader.parameters(0), three);
  EXPECT_EQ(reader.parameters(1), std::vector<NamedValue>{});
  EXPECT_EQ(reader.parameters(2), one);
}

TEST(RunParameters, ListsOfDifferentLengthsAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  write_run(path, {{"a", "m", 1}, {"b", "s", 2}});
  {
    const hdf5::Handle file(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose, "cannot open");
    const hdf5::Handle group(H5Gopen2(file, "00000", H5P_DEFAULT), H5Gclose, "cannot open");
    hdf5::check(H5Adelete(group, "parameter_values"), "cannot delete");
    hdf5::write_attribute(group, "parameter_values", std::vector<double>{1});
  }
  const TrajectoryReader reader(path);
  expect_error<InputError>([&] { reader.parameters(0); }, {"a.h5", "2 names, 2 units and 1 values"});
}

TEST(RunParameters, AttributesOfAnotherKindCountAsNone) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, sample_header(10));
    writer.attribute("parameter_values", "text");
    writer.append(sample_frame(10, 0));
    writer.finish();
  }
  EXPECT_TRUE(TrajectoryReader(path).parameters(0).empty());
}

}  // namespace
}  // namespace graupel::io
