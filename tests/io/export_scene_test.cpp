// Formats of scene programs: .bgeo as Partio reads it, .usda with its time samples.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/system/error.h"
#include "expect_error.h"
#include "io/export/export.h"
#include "io/export/usda_layer.h"
#include "temporary_folder.h"

namespace graupel::io {
namespace {

/// Big-endian numbers one after the other.
class BigEndian {
 public:
  explicit BigEndian(std::string bytes) : bytes_(std::move(bytes)) {}

  std::string text(std::size_t size) {
    if (at_ + size > bytes_.size()) throw std::out_of_range("the file ends early");
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  template <typename T>
  T number() {
    std::string raw = text(sizeof(T));
    std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof value);
    return value;
  }
  bool at_end() const { return at_ == bytes_.size(); }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

PointFrame three_points() {
  return {.time = 0.5,
          .position = {{1, 2, 3}, {-0.1f, 0.2f, 1e-7f}, {4, 5, 6}},
          .velocity = {{1, 0, 0}, {0, -2.5f, 0}, {0, 0, 3}},
          .particle_type = {5, 6, 5},
          .id = {0, 7, 70000},
          .volume_ratio = {1, 0.5f, 2}};
}

TEST(ExportScene, BgeoIsWhatPartioReads) {
  const TemporaryFolder folder;
  const PointFrame points = three_points();
  const auto writer = make_point_writer("bgeo", {.folder = folder.path(), .name = "run", .point_size = 0.02});
  writer->write(12, points);
  BigEndian file(bytes_of(folder.file("run_0012.bgeo")));
  EXPECT_EQ(file.text(5), "BgeoV");
  EXPECT_EQ(file.number<int32_t>(), 5);
  const std::vector<int32_t> counts = {3, 0, 0, 0, 5, 0, 0, 0};  // points, attributes of points; of all else none
  for (const int32_t count : counts) EXPECT_EQ(file.number<int32_t>(), count);
  const struct {
    const char* name;
    int size, type;
  } attributes[] = {{"v", 3, 5}, {"id", 1, 1}, {"type", 1, 1}, {"pscale", 1, 0}, {"J", 1, 0}};
  for (const auto& attribute : attributes) {
    EXPECT_EQ(file.text(file.number<uint16_t>()), attribute.name);
    EXPECT_EQ(file.number<uint16_t>(), attribute.size);
    EXPECT_EQ(file.number<int32_t>(), attribute.type);
    for (int i = 0; i < attribute.size; ++i) EXPECT_EQ(file.number<int32_t>(), 0);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(file.number<float>(), points.position[i][axis]);
    EXPECT_EQ(file.number<float>(), 1);
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(file.number<float>(), points.velocity[i][axis]);
    EXPECT_EQ(file.number<int32_t>(), points.id[i]);
    EXPECT_EQ(file.number<int32_t>(), points.particle_type[i]);
    EXPECT_EQ(file.number<float>(), 0.01f);
    EXPECT_EQ(file.number<float>(), points.volume_ratio[i]);
  }
  EXPECT_EQ(file.text(2), std::string("\x00\xff", 2));
  EXPECT_TRUE(file.at_end());
}

TEST(ExportScene, ParticlesHaveTheirOwnSizes) {
  const TemporaryFolder folder;
  PointFrame points = three_points();
  points.id = {0, 2, 1};
  const ExportTarget target{.folder = folder.path(), .name = "run", .point_size = 0.04, .sizes = {0.01f, 0.02f, 0.04f}};
  make_point_writer("bgeo", target)->write(0, points);
  const std::string bytes = bytes_of(folder.file("run_0000.bgeo"));
  const std::size_t row = 4 * (3 + 1 + 3 + 1 + 1 + 1 + 1);  // place, 1, v, id, type, pscale, J
  const float sizes[] = {0.01f, 0.04f, 0.02f};
  for (std::size_t i = 0; i < 3; ++i) {
    BigEndian pscale(bytes.substr(bytes.size() - 2 - (3 - i) * row + 4 * 9, 4));
    EXPECT_EQ(pscale.number<float>(), 0.5f * sizes[i]);
  }
  const auto writer = make_point_writer("usda", target);
  writer->write(0, points);
  writer->finish();
  const std::string text = bytes_of(folder.file("run.usda"));
  const std::size_t widths = text.find("float[] widths");
  ASSERT_NE(widths, std::string::npos);
  EXPECT_EQ(text.find("float[] widths", widths + 1), text.find("float[] widths.timeSamples")) << text;
  EXPECT_NE(text.find("0: [0.01, 0.04, 0.02],", widths), std::string::npos);
  EXPECT_NE(text.find("interpolation = \"vertex\"", widths), std::string::npos);
}

TEST(ExportScene, UsdaHasASampleAFrame) {
  const TemporaryFolder folder;
  PointFrame points = three_points();
  const auto writer = make_point_writer(
      "usda", {.folder = folder.path(), .name = "2-run.a", .frame_time = 0.1, .point_size = 0.02, .up_axis = 'Z'});
  writer->write(2, points);
  EXPECT_FALSE(std::filesystem::exists(folder.file("2-run.a.usda")));
  points.position.pop_back();
  for (auto* field : {&points.particle_type, &points.id}) field->pop_back();
  points.velocity.pop_back();
  points.volume_ratio.pop_back();
  writer->write(4, points);
  writer->finish();
  const std::string text = bytes_of(folder.file("2-run.a.usda"));
  EXPECT_EQ(text.find("#usda 1.0\n"), 0u);
  for (const char* part :
       {"defaultPrim = \"_2_run_a\"", "startTimeCode = 2", "endTimeCode = 4", "timeCodesPerSecond = 10",
        "upAxis = \"Z\"", "metersPerUnit = 1", "def Points \"particles\"", "float[] widths = [0.02]",
        "point3f[] points.timeSamples = {\n            2: [(1, 2, 3), (-0.1, 0.2, 1e-07), (4, 5, 6)],\n            4: "
        "[(1, 2, 3), (-0.1, 0.2, 1e-07)],\n        }",
        "4: [(1, 0, 0), (0, -2.5, 0)],", "2: [0, 7, 70000],", "2: [(-0.11, 0.19, -0.0099999", "2: [1, 0.5, 2],"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  // The files that hold the attributes meanwhile are gone.
  const auto files = std::filesystem::directory_iterator(folder.path());
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

TEST(ExportScene, UsdaSurfacesOfMaterialsThatComeAndGoAreEmpty) {
  const TemporaryFolder folder;
  const SurfaceSettings settings = default_surface_settings(0.1);
  PointFrame water = three_points();
  water.particle_type = {5, 5, 5};
  PointFrame both = three_points();
  const auto writer = make_surface_writer("usda", {.folder = folder.path(), .name = "run"});
  writer->write(0, 0, surfaces_of(water, surface_bodies(water.particle_type, water.materials, settings), "frame 0"));
  writer->write(3, 0.5, surfaces_of(both, surface_bodies(both.particle_type, both.materials, settings), "frame 3"));
  writer->write(6, 1, surfaces_of(water, surface_bodies(water.particle_type, water.materials, settings), "frame 6"));
  writer->finish();
  const std::string text = bytes_of(folder.file("run.usda"));
  const std::string sand = text.substr(text.find("def Mesh \"sand\""));
  const std::string points = sand.substr(sand.find("point3f[] points.timeSamples"));
  EXPECT_NE(points.find("0: [],\n"), std::string::npos);
  EXPECT_NE(points.find("3: [("), std::string::npos);
  EXPECT_NE(points.find("6: [],\n"), std::string::npos);
  EXPECT_LT(text.find("def Mesh \"water\""), text.find("def Mesh \"sand\""));
}

TEST(ExportScene, AnUnfinishedUsdaLeavesNothing) {
  const TemporaryFolder folder;
  PointFrame points = three_points();
  points.velocity[1][0] = std::numeric_limits<float>::quiet_NaN();
  {
    const auto writer = make_point_writer("usda", {.folder = folder.file("out"), .name = "run"});
    writer->write(0, three_points());
    EXPECT_FALSE(std::filesystem::is_empty(folder.file("out")));
    expect_error<DivergedError>([&] { writer->write(1, points); }, {"particle 7", "frame 1", "velocity is not finite"});
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.file("out")));
}

}  // namespace
}  // namespace graupel::io
