// simulate --forces: what the matter does to obstacles and walls, in the file, after a restart, as CSV and in the
// report.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/system/atomic_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

/// Jelly falls on a plate; its weight is 1000 * 0.1^3 * 9.8 N.
const char* const falling_block = R"({ "name": "fall",
  "domain": { "dx": 0.03125 }, "materials": { "jelly": { "preset": "jelly" } },
  "sources": [ { "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.281, 0.5], "material": "jelly" } ],
  "obstacles": [ { "shape": "box", "size": [0.3, 0.06, 0.3], "position": [0.5, 0.2, 0.5], "contact": "stick" } ],
  "frames": 12
})";

std::vector<std::vector<ContactForce>> forces_of(const std::string& file) {
  return io::TrajectoryReader(file).contact_forces(0);
}

TEST(SimulateForces, AreInTheFileAsCsvAndInTheReport) {
  const Folder folder;
  const std::string scene = folder.write("fall.json", falling_block), run = folder.file("run.h5");
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu --forces -o " + run).exit_code, 0);
  const auto forces = forces_of(run);
  ASSERT_EQ(forces.size(), 13u);
  EXPECT_EQ(io::TrajectoryReader(run).contact_names(0).size(), 7u);
  EXPECT_TRUE(forces[0][0].impulse == Vec3d::zero());
  Vec3d impulse = Vec3d::zero();
  for (const auto& frame : forces) impulse += frame[0].impulse;
  EXPECT_LT(impulse[1], -0.3 * 9.8 * 12 / 60);
  EXPECT_NEAR(60 * forces[9][0].impulse[1], forces[9][0].force[1], 1e-9 * std::abs(forces[9][0].force[1]));
  const std::string csv = folder.file("forces.csv");
  EXPECT_EQ(graupel("export " + run + " -f csv -o " + csv).exit_code, 0);
  const std::string text = read_file(csv, 1 << 20);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1 + 13 * 7);
  EXPECT_NE(text.find("\n9,0.15,obstacle_0,"), std::string::npos) << text.substr(0, 2000);
  ASSERT_EQ(graupel("export " + run + " -f csv --frames 3:9:6 -o " + csv).exit_code, 0);
  const std::string some = read_file(csv);
  EXPECT_EQ(std::count(some.begin(), some.end(), '\n'), 1 + 2 * 7);
  EXPECT_NE(some.find(text.substr(text.find("\n9,"), text.find("\n10,") - text.find("\n9,"))), std::string::npos);
  EXPECT_EQ(graupel("export " + run + " -f csv --frames garbage -o " + csv).exit_code, 2);
  const std::string report = folder.file("report.html");
  ASSERT_EQ(graupel("compare --scenes " + run + " --models mpm --no-floors --device cpu --report " + report).exit_code,
            0);
  const std::string page = read_file(report, 32 << 20);
  EXPECT_NE(page.find("Force on obstacles and walls (truth)"), std::string::npos);
  EXPECT_NE(page.find(">obstacle_0<"), std::string::npos);
}

TEST(SimulateForces, OfAResumedRunAreThoseOfTheUninterruptedOne) {
  const Folder folder;
  const std::string scene = folder.write("fall.json", falling_block), state = folder.file("s.state");
  const std::string simulate = "simulate " + scene + " --device cpu --forces";
  ASSERT_EQ(graupel(simulate + " -o " + folder.file("whole.h5")).exit_code, 0);
  ASSERT_EQ(graupel(simulate + " --frames 7 -o " + folder.file("run.h5") + " --save-state " + state).exit_code, 0);
  ASSERT_EQ(graupel("simulate --resume " + state + " --frames 12").exit_code, 0);
  EXPECT_TRUE(forces_of(folder.file("run.h5")) == forces_of(folder.file("whole.h5")));
}

TEST(SimulateForces, WithoutThemNothingCanBeExportedOrResumedWithThem) {
  const Folder folder;
  const std::string scene = folder.write("fall.json", falling_block), state = folder.file("s.state"),
                    run = folder.file("run.h5");
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu --frames 1 -o " + run + " --save-state " + state).exit_code,
            0);
  const Outcome exported = graupel("export " + run + " -f csv -o " + folder.file("f.csv"));
  EXPECT_EQ(exported.exit_code, 3) << exported.output;
  EXPECT_TRUE(exported.says("--forces")) << exported.output;
  const Outcome resumed = graupel("simulate --resume " + state + " --frames 3 --forces");
  EXPECT_EQ(resumed.exit_code, 3) << resumed.output;
  EXPECT_TRUE(resumed.says("keeps no forces")) << resumed.output;
}

}  // namespace
}  // namespace graupel::test
