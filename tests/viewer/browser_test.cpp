// The page in headless Chromium: its pictures hold the particles' colours on every side.
#include <gtest/gtest.h>
#include <png.h>

#include <cstdlib>
#include <memory>

#include "tests/viewer/client.h"

namespace graupel::test {
namespace {

struct Picture {
  int width = 0, height = 0;
  std::vector<unsigned char> rgb;

  /// Pixels of columns [from, to) (shares of the width) of a hue: how far blue, or red, is above the other.
  int count(double from, double to, int (*is_of)(int red, int green, int blue)) const {
    int found = 0;
    for (int y = 0; y < height; ++y)
      for (int x = static_cast<int>(from * width); x < static_cast<int>(to * width); ++x) {
        const unsigned char* p = rgb.data() + 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                                   static_cast<std::size_t>(x));
        found += is_of(p[0], p[1], p[2]);
      }
    return found;
  }
};

Picture read_picture(const std::string& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  Picture picture;
  if (png_image_begin_read_from_file(&image, path.c_str()) == 0) return picture;
  image.format = PNG_FORMAT_RGB;
  picture.rgb.resize(PNG_IMAGE_SIZE(image));
  png_image_finish_read(&image, nullptr, picture.rgb.data(), 0, nullptr);
  picture.width = static_cast<int>(image.width);
  picture.height = static_cast<int>(image.height);
  return picture;
}

int is_water(int red, int green, int blue) { return blue > 90 && blue > red + 60 && blue > green + 25; }
int is_wrong(int red, int green, int blue) { return red > 120 && red > green + 60 && red > blue + 40; }

class Browser : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v chromium > /dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
    folder_ = std::make_unique<Folder>();
    for (const std::string name : {"low", "high"}) {
      const std::string scene = folder_->write(
          name + ".json",
          small_scene("", "{ \"shape\": \"box\", \"size\": [0.4, 0.4, 0.4], \"position\": [0.5, " +
                              std::string(name == "low" ? "0.4" : "0.5") + ", 0.5], \"material\": \"water\" }"));
      const Outcome made = graupel("simulate " + scene + " -o " + file(name + ".h5") + " --device cpu --frames 3");
      ASSERT_EQ(made.exit_code, 0) << made.output;
    }
  }
  std::string file(const std::string& name) const { return folder_->file(name); }

  Outcome chromium(const std::string& words) const {
    return run_program("/usr/bin/timeout",
                       "100 chromium --headless=new --no-sandbox --hide-scrollbars "
                       "--user-data-dir='" +
                           file("profile") + "' --virtual-time-budget=8000 " + words);
  }
  Picture shot(const ViewProgram& program, const std::string& what, const std::string& size = "1280,800") const {
    const Outcome done =
        chromium("--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --window-size=" + size +
                 " --screenshot='" + file("shot.png") + "' '" + program.address() + "#" + what + "'");
    const Picture picture = read_picture(file("shot.png"));
    EXPECT_GT(picture.width, 0) << done.output;
    return picture;
  }

  std::unique_ptr<Folder> folder_;
};

TEST_F(Browser, TwoRunsSideBySide) {
  const ViewProgram program({file("low.h5"), file("high.h5")});
  const Picture material = shot(program, "frame=2");
  EXPECT_EQ(material.width, 1280);
  EXPECT_GT(material.count(0, 0.39, is_water), 3000);
  EXPECT_GT(material.count(0.4, 0.79, is_water), 3000);
  EXPECT_EQ(material.count(0.05, 0.79, is_wrong), 0);
  const Picture error = shot(program, "frame=2&color=error");
  EXPECT_GT(error.count(0, 0.39, is_wrong), 3000);
  EXPECT_GT(error.count(0.4, 0.79, is_wrong), 3000);
}

TEST_F(Browser, OnAPhoneOneAboveTheOther) {
  const ViewProgram program({file("low.h5"), file("high.h5")});
  const Picture picture = shot(program, "frame=1", "500,900");
  EXPECT_GT(picture.count(0, 1, is_water), 3000);
}

TEST_F(Browser, ASliceTakesTheNearHalfAway) {
  const ViewProgram program({file("low.h5")});
  const int whole = shot(program, "frame=1").count(0, 0.79, is_water);
  const int none = shot(program, "frame=1&slice=z:0.05").count(0.1, 0.79, is_water);
  EXPECT_GT(whole, 3000);
  EXPECT_LT(none, whole / 20);
}

TEST_F(Browser, ARunningScene) {
  const ViewProgram program({file("low.json"), "--device", "cpu"});
  EXPECT_GT(shot(program, "").count(0.05, 0.79, is_water), 3000);
}

TEST_F(Browser, WithoutWebGlThePageSaysSo) {
  const ViewProgram program({file("low.h5")});
  const Outcome page = chromium("--disable-gpu --disable-3d-apis --dump-dom '" + program.address() + "'");
  EXPECT_TRUE(page.says("This browser has no WebGL2")) << page.output;
}

}  // namespace
}  // namespace graupel::test
