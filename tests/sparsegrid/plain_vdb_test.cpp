// Which .vdb files are passed without OpenVDB: those that its library comes through.
#include "sparsegrid/vdb/plain_vdb.h"

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include "sparsegrid/vdb/vdb_grids.h"

namespace graupel::sparsegrid {
namespace {

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

openvdb::FloatGrid::Ptr ball(float radius = 1.5f) {
  const auto grid = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(radius, openvdb::Vec3f(0.4f), 0.1f, 3.0f);
  grid->setName("ball");
  return grid;
}

/// A few values in three blocks, and a tile.
template <typename GridType>
typename GridType::Ptr spread(const std::string& name, const typename GridType::ValueType& value) {
  const auto grid = GridType::create();
  for (int i = 0; i < 40; ++i) {
    grid->tree().setValue(openvdb::Coord(131 * i - 900, 7 * i, -i), value);
    grid->tree().setValueOff(openvdb::Coord(131 * i - 900, 7 * i, 1 - i), value * 2);
  }
  grid->tree().root().addTile(openvdb::Coord(8192, 0, 0), value, /*state=*/true);
  grid->setName(name);
  return grid;
}

class PlainVdb : public testing::Test {
 protected:
  PlainVdb() { initialize_openvdb(); }
  ~PlainVdb() override { std::remove(path_.c_str()); }

  std::string written(const openvdb::GridCPtrVec& grids, uint32_t compression = openvdb::io::COMPRESS_ACTIVE_MASK) {
    openvdb::io::File file(path_);
    file.setCompression(compression);
    openvdb::MetaMap metadata;
    metadata.insertMeta("made_by", openvdb::StringMetadata("a test"));
    file.write(grids, metadata);
    file.close();
    return bytes_of(path_);
  }

  /// As the program reads them. Returns the bytes in memory.
  uint64_t read_by_the_library(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary) << bytes;
    uint64_t memory = 0;
    try {
      openvdb::io::File file(path_);
      file.open(/*delayLoad=*/false);
      for (auto name = file.beginName(); name != file.endName(); ++name) memory += file.readGrid(*name)->memUsage();
    } catch (const std::exception&) {
    }
    return memory;
  }

  const std::string path_ = testing::TempDir() + "graupel_" + std::to_string(::getpid()) + "_plain.vdb";
};

TEST_F(PlainVdb, GridsOfNumbersAreInEveryCompression) {
  for (const uint32_t compression : {0, 1, 2, 3, 4, 6})
    for (const bool half : {false, true}) {
      const auto floats = ball();
      const auto doubles = spread<openvdb::DoubleGrid>("doubles", 0.5);
      const auto vectors = spread<openvdb::Vec3SGrid>("vectors", openvdb::Vec3s(1, 2, 3));
      doubles->setTransform(openvdb::math::Transform::createLinearTransform(
          openvdb::Mat4d(1, 2, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 4, 5, 6, 1)));
      vectors->transform().postTranslate(openvdb::Vec3d(1, 2, 3));
      for (const openvdb::GridBase::Ptr& grid : std::vector<openvdb::GridBase::Ptr>{floats, doubles, vectors})
        grid->setSaveFloatAsHalf(half);
      const openvdb::GridCPtrVec grids = {floats,
                                          doubles,
                                          vectors,
                                          spread<openvdb::Vec3DGrid>("3 doubles", openvdb::Vec3d(1, 2, 3)),
                                          spread<openvdb::Int32Grid>("numbers", 7),
                                          spread<openvdb::Int64Grid>("long numbers", -7),
                                          spread<openvdb::Vec3IGrid>("3 numbers", openvdb::Vec3i(1, 2, 3)),
                                          openvdb::FloatGrid::create()};
      EXPECT_TRUE(is_plain_vdb(written(grids, compression))) << compression << half;
    }
}

TEST_F(PlainVdb, OtherKindsOfFilesAreNot) {
  EXPECT_FALSE(is_plain_vdb(""));
  EXPECT_FALSE(is_plain_vdb("no file of OpenVDB at all, but of some length"));
  EXPECT_FALSE(is_plain_vdb(written({openvdb::BoolGrid::create()})));
  const auto grid = ball();
  EXPECT_FALSE(is_plain_vdb(written({grid, grid->copyGrid()}))) << "an instance";
  const auto bent = ball();
  bent->setTransform(openvdb::math::Transform::createFrustumTransform(
      openvdb::BBoxd(openvdb::Vec3d(0), openvdb::Vec3d(10)), 0.5, 10, 0.1));
  EXPECT_FALSE(is_plain_vdb(written({bent})));
  std::ostringstream stream;
  openvdb::io::Stream(stream).write(openvdb::GridCPtrVec{grid});
  EXPECT_FALSE(is_plain_vdb(stream.str())) << "without places";
}

TEST_F(PlainVdb, NoShorterOrLongerFileIs) {
  const std::string good = written({ball(), spread<openvdb::Int32Grid>("numbers", 7)}, /*compression=*/6);
  ASSERT_TRUE(is_plain_vdb(good));
  for (std::size_t size = 0; size < good.size(); size += size < 3000 ? 1 : 53)
    ASSERT_FALSE(is_plain_vdb(good.substr(0, size))) << size;
  EXPECT_FALSE(is_plain_vdb(good + '\0'));
}

TEST_F(PlainVdb, GridsElsewhereAreNot) {
  const std::string good = written({ball(), ball()});
  const std::string type = "Tree_float_5_4_3";
  const std::size_t places = good.find(type) + type.size() + 4;  // of the grid's begin, values and end
  for (const std::size_t place : {places, places + 8, places + 16})
    for (const int64_t step : {-8, -1, 1, 8}) {
      std::string moved = good;
      int64_t value = 0;
      std::memcpy(&value, good.data() + place, sizeof value);
      value += step;
      std::memcpy(moved.data() + place, &value, sizeof value);
      EXPECT_FALSE(is_plain_vdb(moved)) << place - places << " " << step;
    }
}

TEST_F(PlainVdb, TheLibraryComesThroughDamagedFilesThatAre) {
  std::mt19937_64 random(5);
  int plain = 0, tried = 0;
  for (const uint32_t compression : {0, 1, 2, 6}) {
    const std::string good = written({ball(0.6f), spread<openvdb::DoubleGrid>("doubles", 0.5)}, compression);
    for (int k = 0; k < 150; ++k, ++tried) {
      std::string damaged = good;
      const std::size_t at = random() % (k % 2 == 0 ? 3000 : good.size() - 8);
      const std::size_t width = std::size_t(1) << random() % 4;
      const uint64_t value = random() % 3 == 0 ? random() : (uint64_t(1) << random() % 64) - random() % 2;
      std::memcpy(damaged.data() + at, &value, width);
      if (!is_plain_vdb(damaged)) continue;
      ++plain;
      ASSERT_LT(read_by_the_library(damaged), 48 * good.size() + (uint64_t(128) << 20)) << at;
    }
  }
  EXPECT_GT(plain, tried / 20);
  EXPECT_LT(plain, tried * 9 / 10);
}

}  // namespace
}  // namespace graupel::sparsegrid
