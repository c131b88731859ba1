// graupel convert: a data set made by generate goes to other programs' formats and back; errors, full disks.
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <memory>

#include "core/system/atomic_file.h"
#include "io/trajectory/trajectory_file.h"
#include "nn/weights.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

class ConvertVerb : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<Folder>();
    const Outcome made = graupel(
        "generate scenes/recipes/hgn.json --set frames=4 --set counts.train=2 --set counts.valid=1 --set counts.test=1 "
        "--device cpu --seed 5 -o " +
        made_->file("own"));
    ASSERT_EQ(made.exit_code, 0) << made.output;
  }
  static void TearDownTestSuite() { made_.reset(); }

  static inline std::unique_ptr<Folder> made_;
  Folder folder_;
  std::string set_ = made_->file("own");
};

TEST_F(ConvertVerb, GoesToBothFormatsAndBack) {
  for (const std::string format : {"gns", "lagrangebench"}) {
    const std::string there = folder_.file(format), back = folder_.file(format + "-back");
    const Outcome to = graupel("convert " + set_ + " " + there + " --format " + format + " --json -");
    ASSERT_EQ(to.exit_code, 0) << to.output;
    EXPECT_TRUE(to.says("2 train, 1 valid, 1 test trajectories, graupel to " + format)) << to.output;
    EXPECT_TRUE(to.says("obstacles of 4 trajectories are left out")) << to.output;
    EXPECT_TRUE(to.says("\"most_frames\": 5")) << to.output;
    const Outcome from = graupel("convert " + there + " " + back + " --set domain.walls=stick");
    ASSERT_EQ(from.exit_code, 0) << from.output;
    for (const char* split : {"/train.h5", "/valid.h5", "/test.h5"}) {
      const io::TrajectoryReader was(set_ + split), is(back + split);
      ASSERT_EQ(was.count(), is.count());
      for (int i = 0; i < was.count(); ++i) {
        EXPECT_TRUE(was.positions(i, 0, 5) == is.positions(i, 0, 5)) << split << i;
        EXPECT_EQ(was.header(i).particle_type, is.header(i).particle_type);
      }
    }
    EXPECT_EQ(graupel("inspect " + back + "/test.h5").exit_code, 0);
  }
}

const std::string tiny_training =
    " --device cpu --threads 1 --steps 3 --set hgn.latent=16 --set hgn.levels=2 --set hgn.message_passing=1 "
    "--set batch_scenes=1 --set validation_samples=2 --set rollout_scenes=1 --set rollout_frames=2";

TEST_F(ConvertVerb, NetworksTrainOnWhatCameBack) {
  if (!training_is_built())
    GTEST_SKIP() << "graupel-train is not built (needs libtorch): no training on converted data";
  for (const std::string format : {"gns", "lagrangebench"}) {
    const std::string there = folder_.file(format), back = folder_.file(format + "-back"), run = folder_.file("run");
    ASSERT_EQ(graupel("convert " + set_ + " " + there + " --format " + format).exit_code, 0);
    ASSERT_EQ(graupel("convert " + there + " " + back).exit_code, 0);
    const Outcome trained = graupel("train hgn --data " + back + " --out " + run + tiny_training);
    ASSERT_EQ(trained.exit_code, 0) << trained.output;
    EXPECT_TRUE(trained.says("finished at step 3")) << trained.output;
    const Outcome rolled =
        graupel("rollout " + run + "/weights.safetensors " + back + "/test.h5 --frames 2 -o " + folder_.file("r.h5"));
    EXPECT_EQ(rolled.exit_code, 0) << rolled.output;
    EXPECT_EQ(io::TrajectoryReader(folder_.file("r.h5")).header(0).frame_count(), 3u);
    remove_path(run);
  }
}

/// A plane run of water and sand as a data set of another program that calls the sand kinematic: both networks train on
/// it, and their rollouts start from its frames, follow its sand, stay in the plane and are compared with the rest.
void expect_plane_data_to_train(const Folder& folder, const std::string& format, const std::string& types) {
  const std::string data = folder.file(format), back = folder.file(format + "-back");
  const std::string scene = folder.write("plane.json", R"({
    "domain": { "dimensions": 2, "dx": 0.03125 }, "frames": 12,
    "materials": { "water": { "preset": "water" }, "sand": { "preset": "sand" } },
    "sources": [
      { "shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.4, 0.6, 0.5], "material": "water" },
      { "shape": "box", "size": [0.2, 0.1, 0.2], "position": [0.4, 0.3, 0.5], "material": "sand", "velocity": [1, 0, 0] } ]
  })");
  make_folder(data + "-own");
  ASSERT_EQ(graupel("simulate " + scene + " --device cpu -o " + data + "-own/train.h5").exit_code, 0);
  ASSERT_EQ(
      graupel("convert " + data + "-own " + data + " --format " + format + " --connectivity-radius 0.07").exit_code, 0);
  const Outcome converted = graupel("convert " + data + " " + back + " --types " + types + " --set gravity=[0,-9.8,0]");
  ASSERT_EQ(converted.exit_code, 0) << converted.output;
  EXPECT_TRUE(converted.says("--set gns.radius=0.07 --set gns.wall_clamp=0.56 --set gns.dimensions=2"))
      << converted.output;
  const Outcome in_space = graupel("train hgn --data " + back + " --out " + data + "-run" + tiny_training);
  EXPECT_EQ(in_space.exit_code, 2) << in_space.output;
  EXPECT_TRUE(in_space.says("Set hgn.dimensions to that of the data")) << in_space.output;
  for (const std::string network : {"hgn", "gns"}) {
    const std::string run = data + "-" + network, rolled = run + ".h5";
    const std::string settings = " --device cpu --threads 1 --steps 3 --set batch_scenes=1 --set " + network +
                                 ".latent=16 --set " + network + ".message_passing=1 --set " + network +
                                 ".dimensions=2 --set " + network + ".dx=0.03125";
    const Outcome trained = graupel("train " + network + " --data " + back + " --out " + run + settings);
    ASSERT_EQ(trained.exit_code, 0) << trained.output;
    const Outcome rollout =
        graupel("rollout " + run + "/weights.safetensors " + back + "/train.h5 --start truth:6 --json - -o " + rolled);
    ASSERT_EQ(rollout.exit_code, 0) << rollout.output;
    EXPECT_TRUE(rollout.says("position_mse_all")) << rollout.output;
    EXPECT_TRUE(rollout.says("\"compared_frames\": 7")) << rollout.output;
    const io::TrajectoryReader is(rolled), was(back + "/train.h5");
    const auto predicted = is.frames(0, 0, 8), truth = was.frames(0, 5, 8);
    const auto type = was.header(0).particle_type;
    for (std::size_t f = 0; f < 8; ++f)
      for (std::size_t p = 0; p < type.size(); ++p) {
        EXPECT_EQ(predicted[f].position[p][2], 0.5f);
        if (type[p] != 5) {
          EXPECT_EQ(predicted[f].position[p], truth[f].position[p]);
        }
      }
  }
  const Outcome compared =
      graupel("compare --scenes " + back + "/train.h5 --models " + data + "-hgn/weights.safetensors");
  EXPECT_EQ(compared.exit_code, 3);
  EXPECT_TRUE(compared.says("graupel rollout WEIGHTS DATA.h5 --start truth:N")) << compared.output;
}

TEST_F(ConvertVerb, PlaneDataWithObstacleParticlesTrainAndRollOut) {
  if (!training_is_built()) GTEST_SKIP() << "graupel-train is not built (needs libtorch): no training on plane data";
  expect_plane_data_to_train(folder_, "gns", "6=obstacle");
}

TEST_F(ConvertVerb, PlaneDataWithStationaryParticlesTrainAndRollOut) {
  if (!training_is_built()) GTEST_SKIP() << "graupel-train is not built (needs libtorch): no training on plane data";
  expect_plane_data_to_train(folder_, "lagrangebench", "6=stationary");
}

TEST_F(ConvertVerb, SaysWhatIsWrong) {
  const auto refused = [&](const std::string& arguments, int code, const std::string& words) {
    const Outcome outcome = graupel("convert " + arguments);
    EXPECT_EQ(outcome.exit_code, code) << outcome.output;
    EXPECT_TRUE(outcome.says(words)) << outcome.output;
  };
  const std::string out = folder_.file("out");
  refused(set_ + " " + out, 2, "format graupel already");
  refused(set_ + " " + out + " --format npz", 2, "--format");
  refused(set_ + " " + out + " --format gns --types 5=sandd", 2, "Did you mean 'sand'?");
  refused(set_ + " " + out + " --format gns --split all", 2, "--split");
  refused(folder_.file("nowhere") + " " + out, 3, "is no folder");
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(ConvertVerb, ShortensWeights) {
  const std::string whole = folder_.file("whole.safetensors"), half = folder_.file("half.safetensors");
  nn::Weights weights;
  weights.metadata["architecture"] = "some";
  weights.tensors["matrix"] = nn::Tensor::from_float({1.0f, -0.333333f, 1e-3f, 7.25f}, {2, 2});
  nn::write_safetensors(whole, weights);
  ASSERT_EQ(graupel("convert " + whole + " " + half + " --numbers f16").exit_code, 0);
  const nn::Weights is = nn::read_safetensors(half);
  EXPECT_EQ(is.metadata, weights.metadata);
  EXPECT_EQ(is.tensors.at("matrix").dtype, nn::DType::f16);
  const std::vector<float> values = is.get("matrix", {2, 2});
  EXPECT_EQ(values[0], 1.0f);
  EXPECT_EQ(values[3], 7.25f);
  EXPECT_NEAR(values[1], -0.333333f, 0.333333f / 2048);
  EXPECT_NEAR(values[2], 1e-3f, 1e-3f / 2048);

  weights.tensors["matrix"] = nn::Tensor::from_float({70000.0f, 0, 0, 0}, {2, 2});
  nn::write_safetensors(whole, weights);
  const Outcome large = graupel("convert " + whole + " " + folder_.file("large.safetensors") + " --numbers f16");
  EXPECT_EQ(large.exit_code, 2);
  EXPECT_TRUE(large.says("'matrix'")) << large.output;
  EXPECT_TRUE(large.says("--numbers bf16")) << large.output;
  EXPECT_EQ(graupel("convert " + whole + " " + folder_.file("large.safetensors") + " --numbers bf16").exit_code, 0);
  EXPECT_TRUE(graupel("convert " + whole + " " + folder_.file("other.safetensors")).says("need --numbers"));
  EXPECT_TRUE(graupel("convert " + set_ + " " + folder_.file("other") + " --numbers f16").says("is for weights"));
}

TEST_F(ConvertVerb, AFullDiskLeavesNothing) {
  const std::string disk = folder_.file("disk");
  std::filesystem::create_directory(disk);
  for (const std::string format : {"gns", "lagrangebench"}) {
    if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=64k") != 0)
      GTEST_SKIP() << "no tmpfs can be mounted here (needs root): disk-full is not tested";
    const Outcome outcome = graupel("convert " + set_ + " " + disk + "/out --format " + format);
    const auto left = names_in(disk);
    ::umount(disk.c_str());
    EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
    EXPECT_TRUE(outcome.says("Free space on that disk")) << outcome.output;
    EXPECT_TRUE(left.empty()) << left.front();
  }
  ASSERT_EQ(graupel("convert " + set_ + " " + folder_.file("gns") + " --format gns").exit_code, 0);
  ASSERT_EQ(::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=64k"), 0);
  const Outcome outcome = graupel("convert " + folder_.file("gns") + " " + disk + "/out");
  const auto left = names_in(disk);
  ::umount(disk.c_str());
  EXPECT_EQ(outcome.exit_code, 5) << outcome.output;
  EXPECT_TRUE(left.empty()) << left.front();
}

}  // namespace
}  // namespace graupel::test
