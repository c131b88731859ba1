// The README's example, letter by letter: it compiles, and what falls is lower afterwards.
#include <gtest/gtest.h>

#include <string>

// [README]
#include <graupel/io.h>
#include <graupel/mpm.h>

double height_after(const std::string& scene_file, int frames) {
  graupel::Simulation run(graupel::io::read_scene(scene_file));
  while (frames-- > 0) run.advance_frame();
  return run.position()[0][1];  // of the first particle [m]
}
// [README]

#include <fstream>
#include <sstream>

namespace graupel {
namespace {

std::string read_file(const std::string& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(Readme, ExampleIsThisCodeAndRuns) {
  const std::string here = read_file(GRAUPEL_SOURCE_DIR "/tests/library/readme_example_test.cpp"),
                    readme = read_file(GRAUPEL_SOURCE_DIR "/README.md");
  const std::string mark = "// [README]\n";
  const auto begin = here.find("\n" + mark) + 1 + mark.size(), end = here.find("\n" + mark, begin) + 1;
  EXPECT_NE(readme.find("```cpp\n" + here.substr(begin, end - begin) + "```"), std::string::npos);
  const std::string scene = GRAUPEL_SOURCE_DIR "/scenes/shared/water_steps.json";
  // Free fall for 5 frames of 1/60 s.
  EXPECT_NEAR(height_after(scene, 0) - height_after(scene, 5), 0.5 * 9.8 * 25 / 3600, 2e-3);
}

}  // namespace
}  // namespace graupel
