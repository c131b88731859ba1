// Fields of particles in trajectory files: stored, read back, recovered, read by other programs, refused when foreign.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstring>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/trajectory/field_datasets.h"
#include "io/trajectory/trajectory_file.h"
#include "sample_trajectory.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

const FieldSet every_field = {ParticleField::stress, ParticleField::affine, ParticleField::deformation_gradient,
                              ParticleField::plastic};

/// Field f, component k of particle p in a frame is f + k / 10 + p / 1000 + 100 frame.
ParticleFrame frame_with(std::size_t particles, int frame, FieldSet fields) {
  ParticleFrame out = sample_frame(particles, frame);
  for (const ParticleField field : all_particle_fields) {
    if (!fields.contains(field)) continue;
    const int components = info_of(field).components;
    for (std::size_t p = 0; p < particles; ++p)
      for (int k = 0; k < components; ++k)
        out.fields[field].push_back(static_cast<float>(field) + 0.1f * static_cast<float>(k) +
                                    0.001f * static_cast<float>(p) + 100.0f * static_cast<float>(frame));
  }
  return out;
}

std::string write(const TemporaryFolder& folder, const std::string& name, std::size_t particles, int frames,
                  FieldSet fields) {
  TrajectoryWriter writer(folder.file(name), sample_header(particles), {.fields = fields});
  for (int f = 0; f < frames; ++f) writer.append(frame_with(particles, f, fields));
  writer.finish();
  return folder.file(name);
}

TEST(TrajectoryFields, RoundTrip) {
  const TemporaryFolder folder;
  const TrajectoryReader reader(write(folder, "a.h5", 37, 21, every_field));
  EXPECT_EQ(reader.fields(0), every_field);
  const auto frames = reader.frames(0, 0, 21, every_field);
  for (int f = 0; f < 21; ++f)
    EXPECT_EQ(frames[static_cast<std::size_t>(f)].fields, frame_with(37, f, every_field).fields) << f;
  EXPECT_EQ(reader.read(0).frames[3].fields, ParticleFields{});  // read only where wanted
  const FieldSet plastic = {ParticleField::plastic};
  EXPECT_EQ(reader.read(0, plastic).frames[20].fields, frame_with(37, 20, plastic).fields);
}

TEST(TrajectoryFields, OneQuantityAloneIsThatOfTheFrames) {
  const TemporaryFolder folder;
  // 300,000 particles: more than a chunk, one frame each; 37: several frames a chunk.
  for (const auto& [particles, count] : {std::pair<std::size_t, int>{37, 21}, {300000, 3}}) {
    const FieldSet stored = {ParticleField::affine};
    const TrajectoryReader reader(write(folder, "a.h5", particles, count, stored));
    for (const auto& [first, some] : {std::pair{0, count}, {1, 2}, {count - 1, 1}, {count, 0}}) {
      const auto frames = reader.frames(0, first, some, stored);
      const std::vector<float> position = reader.positions(0, first, some),
                               velocity = reader.velocities(0, first, some),
                               affine = reader.values(0, ParticleField::affine, first, some);
      ASSERT_EQ(position.size(), 3 * particles * static_cast<std::size_t>(some));
      ASSERT_EQ(affine.size(), 9 * particles * static_cast<std::size_t>(some));
      for (std::size_t f = 0; f < frames.size(); ++f) {
        const std::size_t bytes = 3 * particles * sizeof(float);
        EXPECT_EQ(std::memcmp(position.data() + 3 * particles * f, frames[f].position.data(), bytes), 0);
        EXPECT_EQ(std::memcmp(velocity.data() + 3 * particles * f, frames[f].velocity.data(), bytes), 0);
        EXPECT_EQ(
            std::memcmp(affine.data() + 9 * particles * f, frames[f].fields[ParticleField::affine].data(), 3 * bytes),
            0);
      }
    }
    expect_error<InputError>([&] { reader.values(0, ParticleField::stress, 0, 1); }, {"lacks the field 'stress'"});
  }
}

TEST(TrajectoryFields, OnlyThoseAskedForAreStored) {
  const TemporaryFolder folder;
  const FieldSet stress = {ParticleField::stress};
  const TrajectoryReader reader(write(folder, "a.h5", 5, 3, stress));
  EXPECT_EQ(reader.fields(0), stress);
  EXPECT_EQ(reader.frames(0, 0, 1, every_field)[0].fields, frame_with(5, 0, stress).fields);
  EXPECT_TRUE(TrajectoryReader(write(folder, "b.h5", 5, 3, {})).fields(0).empty());
}

TEST(TrajectoryFields, CountInTheSizeOfAFrame) {
  EXPECT_EQ(particle_frame_bytes({.velocity = false}), 12);
  EXPECT_EQ(particle_frame_bytes({.active = true}), 25);
  EXPECT_EQ(particle_frame_bytes({.fields = every_field}), 24 + 4 * (6 + 9 + 9 + 1));
}

TEST(TrajectoryFields, AreChunkedAndCompressedLikePositions) {
  const TemporaryFolder folder;
  const std::size_t particles = 100000;  // 3.6 MB a frame of deformation gradients
  const std::string path = write(folder, "a.h5", particles, 3, every_field);
  const hdf5::Handle file = hdf5::open_file(path);
  const hdf5::Handle group(H5Gopen2(file, "00000", H5P_DEFAULT), H5Gclose, "group");
  for (const auto& [field, dataset] : open_field_datasets(group, particles, std::filesystem::file_size(path))) {
    ASSERT_FALSE(dataset.chunk.empty());
    hsize_t bytes = sizeof(float);
    for (const hsize_t extent : dataset.chunk) bytes *= extent;
    EXPECT_LE(bytes, hsize_t(4) << 20) << info_of(field).name;
    const hdf5::Handle creation(H5Dget_create_plist(dataset.id), H5Pclose, "properties");
    EXPECT_EQ(H5Pget_nfilters(creation), 3) << info_of(field).name;  // shuffle, deflate, fletcher32
    EXPECT_EQ(hdf5::string_attribute(dataset.id, "units"), info_of(field).units);
  }
  EXPECT_EQ(TrajectoryReader(path).frames(0, 2, 1, every_field)[0].fields,
            frame_with(particles, 2, every_field).fields);
}

TEST(TrajectoryFields, AreRecovered) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.h5");
  {
    TrajectoryWriter writer(path, sample_header(50), {.velocity = false, .fields = every_field, .flush_every = 4});
    for (int f = 0; f < 10; ++f) writer.append(frame_with(50, f, every_field));
  }
  EXPECT_EQ(recover_part_file(path, true), 8);
  const TrajectoryReader reader(path);
  EXPECT_EQ(reader.fields(0), every_field);
  EXPECT_EQ(reader.read(0, every_field).frames[7].fields, frame_with(50, 7, every_field).fields);
  EXPECT_EQ(reader.initial_velocity(0), sample_frame(50, 0).velocity);
}

TEST(TrajectoryFields, OfAnotherShapeAreRefused) {
  const TemporaryFolder folder;
  const std::vector<float> x(54, 1.0f);
  const auto file_with = [&](const char* name, const std::vector<hsize_t>& size) {
    const std::string path = folder.file(std::string(name) + std::to_string(size.back()) + ".h5");
    const hdf5::Handle file = hdf5::create_file(path), group = hdf5::create_group(file, "00000");
    const std::vector<std::pair<std::string, std::vector<hsize_t>>> datasets = {{"position", {2, 3, 3}}, {name, size}};
    for (const auto& [dataset_name, extent] : datasets)
      hdf5::write_all(hdf5::create_dataset(group, dataset_name, {.size = extent}), hdf5::Element::float32, x.data());
    return path;
  };
  const auto fails = [&](const std::string& path, const std::string& part) {
    expect_error<InputError>([&] { TrajectoryReader(path).fields(0); }, {path, part});
  };
  fails(file_with("stress", {2, 3, 9}), "'stress' and 'position' have different sizes");
  fails(file_with("affine", {1, 3, 9}), "'affine' and 'position' have different sizes");
  fails(file_with("plastic", {2, 3, 1}), "'plastic' does not have 2 dimensions");
}

TEST(TrajectoryFields, ThreeLinesOfPythonReadThem) {
  if (std::system("/usr/bin/python3 -c 'import h5py' 2>/dev/null") != 0)
    GTEST_SKIP() << "python3-h5py is not installed";
  const TemporaryFolder folder;
  const std::string path = write(folder, "a.h5", 4, 2, every_field);
  const std::string command = "/usr/bin/python3 -c \"import h5py; t = h5py.File('" + path +
                              "')['00000']; print(t['stress'].shape, t['affine'].shape, "
                              "t['deformation_gradient'].shape, t['plastic'].shape, t['stress'].attrs['units'], "
                              "'%.3f' % t['affine'][1, 3, 8])\"";
  std::string text;
  std::array<char, 256> buffer;
  FILE* pipe = popen(command.c_str(), "r");
  while (fgets(buffer.data(), buffer.size(), pipe)) text += buffer.data();
  EXPECT_EQ(pclose(pipe), 0);
  EXPECT_EQ(text, "(2, 4, 6) (2, 4, 9) (2, 4, 9) (2, 4) Pa 101.803\n");
}

}  // namespace
}  // namespace graupel::io
