// Loads and gravity paths of scenes through the verbs: data sets, training, reduced models, graph networks.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

/// A soft standing post in a grip, which is pushed near its top.
const std::string post = R"({
  "name": "post",
  "domain": { "size": [0.88, 0.88, 0.88], "dx": 0.04 },
  "gravity": [0, 0, 0],
  "materials": { "solid": { "preset": "crom_solid" } },
  "sources": [ { "shape": "box", "size": [0.12, 0.24, 0.12], "position": [0.44, 0.4, 0.44], "material": "solid",
                 "sampling": "jittered_lattice", "particles_per_cell": 4 } ],
  "kinematic_regions": [ { "shape": "box", "size": [0.4, 0.08, 0.4], "position": [0.44, 0.28, 0.44], "motion": {} } ],
  "obstacles": [
    { "shape": "box", "size": [0.4, 0.08, 0.4], "position": [0.44, 0.28, 0.44], "contact": "stick" } ],
  "loads": [ { "start": 0.02, "duration": 0.05, "place": [0.44, 0.5, 0.44], "radius": 0.07, "force": [1, 0, 0] } ],
  "push_out": false,
  "transfer": { "scheme": "pic" },
  "time_step": { "policy": "fixed", "substeps_per_frame": 1 },
  "frames": 24, "frame_time": 0.006944444444444444, "seed": 1
})";

const std::string sweep = R"({
  "name": "pushes", "scene": "post.json",
  "parameters": [
    { "name": "push", "unit": "N", "key": "loads.0.force.0", "values": [1, 2.5, 4],
      "also": [ { "key": "loads.0.start", "values": [0.02, 0.025, 0.03] } ] } ],
  "test": [1], "fields": "deformation_gradient"
})";

class LoadsOfScenes : public ::testing::Test {
 protected:
  LoadsOfScenes() : scene_(folder_.write("post.json", post)), recipe_(folder_.write("sweep.json", sweep)) {}

  Trajectory simulated(const std::string& flags) const {
    const Outcome outcome = graupel("simulate " + scene_ + " --device cpu -o " + folder_.file("run.h5") + " --json " +
                                    folder_.file("run.json") + " " + flags);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    return io::TrajectoryReader(folder_.file("run.h5")).read(0);
  }
  static double furthest(const Trajectory& run) {
    double far = 0;
    for (const ParticleFrame& frame : run.frames)
      for (std::size_t p = 0; p < frame.position.size(); ++p)
        far = std::max(far, static_cast<double>(norm(frame.position[p] - run.frames[0].position[p])));
    return far;
  }

  Folder folder_;
  std::string scene_, recipe_;
};

TEST_F(LoadsOfScenes, ASimulationTellsTheMomentumThatTheyGave) {
  const Trajectory run = simulated("");
  EXPECT_GT(furthest(run), 1e-3);
  const auto summary = nlohmann::json::parse(read_file(folder_.file("run.json")));
  EXPECT_NEAR(summary["load_momentum"][0].get<double>(), 0.05, 1e-6);
  EXPECT_EQ(summary["loads_without_carriers"], 0);
  const Outcome missed =
      graupel("simulate " + scene_ + " --set loads.0.place=[0.2,0.7,0.2] -o " + folder_.file("missed.h5"));
  EXPECT_EQ(missed.exit_code, 0) << missed.output;
  EXPECT_TRUE(missed.says("1 of 1 loads began where there was no matter")) << missed.output;
  const Outcome refused =
      graupel("simulate " + scene_ + " --set loads.0.place=[0.2,0.7,0.2] --set loads.0.start=0 -o " + scene_ + ".h5");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(refused.says("load 0 (/loads/0)")) << refused.output;
}

TEST_F(LoadsOfScenes, AStoppedRunGoesOn) {
  const std::string whole = folder_.file("whole.h5"), part = folder_.file("part.h5"), state = folder_.file("state");
  ASSERT_EQ(graupel("simulate " + scene_ + " --device cpu -o " + whole).exit_code, 0);
  ASSERT_EQ(graupel("simulate " + scene_ + " --device cpu --frames 6 -o " + part + " --save-state " + state).exit_code,
            0);
  const Outcome resumed = graupel("simulate --resume " + state + " --frames 24 -o " + part);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.output;
  const Trajectory a = io::TrajectoryReader(whole).read(0), b = io::TrajectoryReader(part).read(0);
  EXPECT_TRUE(a.frames.back().position == b.frames.back().position) << "the load acts over the stop";
}

/// From a sweep over a load to a reduced model that is closer to an unseen one than the body at rest.
TEST_F(LoadsOfScenes, ASweepOverAForceTrainsAReducedModel) {
  const std::string data = folder_.file("data"), out = folder_.file("crom");
  const Outcome generated = graupel("generate " + recipe_ + " --device cpu -o " + data);
  ASSERT_EQ(generated.exit_code, 0) << generated.output;
  const io::TrajectoryReader test(data + "/test.h5"), train(data + "/train.h5");
  ASSERT_EQ(train.count(), 2);
  const Trajectory alone = simulated("--set loads.0.force.0=2.5 --set loads.0.start=0.025");
  EXPECT_TRUE(test.read(0).frames.back().position == alone.frames.back().position);
  EXPECT_EQ(test.parameters(0).front().keys.front(), "loads.0.force.0");
  const Outcome missed = graupel("generate " + recipe_ + " --device cpu --set scene.loads.0.place=[0.2,0.7,0.2] -o " +
                                 folder_.file("none"));
  EXPECT_EQ(missed.exit_code, 0) << missed.output;
  EXPECT_TRUE(missed.says("began where there was no matter")) << missed.output;
  if (!training_is_built()) GTEST_SKIP() << "graupel-train is not built (needs libtorch)";
  const Outcome trained = graupel("train crom --data " + data + " --out " + out +
                                  " --set map=modes --set latents=6 --set samples=60 --set gradient=integrated");
  ASSERT_EQ(trained.exit_code, 0) << trained.output;
  const Outcome compared = graupel("compare " + data + " --split test --no-floors --models " + out +
                                   "/weights.safetensors --json " + folder_.file("compare.json"));
  ASSERT_EQ(compared.exit_code, 0) << compared.output;
  EXPECT_FALSE(compared.says("loads differ")) << compared.output;
  const std::string rolled = folder_.file("rolled.h5");
  const auto error = [&](const std::string& flags) {
    const Outcome outcome =
        graupel("rollout " + out + "/weights.safetensors " + data + "/test.h5 -o " + rolled + " " + flags);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    const Trajectory run = io::TrajectoryReader(rolled).read(0);
    double sum = 0, moved = 0;
    for (std::size_t f = 0; f < run.frames.size(); ++f)
      for (std::size_t p = 0; p < run.particle_count(); ++p) {
        sum += norm2(run.frames[f].position[p] - alone.frames[f].position[p]);
        moved += norm2(alone.frames[0].position[p] - alone.frames[f].position[p]);
      }
    return std::sqrt(sum / moved);
  };
  EXPECT_LT(error(""), 0.1);
  EXPECT_GT(error("--set loads.0.force.0=1e-6"), 0.9) << "nothing moves without it";
  const Outcome without =
      graupel("rollout " + out + "/weights.safetensors " + data + "/test.h5 -o " + rolled + " --set loads=[]");
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_TRUE(without.says("no number at 'loads.0.force.0'")) << without.output;
  const Outcome other = graupel("rollout " + out + "/weights.safetensors " + data + "/test.h5 -o " + rolled +
                                " --set loads.0.place=[0.44,0.48,0.44]");
  EXPECT_EQ(other.exit_code, 0);
  EXPECT_TRUE(other.says("loads differ from those of the training")) << other.output;
}

TEST_F(LoadsOfScenes, GraphNetworksSayThatTheyDoNotSeeThem) {
  const std::string scene = folder_.write(
      "small.json",
      small_scene(R"("loads": [ { "duration": 1, "place": [0.5, 0.5, 0.5], "radius": 0.2, "force": [20, 0, 0] } ],
                     "gravity_keyframes": [ { "time": 0.1, "gravity": [0, 0, 0] } ])"));
  const Outcome outcome =
      graupel("rollout models/hgn.safetensors " + scene + " --frames 2 --device cpu -o " + folder_.file("out.h5"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("no input for loads")) << outcome.output;
  EXPECT_TRUE(outcome.says("no input for gravity that changes")) << outcome.output;
}

}  // namespace
}  // namespace graupel::test
