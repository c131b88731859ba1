// graupel export: frames, surfaces and films of a small run; what it refuses.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <memory>

#include "core/system/atomic_file.h"
#include "io/mesh/mesh_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

class ExportVerb : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<Folder>();
    const std::string scene = made_->write("small.json", small_scene());
    const Outcome made =
        graupel("simulate " + scene + " -o " + made_->file("run.h5") + " --device cpu --fields plastic --frames 6");
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }
  static void TearDownTestSuite() { made_.reset(); }

  /// The names of what an export makes in a folder of its own.
  std::vector<std::string> files_of(const std::string& arguments) {
    const Outcome outcome = exported(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    return names_in(folder_.file("out"));
  }
  Outcome exported(const std::string& arguments, const std::string& environment = "") {
    return run_program("/usr/bin/env", environment + " '" GRAUPEL_BINARY_DIR "/graupel' export " + run_ + " -o " +
                                           folder_.file("out") + " " + arguments);
  }
  static bool has_ffmpeg() { return std::system("command -v ffmpeg > /dev/null") == 0; }

  static inline std::unique_ptr<Folder> made_;
  Folder folder_;
  std::string run_ = made_->file("run.h5");
};

using Names = std::vector<std::string>;

TEST_F(ExportVerb, RangesOfFrames) {
  EXPECT_EQ(files_of("--format ply --frames 1:5:2"), (Names{"run_0001.ply", "run_0003.ply", "run_0005.ply"}));
  std::filesystem::remove_all(folder_.file("out"));
  EXPECT_EQ(files_of("--format bgeo --frames 5:"), (Names{"run_0005.bgeo", "run_0006.bgeo"}));
  std::filesystem::remove_all(folder_.file("out"));
  EXPECT_EQ(files_of("--format ply --frames :1 --name other"), (Names{"other_0000.ply", "other_0001.ply"}));
  std::filesystem::remove_all(folder_.file("out"));
  EXPECT_EQ(files_of("--frames 4"), (Names{"run.pvd", "run_0004.vtp"}));
  for (const auto& [range, says] :
       std::vector<std::pair<std::string, std::string>>{{"7", "FIRST is '7' (allowed: whole numbers from 0 to 6)"},
                                                        {"5:2", "LAST is '2' (allowed: whole numbers from 5 to 6)"},
                                                        {"0:6:0", "STRIDE is '0' (allowed: whole numbers from 1 to 7)"},
                                                        {"a:b", "FIRST is 'a'"},
                                                        {"1:2:3:4", "4 parts (allowed: 1 to 3)"}}) {
    const Outcome outcome = exported("--frames " + range);
    EXPECT_EQ(outcome.exit_code, 2) << range;
    EXPECT_TRUE(outcome.says(says)) << outcome.output;
    EXPECT_TRUE(outcome.says("has frames 0 to 6")) << outcome.output;
  }
}

TEST_F(ExportVerb, FramesHoldWhatTheTrajectoryHolds) {
  files_of("--format bgeo --frames 3");
  const ParticleFrame frame = io::TrajectoryReader(run_).frames(0, 3, 1, {ParticleField::plastic}).front();
  const std::string bytes = read_file(folder_.file("out/run_0003.bgeo"));
  const auto number = [&](std::size_t at) {
    const char raw[4] = {bytes[at + 3], bytes[at + 2], bytes[at + 1], bytes[at]};
    float value;
    std::memcpy(&value, raw, sizeof value);
    return value;
  };
  const std::size_t row = 4 * 11, last = bytes.size() - 2 - row;  // x y z w, v, id, type, pscale, J
  const std::size_t particle = frame.position.size() - 1;
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(number(last + 4 * static_cast<std::size_t>(axis)), frame.position[particle][axis]);
    EXPECT_EQ(number(last + 16 + 4 * static_cast<std::size_t>(axis)), frame.velocity[particle][axis]);
  }
  EXPECT_FLOAT_EQ(number(last + 36), 0.5f * 0.03125f / 2);
  EXPECT_EQ(number(last + 40), frame.fields[ParticleField::plastic][particle]);
}

TEST_F(ExportVerb, SurfacesTakeTheirSizesFromTheScene) {
  EXPECT_EQ(files_of("--surface --format obj --frames 0:1"),
            (Names{"run_surface_water_0000.obj", "run_surface_water_0001.obj"}));
  const auto size = std::filesystem::file_size(folder_.file("out/run_surface_water_0000.obj"));
  files_of("--surface --format obj --frames 0:0 --voxel 0.015625");
  EXPECT_LT(std::filesystem::file_size(folder_.file("out/run_surface_water_0000.obj")), size / 3);
  const Outcome outcome = exported("--surface --format obj --voxel 1e-5");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("--voxel 1e-05 is out of range (allowed: 0.00146484375 to 0.015625")) << outcome.output;
}

/// Two bodies of one size, one of many small particles: each surface keeps its body's volume.
TEST_F(ExportVerb, EveryMaterialHasTheSizeOfItsOwnParticles) {
  const std::string scene = folder_.write("two.json", R"({ "domain": { "dx": 0.03125 },
    "materials": { "fine": { "preset": "jelly" }, "coarse": { "preset": "taichi_water" } },
    "sources": [ { "shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.3, 0.5, 0.5], "material": "fine",
                   "particles_per_cell": 64 },
                 { "shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.7, 0.5, 0.5], "material": "coarse",
                   "particles_per_cell": 4 } ], "frames": 0 })");
  const std::string run = folder_.file("two.h5");
  ASSERT_EQ(graupel("simulate " + scene + " -o " + run).exit_code, 0);
  ASSERT_EQ(graupel("export " + run + " --surface -f obj -o " + folder_.file("two")).exit_code, 0);
  for (const std::string body : {"jelly", "water"}) {
    const TriangleMesh mesh = io::read_mesh(folder_.file("two/two_surface_" + body + "_0000.obj"));
    double volume = 0;
    for (const auto& [a, b, c] : mesh.triangles) {
      const auto corner = [&](int32_t i) { return mesh.vertices[static_cast<std::size_t>(i)]; };
      volume += dot(corner(a), cross(corner(b), corner(c))) / 6;
    }
    EXPECT_NEAR(volume / 0.008, 1, 0.06) << body;
  }
}

TEST_F(ExportVerb, FilesWithoutParticlesAreRead) {
  const std::string scene = folder_.write("late.json", R"({ "domain": { "dx": 0.03125 },
    "materials": { "water": { "preset": "taichi_water" } }, "sources": [],
    "emitters": [ { "shape": "box", "size": [0.1, 0.04, 0.1], "position": [0.5, 0.5, 0.5], "velocity": [0, -1, 0],
                    "start_time": 0.01, "end_time": 0.02, "material": "water" } ], "frames": 1 })");
  const std::string run = folder_.file("late.h5");
  ASSERT_EQ(graupel("simulate " + scene + " -o " + run).exit_code, 0);
  for (const std::string words : {"-f vdb", "--surface -f vdb"})
    ASSERT_EQ(graupel("export " + run + " " + words + " -o " + folder_.file("late")).exit_code, 0);
  const Names made = names_in(folder_.file("late"));
  EXPECT_EQ(made,
            (Names{"late_0000.vdb", "late_0001.vdb", "late_surface_water_0000.vdb", "late_surface_water_0001.vdb"}));
  for (const std::string& name : made)
    EXPECT_EQ(graupel("validate " + folder_.file("late/" + name)).exit_code, 0) << name;
}

TEST_F(ExportVerb, FormatsThatDoNotFitAreRefused) {
  Outcome outcome = exported("--surface --format bgeo");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("allowed with --surface: obj, ply, vtp, vdb, usda")) << outcome.output;
  outcome = exported("--format obj");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("add --surface")) << outcome.output;
  outcome = exported("--format ply --radius 0.1");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("--radius is for surfaces")) << outcome.output;
}

TEST_F(ExportVerb, FlagsWithoutEffectAreRefused) {
  for (const auto& [words, says] : std::vector<std::pair<std::string, std::string>>{
           {"-f ply --width 400",
            "--width is for pictures, and particles are written. Choose --format png, gif or mp4"},
           {"-f obj --surface --height 400", "--height is for pictures, and surfaces are written"},
           {"--rate 30",
            "--rate is for films, and particles are written. Choose --format gif or mp4, or leave --rate "},
           {"-f png --rate 30", "--rate is for films, and pictures are written"},
           {"-f csv --name x", "--name is for frames, and forces are written. Name the file by --output"},
           {"-f mp4 --voxel 0.1", "--voxel is for surfaces, and films are written"}}) {
    const Outcome outcome = exported(words);
    EXPECT_EQ(outcome.exit_code, 2) << words;
    EXPECT_TRUE(outcome.says(says)) << outcome.output;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.file("out")));
}

TEST_F(ExportVerb, TheSummaryDoesNotReplaceAFrame) {
  std::filesystem::create_directory(folder_.file("out"));
  const std::string link = folder_.file("link.json");
  std::filesystem::create_symlink(folder_.file("out/run_0001.ply"), link);
  for (const auto& [words, file] : std::vector<std::pair<std::string, std::string>>{
           {"-f ply", folder_.file("out/run_0000.ply")},
           {"-f ply", folder_.file("out/../out/run_0003.ply")},
           {"-f ply", link},
           {"-f vtp", folder_.file("out/run.pvd")},
           {"-f usda", folder_.file("out/run.usda")},
           {"-f obj --surface", folder_.file("out/run_surface_water_0002.obj")}}) {
    const Outcome outcome = exported(words + " --json " + file);
    EXPECT_EQ(outcome.exit_code, 2) << file << ": " << outcome.output;
    EXPECT_TRUE(outcome.says("would overwrite the file of --json '")) << outcome.output;
  }
  EXPECT_TRUE(names_in(folder_.file("out")).empty());
  EXPECT_EQ(exported("-f ply --json " + folder_.file("out.json")).exit_code, 0);
}

TEST_F(ExportVerb, NamesOfFiles) {
  const std::string odd = folder_.file("my stéps.h5");
  std::filesystem::copy(run_, odd);
  const Outcome made = graupel("export '" + odd + "' -f ply --frames 1 -o " + folder_.file("odd"));
  EXPECT_EQ(made.exit_code, 0) << made.output;
  EXPECT_EQ(names_in(folder_.file("odd")), (Names{"my_stéps_0001.ply"}));
  for (const char* name : {"..", ".hidden", "'a b'", "\"$(printf 'a\\tb')\"", "\"$(printf 'a\\377')\""}) {
    const Outcome outcome = exported(std::string("-f ply --name ") + name);
    EXPECT_EQ(outcome.exit_code, 2) << name;
    EXPECT_TRUE(outcome.says("--name '")) << outcome.output;
  }
}

/// Runs of one folder do not replace each other, and readers take the files.
TEST_F(ExportVerb, NamesBeyondAscii) {
  for (const std::string name : {"水", "雪"}) {
    std::filesystem::copy(run_, folder_.file(name + ".h5"));
    for (const std::string words : {"-f vtp", "-f vdb", "-f usda"}) {
      const Outcome made =
          graupel("export " + folder_.file(name + ".h5") + " --frames 1 -o " + folder_.file("out") + " " + words);
      EXPECT_EQ(made.exit_code, 0) << made.output;
    }
  }
  EXPECT_EQ(names_in(folder_.file("out")), (Names{"水.pvd", "水.usda", "水_0001.vdb", "水_0001.vtp", "雪.pvd",
                                                  "雪.usda", "雪_0001.vdb", "雪_0001.vtp"}));
  EXPECT_NE(read_file(folder_.file("out/水.pvd")).find("file=\"水_0001.vtp\""), std::string::npos);
  EXPECT_NE(read_file(folder_.file("out/水.usda")).find("defaultPrim = \"___\""), std::string::npos);
  EXPECT_EQ(graupel("validate " + folder_.file("out/水_0001.vdb")).exit_code, 0);
}

TEST_F(ExportVerb, FramesOfAnotherExportAreTold) {
  for (const std::string words : {"-f vtp", "-f ply --surface --name run"}) {
    EXPECT_FALSE(exported(words).says("another export")) << words;
    EXPECT_FALSE(exported(words).says("another export")) << words;
    const Outcome outcome = exported(words + " --frames 0:4");
    EXPECT_EQ(outcome.exit_code, 0);
    const std::string first = words == "-f vtp" ? "'run_0005.vtp' to 'run_0006.vtp'" : "'run_water_0005.ply' to";
    EXPECT_TRUE(
        outcome.says("'" + folder_.file("out") + "' also has frames of another export by these names (" + first))
        << outcome.output;
    EXPECT_TRUE(outcome.says("2 files")) << outcome.output;
  }
  EXPECT_FALSE(exported("-f ply --frames 0:4").says("another export"));  // other names
  EXPECT_FALSE(exported("-f usda --frames 0:4").says("another export"));
  EXPECT_TRUE(exported("-f vtp --frames 0:5").says("('run_0006.vtp')"));
}

TEST_F(ExportVerb, PicturesAreDrawn) {
  EXPECT_EQ(files_of("--format png --frames 2:3 --width 96 --height 64"), (Names{"run_0002.png", "run_0003.png"}));
  const std::string png = read_file(folder_.file("out/run_0002.png"));
  EXPECT_EQ(png.substr(1, 3), "PNG");
  EXPECT_EQ(png.substr(16, 8), std::string("\0\0\0\x60\0\0\0\x40", 8));
}

TEST_F(ExportVerb, FilmsAreMadeByFfmpeg) {
  if (!has_ffmpeg()) GTEST_SKIP() << "ffmpeg is not installed";
  EXPECT_EQ(files_of("--format mp4 --width 96 --height 64"), (Names{"run.mp4"}));
  EXPECT_EQ(read_file(folder_.file("out/run.mp4")).substr(4, 4), "ftyp");
  EXPECT_EQ(files_of("--format gif --width 96 --height 64 --rate 10 --frames 0:3"), (Names{"run.gif", "run.mp4"}));
  EXPECT_EQ(read_file(folder_.file("out/run.gif")).substr(0, 6), "GIF89a");
}

TEST_F(ExportVerb, WithoutFfmpegAFilmSaysWhatToInstall) {
  const Outcome outcome = exported("--format mp4", "PATH=" + folder_.file("nothing"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("ffmpeg, which is not in PATH. Install it (Debian: apt-get install ffmpeg)"))
      << outcome.output;
  EXPECT_TRUE(outcome.says("--format png")) << outcome.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("out")));
}

TEST_F(ExportVerb, AnFfmpegThatFailsIsAnErrorAndLeavesNothing) {
  const std::string program = folder_.write("ffmpeg", "#!/bin/sh\necho 'Unknown encoder' >&2\nexit 1\n");
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  const Outcome outcome = exported("--format gif --width 96 --height 64",
                                   "PATH=" + std::filesystem::path(program).parent_path().string() + ":/usr/bin:/bin");
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(outcome.says("Unknown encoder")) << outcome.output;
  EXPECT_TRUE(names_in(folder_.file("out")).empty());
}

}  // namespace
}  // namespace graupel::test
