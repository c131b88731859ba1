// Pictures: what covers which pixel, PNG round trip, labels, rows.
#include <gtest/gtest.h>

#include "compare/pictures/bitmap_font.h"
#include "compare/pictures/contact_sheet.h"
#include "compare/pictures/png.h"
#include "compare/pictures/raster.h"
#include "core/system/error.h"
#include "tests/compare/synthetic_run.h"

namespace graupel::compare {
namespace {

struct Fixture {
  Scene scene = unit_scene();
  sparsegrid::ObstacleSet obstacles;
  Backdrop backdrop = make_backdrop(scene, obstacles, 200, 150);
  Image empty = draw_particles(backdrop, {}, {}, 0.05);

  Camera::Pixel on_picture(const Vec3d& x) const {
    auto pixel = backdrop.camera.project(x);
    pixel.x /= supersampling;
    pixel.y /= supersampling;
    return pixel;
  }
};

bool is_blue(Color c) { return c[2] > c[0] + 40; }
bool is_ochre(Color c) { return c[0] > c[2] + 40; }

TEST(Raster, ASphereCoversItsDiscAndNothingElse) {
  const Fixture fixture;
  const Vec3f center = {0.5f, 0.6f, 0.5f};
  const double radius = 0.1;
  const Image picture = draw_particles(fixture.backdrop, {center}, {5}, radius);
  const auto middle = fixture.on_picture(center.cast<double>());
  const double reach = radius * fixture.backdrop.camera.focal / middle.depth / supersampling;
  ASSERT_GT(reach, 5);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double distance = std::hypot(x + 0.5 - middle.x, y + 0.5 - middle.y);
      if (std::abs(distance - reach) < 1.5) continue;  // partly covered
      EXPECT_EQ(is_blue(picture.at(x, y)), distance < reach) << x << " " << y;
    }
}

TEST(Raster, TheNearerSphereHidesTheFarther) {
  const Fixture fixture;
  const Vec3d middle = {0.5, 0.5, 0.5};
  const Vec3d away = normalized(middle - fixture.backdrop.camera.eye);
  const Vec3f near = (middle - away * 0.15).cast<float>(), far = (middle + away * 0.15).cast<float>();
  const auto pixel = fixture.on_picture(middle);
  const int x = static_cast<int>(pixel.x), y = static_cast<int>(pixel.y);
  EXPECT_TRUE(is_blue(draw_particles(fixture.backdrop, {near, far}, {5, 6}, 0.05).at(x, y)));
  EXPECT_TRUE(is_blue(draw_particles(fixture.backdrop, {far, near}, {6, 5}, 0.05).at(x, y)));
  EXPECT_TRUE(is_ochre(draw_particles(fixture.backdrop, {near, far}, {6, 5}, 0.05).at(x, y)));
}

TEST(Raster, SpheresAreShadedFromTheLight) {
  const Fixture fixture;
  const Vec3f center = {0.5f, 0.6f, 0.5f};
  const Image picture = draw_particles(fixture.backdrop, {center}, {8}, 0.1);
  const auto middle = fixture.on_picture(center.cast<double>());
  const int x = static_cast<int>(middle.x), y = static_cast<int>(middle.y);
  EXPECT_GT(picture.at(x, y - 8)[1], picture.at(x, y + 8)[1] + 20);  // lit from above
}

TEST(Raster, ParticlesCastShadowsOnTheFloor) {
  const Fixture fixture;
  const Vec3f center = {0.5f, 0.3f, 0.5f};
  const Image picture = draw_particles(fixture.backdrop, {center}, {5}, 0.06);
  // Follow the light from the sphere down to the floor.
  const Vec3d light = light_direction(fixture.backdrop.up);
  const Vec3d foot = center.cast<double>() - light * ((0.3 - fixture.backdrop.low[1]) / light[1]);
  const auto pixel = fixture.on_picture(foot);
  const int x = static_cast<int>(pixel.x), y = static_cast<int>(pixel.y);
  EXPECT_LT(picture.at(x, y)[0] + 15, fixture.empty.at(x, y)[0]);
}

TEST(Raster, ObstaclesHideAndAreHidden) {
  const Scene scene = scene_with_sphere();
  const sparsegrid::ObstacleSet obstacles(scene);
  const Backdrop backdrop = make_backdrop(scene, obstacles, 200, 150);
  const Vec3d middle = scene.obstacles[0].position;
  const Vec3d away = normalized(middle - backdrop.camera.eye);
  const auto pixel = backdrop.camera.project(middle);
  const int x = static_cast<int>(pixel.x / supersampling), y = static_cast<int>(pixel.y / supersampling);
  const Vec3f behind = (middle + away * 0.25).cast<float>(), before = (middle - away * 0.25).cast<float>();
  EXPECT_FALSE(is_blue(draw_particles(backdrop, {behind}, {5}, 0.05).at(x, y)));
  EXPECT_TRUE(is_blue(draw_particles(backdrop, {before}, {5}, 0.05).at(x, y)));
  // The surface that was traced is the sphere's.
  const std::size_t i = static_cast<std::size_t>(pixel.y) * backdrop.camera.width + static_cast<std::size_t>(pixel.x);
  EXPECT_NEAR(backdrop.depth[i], pixel.depth - 0.15, 0.01);
}

TEST(Raster, MaterialsHaveColoursOfTheirOwn) {
  EXPECT_TRUE(is_blue(color_of_type(5)));
  EXPECT_TRUE(is_ochre(color_of_type(6)));
  EXPECT_GT(color_of_type(8)[0], 220);
  EXPECT_GT(color_of_type(4)[1], color_of_type(4)[0] + 40);
}

TEST(Png, RoundTripAndDamage) {
  Image image(7, 5);
  for (int y = 0; y < 5; ++y)
    for (int x = 0; x < 7; ++x) image.set(x, y, {static_cast<uint8_t>(30 * x), static_cast<uint8_t>(50 * y), 9});
  const std::string bytes = encode_png(image);
  const Image back = decode_png(bytes);
  EXPECT_EQ(back.width, 7);
  EXPECT_EQ(back.height, 5);
  EXPECT_EQ(back.rgb, image.rgb);
  EXPECT_THROW(decode_png("not a picture"), InputError);
  EXPECT_THROW(decode_png(bytes.substr(0, bytes.size() / 2)), InputError);
}

TEST(BitmapFont, DrawsInsideItsBox) {
  Image image(60, 20);
  draw_text(image, 3, 4, "Ag1", {255, 255, 255}, 2);
  EXPECT_EQ(text_width("Ag1", 2), 34);
  int lit = 0;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 60; ++x) {
      if (image.at(x, y)[0] == 0) continue;
      ++lit;
      EXPECT_TRUE(x >= 3 && x < 3 + 34 && y >= 4 && y < 4 + 2 * 8);
    }
  EXPECT_GT(lit, 100);
  draw_text(image, 55, 15, "beyond the edge", {255, 255, 255});  // parts outside are dropped
}

TEST(ContactSheet, FramesAndLayout) {
  EXPECT_EQ(picture_frames(300), (std::vector<std::size_t>{10, 60, 150, 300}));
  EXPECT_EQ(picture_frames(500), (std::vector<std::size_t>{10, 60, 150, 300}));
  EXPECT_EQ(picture_frames(60), (std::vector<std::size_t>{15, 30, 45, 60}));
  EXPECT_EQ(picture_frames(70), (std::vector<std::size_t>{18, 35, 53, 70}));
  EXPECT_EQ(picture_frames(3), (std::vector<std::size_t>{1, 2, 3}));
  const Fixture fixture;
  const auto run = make_run({{0.5f, 0.5f, 0.5f}}, {5}, 12, stay);
  const Image row = picture_row(fixture.backdrop, run, {10, 12}, "truth");
  EXPECT_EQ(row.width, 2 * 200 + 4);
  EXPECT_EQ(row.height, 150);
  const Image sheet = stack_rows({row, row});
  EXPECT_EQ(sheet.height, 304);
  EXPECT_EQ(sheet.at(100, 75), sheet.at(100, 75 + 154));
}

}  // namespace
}  // namespace graupel::compare
