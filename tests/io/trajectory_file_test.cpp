#include "io/trajectory/trajectory_file.h"

#include <gtest/gtest.h>
#include <sys/mount.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <tuple>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/hdf5/hdf5_dataset.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

void write(const std::string& path, std::size_t particles, int frames, const TrajectoryWriteOptions& options = {}) {
  TrajectoryWriter writer(path, sample_header(particles), options);
  for (int k = 0; k < frames; ++k) writer.append(sample_frame(particles, k));
  writer.finish();
}

/// Output of a shell command, and whether it succeeded.
std::pair<std::string, bool> output_of(const std::string& command) {
  std::string text;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  std::array<char, 256> buffer;
  while (fgets(buffer.data(), buffer.size(), pipe)) text += buffer.data();
  return {text, pclose(pipe) == 0};
}

TEST(TrajectoryFile, RoundTrips) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, sample_header(37));
    for (int k = 0; k < 21; ++k) writer.append(sample_frame(37, k));
    writer.attribute("note", "kept");
    EXPECT_FALSE(std::filesystem::exists(path));
    writer.finish(17);
  }
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
  const TrajectoryReader reader(path);
  EXPECT_TRUE(reader.complete());
  ASSERT_EQ(reader.count(), 1);
  const Trajectory read = reader.read(0);
  const Trajectory header = sample_header(37);
  EXPECT_EQ(read.particle_type, header.particle_type);
  EXPECT_EQ(read.frame_time, header.frame_time);
  EXPECT_EQ(read.scene_json, header.scene_json);
  EXPECT_EQ(read.seed, header.seed);
  EXPECT_EQ(read.made_by, "mpm");
  EXPECT_EQ(read.diverged_at_frame, 17);
  ASSERT_EQ(read.frame_count(), 21u);
  for (int k = 0; k < 21; ++k) EXPECT_TRUE(same_frame(read.frames[k], sample_frame(37, k))) << k;
  EXPECT_EQ(reader.initial_velocity(0), sample_frame(37, 0).velocity);
  EXPECT_EQ(reader.attribute(0, "note"), "kept");
  EXPECT_EQ(reader.attribute(0, "other"), "");
  const auto middle = reader.frames(0, 9, 4);
  ASSERT_EQ(middle.size(), 4u);
  EXPECT_TRUE(same_frame(middle[3], sample_frame(37, 12)));
}

TEST(TrajectoryFile, StoresWhichParticlesAreInTheRun) {
  const TemporaryFolder folder;
  const std::string path = folder.file("active.h5");
  const auto frame = [](int f) {
    ParticleFrame out = sample_frame(5, f);
    if (f > 0) out.active = {1, 0, static_cast<uint8_t>(f % 2), 1, 0};
    return out;
  };
  TrajectoryWriteOptions options;
  options.active = true;
  TrajectoryWriter writer(path, sample_header(5), options);
  for (int f = 0; f < 11; ++f) writer.append(frame(f));
  writer.finish();
  const Trajectory back = TrajectoryReader(path).read(0);
  EXPECT_EQ(back.frames[0].active, std::vector<uint8_t>(5, 1));  // a frame that says nothing has all of them
  for (int f = 1; f < 11; ++f) EXPECT_EQ(back.frames[static_cast<std::size_t>(f)].active, frame(f).active);
  EXPECT_FALSE(back.frames[2].is_active(2));
  EXPECT_TRUE(back.frames[3].is_active(2));
}

TEST(TrajectoryFile, InitialVelocitiesThatAreNotFiniteAreRefused) {
  const TemporaryFolder folder;
  TrajectoryWriter writer(folder.file("a.h5"), sample_header(5), {.velocity = false});
  ParticleFrame first = sample_frame(5, 0);
  first.velocity[3][1] = std::numeric_limits<float>::infinity();
  writer.append(first);
  writer.finish();
  const TrajectoryReader reader(folder.file("a.h5"));
  expect_error<InputError>([&] { reader.initial_velocity(0); },
                           {"'initial_velocity' of particle 3 is not finite", "a.h5"});
}

TEST(TrajectoryFile, StoresPositionsOnly) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  write(path, 5, 3, {.velocity = false});
  const TrajectoryReader reader(path);
  EXPECT_TRUE(reader.read(0).frames[2].velocity.empty());
  EXPECT_EQ(reader.initial_velocity(0), sample_frame(5, 0).velocity);
}

TEST(TrajectoryFile, LongSceneTextsAreKept) {  // more than an HDF5 object header holds
  TemporaryFolder folder;
  Trajectory header = sample_header(2);
  header.scene_json = std::string(200000, 'x');
  TrajectoryWriter writer(folder.file("a.h5"), header);
  writer.append(sample_frame(2, 0));
  writer.finish();
  EXPECT_EQ(TrajectoryReader(folder.file("a.h5")).header(0).scene_json, header.scene_json);
}

TEST(TrajectoryFile, LargeFramesAreSplitIntoSeveralChunks) {
  TemporaryFolder folder;
  const std::size_t particles = 400000;  // 4.8 MB a frame, more than one chunk
  write(folder.file("a.h5"), particles, 2, {.velocity = false});
  const auto frames = TrajectoryReader(folder.file("a.h5")).frames(0, 0, 2);
  EXPECT_EQ(frames[1].position, sample_frame(particles, 1).position);
}

TEST(TrajectoryFile, SameContentGivesTheSameBytes) {
  TemporaryFolder folder;
  write(folder.file("a.h5"), 100, 13);
  usleep(1100000);  // HDF5 counts seconds where it notes times
  write(folder.file("b.h5"), 100, 13);
  EXPECT_TRUE(bytes_of(folder.file("a.h5")) == bytes_of(folder.file("b.h5")));
  merge_trajectories({folder.file("a.h5"), folder.file("b.h5")}, folder.file("m.h5"));
  merge_trajectories({folder.file("b.h5"), folder.file("a.h5")}, folder.file("n.h5"));
  EXPECT_TRUE(bytes_of(folder.file("m.h5")) == bytes_of(folder.file("n.h5")));
}

TEST(TrajectoryFile, EveryTruncationIsRefused) {
  TemporaryFolder folder;
  write(folder.file("a.h5"), 20, 9);
  const std::string bytes = bytes_of(folder.file("a.h5"));
  for (std::size_t n = 0; n < bytes.size(); n += bytes.size() / 40 + 1) {
    const std::string cut = folder.write("cut.h5", bytes.substr(0, n));
    expect_error<InputError>([&] { TrajectoryReader reader(cut); }, {"cut.h5", "damaged, cut short"});
  }
}

/// All values of a dataset as the HDF5 library itself reads them.
std::vector<float> library_values(const std::string& path, const char* name) {
  const hdf5::Handle file = hdf5::open_file(path);
  const hdf5::Handle dataset(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose, "cannot open");
  const hdf5::Handle space(H5Dget_space(dataset), H5Sclose, "cannot open");
  std::vector<float> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
  hdf5::check(H5Dread(dataset, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "cannot read");
  return values;
}

TEST(TrajectoryFile, TheLibraryReadsWhatThreadsCompressed) {
  // One chunk a frame and more, chunks of several frames whose last one is not full, no compression.
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  for (const auto& [particles, frames, level] : {std::tuple(400000, 2, 1), {50000, 9, 1}, {700, 19, 6}, {700, 3, 0}}) {
    TrajectoryWriteOptions options;
    options.deflate = level;
    write(path, static_cast<std::size_t>(particles), frames, options);
    const std::vector<float> position = library_values(path, "/00000/position");
    const std::vector<float> velocity = library_values(path, "/00000/velocity");
    const TrajectoryReader reader(path);
    ASSERT_EQ(position.size(), static_cast<std::size_t>(3 * particles * frames));
    for (int f = 0; f < frames; ++f) {
      const ParticleFrame frame = sample_frame(static_cast<std::size_t>(particles), f);
      const std::size_t bytes = frame.position.size() * sizeof(Vec3f), at = static_cast<std::size_t>(3 * particles * f);
      EXPECT_EQ(std::memcmp(frame.position.data(), position.data() + at, bytes), 0) << particles << ", frame " << f;
      EXPECT_EQ(std::memcmp(frame.velocity.data(), velocity.data() + at, bytes), 0) << particles << ", frame " << f;
      EXPECT_TRUE(same_frame(reader.frames(0, f, 1)[0], frame)) << particles << ", frame " << f;
    }
  }
}

TEST(TrajectoryFile, WritersOfSeveralThreadsDoNotDisturbEachOther) {
  const TemporaryFolder folder;
#pragma omp parallel for num_threads(4)
  for (int i = 0; i < 8; ++i) write(folder.file(std::to_string(i)), 500 + static_cast<std::size_t>(i), 20);
  for (int i = 0; i < 8; ++i) {
    const auto particles = 500 + static_cast<std::size_t>(i);
    const Trajectory read = TrajectoryReader(folder.file(std::to_string(i))).read(0);
    ASSERT_EQ(read.frame_count(), 20u);
    for (int f = 0; f < 20; ++f)
      EXPECT_TRUE(same_frame(read.frames[static_cast<std::size_t>(f)], sample_frame(particles, f))) << i;
  }
}

TEST(TrajectoryFile, ADamagedChunkIsNoticed) {
  TemporaryFolder folder;
  write(folder.file("a.h5"), 500, 8, {.velocity = false});
  haddr_t address = 0;
  hsize_t stored = 0;
  {
    const hdf5::Handle file = hdf5::open_file(folder.file("a.h5"));
    const hid_t position = H5Dopen2(file, "/00000/position", H5P_DEFAULT);
    const hsize_t first[] = {0, 0, 0};
    unsigned mask = 0;
    ASSERT_GE(H5Dget_chunk_info_by_coord(position, first, &mask, &address, &stored), 0);
    H5Dclose(position);
  }
  std::string bytes = bytes_of(folder.file("a.h5"));
  bytes[address + stored - 10] = static_cast<char>(bytes[address + stored - 10] ^ 0x10);
  const std::string damaged = folder.write("b.h5", bytes);
  expect_error<InputError>([&] { TrajectoryReader(damaged).read(0); }, {"b.h5", "checksum is wrong"});
}

TEST(TrajectoryFile, NamesMissingAndForeignFiles) {
  TemporaryFolder folder;
  expect_error<InputError>([&] { TrajectoryReader(folder.file("no.h5")); }, {"no.h5", "No such file"});
  const std::string text = folder.write("text.h5", "not HDF5 at all");
  expect_error<InputError>([&] { TrajectoryReader reader(text); }, {"text.h5", "cannot open the file"});
  { const hdf5::Handle file = hdf5::create_file(folder.file("empty.h5")); }
  expect_error<InputError>([&] { TrajectoryReader reader(folder.file("empty.h5")); }, {"there is no trajectory in it"});
  {
    const hdf5::Handle file = hdf5::create_file(folder.file("other.h5"));
    hdf5::write_attribute(file, "format", std::string("something-else"));
  }
  expect_error<InputError>([&] { TrajectoryReader reader(folder.file("other.h5")); },
                           {"its format is 'something-else'"});
  {
    const hdf5::Handle file = hdf5::create_file(folder.file("new.h5"));
    hdf5::write_attribute(file, "format_version", int64_t(9));
  }
  expect_error<InputError>([&] { TrajectoryReader reader(folder.file("new.h5")); }, {"format version 9 is newer"});
}

/// A data-set file made by hand: /00000 with whatever `fill` puts there.
template <typename Fill>
std::string file_with(const TemporaryFolder& folder, const std::string& name, Fill&& fill) {
  const hdf5::Handle file = hdf5::create_file(folder.file(name));
  const hdf5::Handle group = hdf5::create_group(file, "00000");
  fill(group);
  return folder.file(name);
}

void plain(hid_t group, const char* name, const std::vector<hsize_t>& size, hdf5::Element element, const void* values) {
  const hdf5::Handle dataset = hdf5::create_dataset(group, name, {.element = element, .size = size, .chunk = {}});
  hdf5::write_all(dataset, element, values);
}

TEST(TrajectoryFile, RefusesFramesOfOtherParticlesAndPlacesOutside) {
  TemporaryFolder folder;
  const std::string path = folder.file("some.h5");
  {
    TrajectoryWriter writer(path, sample_header(37));
    expect_error<ConfigError>([&] { writer.append(sample_frame(38, 0)); },
                              {path, "has 38 values of 'position' (allowed: 37"});
    ParticleFrame without = sample_frame(37, 0);
    without.velocity.clear();
    expect_error<ConfigError>([&] { writer.append(without); }, {path, "has 0 values of 'velocity'"});
    writer.append(sample_frame(37, 0));
    writer.finish();
  }
  const TrajectoryReader reader(path);
  expect_error<ConfigError>([&] { reader.header(1); }, {path, "has no trajectory 1 (allowed: 0 to 0)"});
  expect_error<ConfigError>([&] { reader.frames(0, 0, 1000, {}); }, {path, "has no 1000 frames from 0 on"});
  expect_error<ConfigError>([&] { reader.frames(0, -1, 1, {}); }, {path, "has no 1 frames from -1 on"});
}

TEST(TrajectoryFile, RefusesWhatDoesNotFit) {
  TemporaryFolder folder;
  const std::vector<float> x(24, 1.0f);
  const std::vector<int32_t> types(4, 5);
  using hdf5::Element;
  const auto fails = [&](const std::string& path, const std::string& part) {
    expect_error<InputError>([&] { TrajectoryReader(path).read(0); }, {path, part});
  };
  fails(file_with(folder, "rank.h5",
                  [&](hid_t g) {
                    plain(g, "position", {2, 12}, Element::float32, x.data());
                  }),
        "'position' does not have 3 dimensions");
  fails(file_with(folder, "kind.h5",
                  [&](hid_t g) {
                    plain(g, "position", {1, 1, 3}, Element::int32, types.data());
                  }),
        "'position' does not hold real numbers");
  fails(file_with(folder, "four.h5",
                  [&](hid_t g) {
                    plain(g, "position", {1, 6, 4}, Element::float32, x.data());
                  }),
        "not 2- or 3-dimensional");
  fails(file_with(folder, "types.h5",
                  [&](hid_t g) {
                    plain(g, "position", {2, 4, 3}, Element::float32, x.data());
                  }),
        "lacks 'particle_type'");
  fails(file_with(folder, "count.h5",
                  [&](hid_t g) {
                    plain(g, "position", {4, 2, 3}, Element::float32, x.data());
                    plain(g, "particle_type", {4}, Element::int32, types.data());
                  }),
        "different numbers of particles");
  fails(file_with(folder, "velocity.h5",
                  [&](hid_t g) {
                    plain(g, "position", {2, 4, 3}, Element::float32, x.data());
                    plain(g, "velocity", {1, 4, 3}, Element::float32, x.data());
                  }),
        "'velocity' and 'position' have different sizes");
  fails(file_with(folder, "huge.h5",
                  [&](hid_t g) {
                    hdf5::create_dataset(g, "position", {.size = {1000000, 100000, 3}, .chunk = {1, 1000, 3}});
                  }),
        "claims more values than the file can hold");
  // Chunks that nobody wrote would be read as zeros.
  fails(
      file_with(folder, "gap.h5",
                [&](hid_t g) {
                  const hdf5::Handle gap = hdf5::create_dataset(g, "position", {.size = {0, 4, 3}, .chunk = {1, 4, 3}});
                  const hsize_t larger[] = {2, 4, 3};
                  H5Dset_extent(gap, larger);
                  plain(g, "particle_type", {4}, Element::int32, types.data());
                }),
      "2 chunks of 'position' are missing");
}

TEST(TrajectoryFile, RefusesValuesThatLieElsewhere) {
  TemporaryFolder folder;
  write(folder.file("target.h5"), 4, 2);
  const auto fails = [&](const std::string& path, const std::string& part) {
    expect_error<InputError>([&] { TrajectoryReader(path).read(0); }, {path, part});
  };
  fails(file_with(folder, "link.h5",
                  [&](hid_t g) {
                    H5Lcreate_external("target.h5", "/00000/position", g, "position", H5P_DEFAULT, H5P_DEFAULT);
                  }),
        "link that leads elsewhere");
  {
    const hdf5::Handle file = hdf5::create_file(folder.file("root.h5"));
    H5Lcreate_external("target.h5", "/00000", file, "00000", H5P_DEFAULT, H5P_DEFAULT);
  }
  fails(folder.file("root.h5"), "lead elsewhere");
  const hsize_t size[] = {1, 2, 3};
  fails(file_with(folder, "external.h5",
                  [&](hid_t g) {
                    const hid_t space = H5Screate_simple(3, size, nullptr);
                    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
                    H5Pset_external(creation, "/etc/hostname", 0, 24);
                    H5Dclose(H5Dcreate2(g, "position", H5T_IEEE_F32LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
                    H5Pclose(creation);
                    H5Sclose(space);
                  }),
        "keeps its values in another file");
  fails(file_with(folder, "virtual.h5",
                  [&](hid_t g) {
                    const hid_t space = H5Screate_simple(3, size, nullptr);
                    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
                    H5Pset_virtual(creation, space, "target.h5", "/00000/position", space);
                    H5Dclose(H5Dcreate2(g, "position", H5T_IEEE_F32LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
                    H5Pclose(creation);
                    H5Sclose(space);
                  }),
        "is a view of other datasets");
  fails(file_with(folder, "filter.h5",
                  [&](hid_t g) {
                    const hid_t space = H5Screate_simple(3, size, nullptr);
                    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
                    H5Pset_chunk(creation, 3, size);
                    H5Pset_scaleoffset(creation, H5Z_SO_FLOAT_DSCALE, 2);
                    H5Dclose(H5Dcreate2(g, "position", H5T_IEEE_F32LE, space, H5P_DEFAULT, creation, H5P_DEFAULT));
                    H5Pclose(creation);
                    H5Sclose(space);
                  }),
        "uses HDF5 filter 6, which is not read");
}

TEST(TrajectoryFile, ReadsFilesOfOtherPrograms) {
  TemporaryFolder folder;
  std::vector<float> x(2 * 3 * 2);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<float>(i);
  const std::vector<int32_t> types = {0, 1, 2};
  const std::string path = file_with(folder, "train.h5", [&](hid_t g) {
    plain(g, "position", {2, 3, 2}, hdf5::Element::float32, x.data());
    plain(g, "particle_type", {3}, hdf5::Element::int32, types.data());
  });
  folder.write("metadata.json", "{\"dt\": 0.0025, \"write_every\": 4, \"bounds\": [[0, 1], [0, 1]]}");
  const TrajectoryReader reader(path);
  EXPECT_TRUE(reader.complete());
  const Trajectory read = reader.read(0);
  EXPECT_DOUBLE_EQ(read.frame_time, 0.01);
  EXPECT_DOUBLE_EQ(read.frames[1].time, 0.01);
  EXPECT_EQ(read.particle_type, types);
  EXPECT_EQ(read.frames[1].position[2], (Vec3f{10, 11, 0}));  // two dimensions: z = 0
  EXPECT_TRUE(read.frames[1].velocity.empty());
  EXPECT_TRUE(reader.initial_velocity(0).empty());
  folder.write("metadata.json", "{\"dt\": ");
  expect_error<InputError>([&] { TrajectoryReader broken(path); }, {"metadata.json:1:"});
}

TEST(TrajectoryFile, FoldersThatCannotBeWrittenAreIoErrors) {
  TemporaryFolder folder;
  folder.write("file", "x");
  expect_error<IoError>([&] { TrajectoryWriter(folder.file("file/a.h5"), sample_header(2)); },
                        {"a.h5.part", "Not a directory", "Choose a folder"});
  expect_error<IoError>([&] { TrajectoryWriter(folder.file("none/a.h5"), sample_header(2)); },
                        {"a.h5.part", "No such file or directory"});
  expect_error<ConfigError>([&] { TrajectoryWriter(folder.file("a.h5"), Trajectory{}); }, {"needs particles"});
  expect_error<ConfigError>([&] { TrajectoryWriter(folder.file("a.h5"), sample_header(2), {.deflate = 10}); },
                            {"compression level 10", "0 to 9"});
}

TEST(TrajectoryFile, FullDiskIsAnIoErrorAndLeavesNoFinishedFile) {
  TemporaryFolder folder;
  const std::string disk = folder.file("disk");
  std::filesystem::create_directory(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "cannot mount a small disk here";
  const std::string path = disk + "/a.h5";
  expect_error<IoError>([&] { write(path, 4000, 100); },
                        {path + ".part", "disk full", "bytes needed", "Free space", "can be recovered"});
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_GE(recover_part_file(path, false), 0);
  umount2(disk.c_str(), MNT_DETACH);
}

TEST(TrajectoryFile, ThreeLinesOfPythonReadIt) {
  if (!output_of("/usr/bin/python3 -c 'import h5py'").second) GTEST_SKIP() << "h5py is not installed";
  TemporaryFolder folder;
  write(folder.file("a.h5"), 7, 5);
  const std::string script = folder.write("read.py",
                                          "import h5py, sys\n"
                                          "g = h5py.File(sys.argv[1])['00000']\n"
                                          "print(g['position'].shape, g['position'].dtype, g['particle_type'][:4], "
                                          "g['velocity'][4, 6], round(g['time'][4], 9), g.attrs['made_by'], "
                                          "g['position'].attrs['units'], g.attrs['seed'], g.file.attrs['complete'])\n");
  const auto [text, good] = output_of("/usr/bin/python3 " + script + " " + folder.file("a.h5"));
  EXPECT_TRUE(good);
  EXPECT_EQ(text, "(5, 7, 3) float32 [5 6 8 4] [ 8. -8.  1.] 0.5 mpm m 18364758544493064720 1\n");
}

TEST(TrajectoryFile, DataOfGnsAreToBeConvertedFirst) {
  const TemporaryFolder folder;
  folder.write("train.npz", "");
  expect_error<InputError>([&] { TrajectoryReader(folder.file("train.h5")); },
                           {"train.npz' is of", "graupel convert "});
}

}  // namespace
}  // namespace graupel::io
