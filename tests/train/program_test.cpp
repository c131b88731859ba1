// The program graupel-train: exit codes, signals, kills.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <thread>

#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "graph/config/hgn_config.h"
#include "nn/offline_cost.h"
#include "nn/weights.h"
#include "tests/train/reduced/affine_sweep.h"
#include "tests/train/reduced/tiny_sweep.h"
#include "tests/train/started_program.h"
#include "tests/train/tiny_data.h"
#include "train/loop/run_folder.h"

namespace graupel::train {
namespace {

namespace fs = std::filesystem;

class Program : public testing::Test {
 protected:
  Program() : folder_(test_folder("program")) {
    write_file_atomically(folder_ + "/config.json", train_config_text(tiny_config()));
  }
  ~Program() override { remove_path(folder_); }
  std::vector<std::string> training(const std::string& run) const {
    return {"hgn",       "--data", tiny_data_set(), "--out", folder_ + "/" + run, "--config", folder_ + "/config.json",
            "--threads", "1",      "--device",      "cpu"};
  }
  int run(const std::vector<std::string>& words) { return finish(start(words, folder_ + "/log")); }
  std::string log() const { return read_file(folder_ + "/log"); }
  /// Starts an endless training, waits for a checkpoint, sends the signal.
  int interrupt(const std::string& run_name, int signal) {
    auto words = training(run_name);
    words.insert(words.end(), {"--steps", "1000000", "--set", "validation_interval=1000000"});
    const pid_t child = start(words, folder_ + "/log");
    for (int i = 0; i < 600 && !has_checkpoint(folder_ + "/" + run_name); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ::kill(child, signal);
    return finish(child);
  }
  /// Only the newest checkpoints are kept, so any of many steps will do.
  static bool has_checkpoint(const std::string& run_folder) {
    char name[32];
    for (int step = 10; step <= 20000; step += 10) {
      std::snprintf(name, sizeof(name), "/step-%08d", step);
      if (fs::exists(checkpoint_folder(run_folder) + name)) return true;
    }
    return false;
  }
  std::string folder_;
};

TEST_F(Program, HelpDefaultsAndUsageErrors) {
  EXPECT_EQ(run({"hgn", "--help"}), 0);
  EXPECT_EQ(run({"hgn", "--print-defaults"}), 0);
  EXPECT_EQ(run({"hgn"}), 2);
  EXPECT_EQ(run({"hgn", "--dta", "x"}), 2);
  EXPECT_EQ(run({"hgn", "--stepz", "3"}), 2);
  EXPECT_NE(log().find("Did you mean '--steps'"), std::string::npos) << log();
  EXPECT_EQ(run({"hgm"}), 2);
  EXPECT_NE(log().find("Did you mean 'hgn'"), std::string::npos) << log();
  EXPECT_EQ(run({"hgn", "--data", folder_ + "/none"}), 3);
  EXPECT_EQ(run({"hgn", "--evaluate", "w", "--data", folder_, "--preset", "paper"}), 2);
  EXPECT_NE(log().find("--evaluate trains nothing"), std::string::npos) << log();
  auto words = training("x");
  words.insert(words.end(), {"--set", "hgn.latnt=3"});
  EXPECT_EQ(run(words), 2);
  EXPECT_NE(log().find("latent"), std::string::npos);  // did you mean
  EXPECT_FALSE(fs::exists(folder_ + "/x"));
}

TEST_F(Program, RunsBeginWithAPreset) {
  const auto begins_with = [&](const std::vector<std::string>& words) {
    std::vector<std::string> all = {"hgn", "--print-defaults"};
    all.insert(all.end(), words.begin(), words.end());
    EXPECT_EQ(run(all), 0) << log();
    return read_train_config(log(), "defaults");
  };
  const TrainConfig recommended = begins_with({}), paper = begins_with({"--preset", "paper"});
  EXPECT_EQ(config_hash(begins_with({"--preset", "recommended"})), config_hash(recommended));
  EXPECT_EQ(recommended.hgn.aggregation, graph::Aggregation::activations);
  EXPECT_TRUE(recommended.hgn.signed_distance && recommended.symmetries);
  EXPECT_EQ(paper.hgn.to_metadata(), graph::HgnConfig().to_metadata());  // whose defaults are the paper's
  EXPECT_EQ(paper.batch_scenes, 1);
  EXPECT_EQ(paper.jitter, GridJitter::finest);
  EXPECT_EQ(begins_with({"--set", "hgn.latent=32"}).hgn.latent, 32);  // what is set comes after
  EXPECT_EQ(begins_with({"--config", folder_ + "/config.json"}).hgn.latent, tiny_config().hgn.latent);
  EXPECT_EQ(run({"hgn", "--print-defaults", "--preset", "paper", "--config", folder_ + "/config.json"}), 2);
  EXPECT_NE(log().find("--preset and --config"), std::string::npos) << log();
  EXPECT_EQ(run({"hgn", "--preset", "papers"}), 2);
}

TEST_F(Program, TrainsWritesARunFolderAndEvaluates) {
  auto words = training("run");
  words.insert(words.end(), {"--json", folder_ + "/result.json"});
  ASSERT_EQ(run(words), 0) << log();
  for (const char* file :
       {"config.json", "run.json", "command.txt", "log.txt", "normalization.safetensors", "metrics.csv",
        "metrics.jsonl", "weights.safetensors", "checkpoints/step-00000020/adam_v.safetensors"})
    EXPECT_TRUE(fs::exists(folder_ + "/run/" + file)) << file;
  EXPECT_NE(read_file(folder_ + "/result.json").find("\"steps\": 20"), std::string::npos);
  EXPECT_NE(read_file(folder_ + "/run/log.txt").find("step 10/20"), std::string::npos);
  ASSERT_EQ(run({"hgn", "--evaluate", folder_ + "/run/weights.safetensors", "--data", tiny_data_set(), "--stride", "3",
                 "--json", folder_ + "/errors.json"}),
            0)
      << log();
  EXPECT_NE(log().find("airborne"), std::string::npos);
  EXPECT_NE(read_file(folder_ + "/errors.json").find("near_obstacle"), std::string::npos);
}

TEST_F(Program, LearnsFromATeacherWhenItIsResumedToo) {
  ASSERT_EQ(run(training("teacher")), 0) << log();
  const std::string teacher = folder_ + "/teacher/weights.safetensors";
  auto words = training("student");
  words.insert(words.end(), {"--teacher", teacher, "--stop-step", "5"});
  ASSERT_EQ(run(words), 0) << log();
  ASSERT_EQ(run({"hgn", "--resume", folder_ + "/student", "--device", "cpu", "--threads", "1"}), 0) << log();
  EXPECT_NE(log().find("learns from '" + teacher), std::string::npos) << log();
  EXPECT_EQ(run({"hgn", "--resume", folder_ + "/student", "--teacher", teacher}), 2);
  fs::remove(teacher);
  EXPECT_EQ(run({"hgn", "--resume", folder_ + "/student", "--device", "cpu"}), 3);
  EXPECT_NE(log().find("teacher/weights.safetensors"), std::string::npos) << log();
}

TEST_F(Program, ReducedModelsTellTheirOfflineCost) {
  const std::string data = tiny_sweep("offline_cost_data"), weights = folder_ + "/nsf/weights.safetensors";
  write_file_atomically(data + "/dataset.json", R"({"made_in": [{"device": "a GPU", "seconds": 30}]})");
  ASSERT_EQ(run({"nsf", "--data", data, "--out", folder_ + "/nsf", "--threads", "1", "--set", "samples=120", "--set",
                 "deformation_modes=8", "--set", "stress_modes=8", "--set", "affine_modes=8"}),
            0)
      << log();
  const nn::OfflineCost cost = nn::offline_cost_of(nn::read_safetensors(weights).metadata, weights);
  EXPECT_EQ(nn::total_seconds(cost.data), 30);
  ASSERT_EQ(cost.training.size(), 1u);
  EXPECT_GT(cost.training[0].seconds, 0);
  EXPECT_EQ(cost.training[0].device, hardware_name(Device::cpu, 1));
  EXPECT_EQ(run({"nsf", "--data", data, "--out", folder_ + "/nsf"}), 2);
  EXPECT_NE(log().find("holds a run already"), std::string::npos) << log();
  EXPECT_EQ(run({"nsf", "--resume", folder_ + "/nsf"}), 3);
  EXPECT_NE(log().find("is a run without steps"), std::string::npos) << log();
  remove_path(data);
}

TEST_F(Program, ATrainingOfADeformationStopsAndGoesOn) {
  EXPECT_EQ(run({"crom", "--print-defaults"}), 0);
  EXPECT_EQ(run({"crom", "--out", folder_ + "/crom"}), 2);
  EXPECT_NE(log().find("crom_gravity.json"), std::string::npos) << log();
  const std::string data = affine_sweep("crom_program_data"), out = folder_ + "/crom";
  const pid_t child =
      start({"crom", "--data", data, "--out", out, "--threads", "1", "--device", "cpu", "--set", "latents=1", "--set",
             "samples=20", "--set", "epochs_scale=1000", "--set", "checkpoint_interval=10", "--time-limit", "600"},
            folder_ + "/log");
  for (int i = 0; i < 600 && !has_checkpoint(out); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  ::kill(child, SIGTERM);
  EXPECT_EQ(finish(child), 130) << log();
  EXPECT_NE(log().find("graupel train crom --resume " + out), std::string::npos) << log();
  EXPECT_FALSE(fs::exists(out + "/weights.safetensors"));
  EXPECT_EQ(run({"crom", "--resume", out, "--set", "latents=2"}), 2);
  EXPECT_EQ(run({"crom", "--resume", out, "--out", folder_ + "/other"}), 2);
  EXPECT_EQ(read_run_facts(out).time_limit, 600);
  const std::string other = new_sweep_folder("other_program_data");
  fs::copy_file(data + "/test.h5", other + "/train.h5");
  EXPECT_EQ(run({"crom", "--resume", out, "--data", other, "--device", "cpu"}), 2);
  EXPECT_NE(log().find("began with other runs"), std::string::npos) << log();
  remove_path(other);
  ASSERT_EQ(run({"crom", "--resume", out, "--device", "cpu", "--time-limit", "0.01"}), 0) << log();
  EXPECT_EQ(nn::read_safetensors(out + "/weights.safetensors").metadata.at("architecture"), "crom");
  remove_path(data);
}

TEST_F(Program, CoarseModelsTellTheirOfflineCost) {
  std::string recipe = read_file(GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json");
  const auto set = [&](const std::string& key, const std::string& end, const std::string& value) {
    const std::size_t at = recipe.find("\"" + key + "\":");
    recipe.replace(at, recipe.find(end, at) - at, "\"" + key + "\": " + value);
  };
  set("categories", ",\n  \"domain\"", "[\"dam_break\"]");
  set("sizes", ",\n    \"dx\"", "[[1, 1, 1]]");
  set("dx", ", \"wall_cells\"", "0.03125");
  set("max_particles", ",\n", "600");
  const std::string assets = "\"assets/", there = "\"" GRAUPEL_SOURCE_DIR "/scenes/recipes/assets/";
  for (std::size_t at = 0; (at = recipe.find(assets, at)) != std::string::npos; at += there.size())
    recipe.replace(at, assets.size(), there);
  write_file_atomically(folder_ + "/recipe.json", recipe);
  const std::vector<std::string> words = {"coarse",   "--recipe",  folder_ + "/recipe.json",
                                          "--scenes", "2",         "--valid-scenes",
                                          "2",        "--frames",  "10",
                                          "--sweeps", "1",         "--minutes",
                                          "1e-9",     "--threads", "1",
                                          "--device", "cpu",       "--out"};
  const auto trained = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> all = words;
    all.push_back(folder_ + out);
    all.insert(all.end(), more.begin(), more.end());
    EXPECT_EQ(run(all), 0) << log();
    const std::string file = folder_ + out + "/weights.safetensors";
    return nn::offline_cost_of(nn::read_safetensors(file).metadata, file);
  };
  const nn::OfflineCost first = trained("/first", {});
  ASSERT_EQ(first.training.size(), 1u);
  EXPECT_GT(nn::total_seconds(first.data), 0);
  EXPECT_GT(first.training[0].seconds, 0);
  EXPECT_EQ(first.data[0].device, hardware_name(Device::cpu, 1));
  const nn::OfflineCost second = trained("/second", {"--from", folder_ + "/first/weights.safetensors"});
  ASSERT_EQ(second.training.size(), 2u);
  EXPECT_DOUBLE_EQ(*second.training[0].seconds, *first.training[0].seconds);
  std::vector<std::string> again = words;
  again.push_back(folder_ + "/second");
  EXPECT_EQ(run(again), 2);
  EXPECT_NE(log().find("holds a run already (weights.safetensors)"), std::string::npos) << log();
}

TEST_F(Program, TrainsGoesOnWithAndEvaluatesAGns) {
  const std::vector<std::string> words = {"gns",
                                          "--data",
                                          tiny_data_set(),
                                          "--out",
                                          folder_ + "/gns",
                                          "--steps",
                                          "12",
                                          "--stop-step",
                                          "6",
                                          "--threads",
                                          "1",
                                          "--device",
                                          "cpu",
                                          "--set",
                                          "gns.latent=8",
                                          "--set",
                                          "gns.message_passing=2",
                                          "--set",
                                          "gns.dx=0.03125",
                                          "--set",
                                          "gns.obstacle_particles=true",
                                          "--set",
                                          "checkpoint_layers=1",
                                          "--set",
                                          "rollout_frames=2"};
  ASSERT_EQ(run(words), 0) << log();
  EXPECT_NE(log().find("graupel train gns --resume"), std::string::npos) << log();
  EXPECT_EQ(run({"hgn", "--resume", folder_ + "/gns"}), 2);
  EXPECT_NE(log().find("is a run of another network (gns)"), std::string::npos) << log();
  ASSERT_EQ(run({"gns", "--resume", folder_ + "/gns", "--threads", "1", "--device", "cpu"}), 0) << log();
  EXPECT_NE(log().find("resumed at step 6"), std::string::npos) << log();
  const std::string weights = folder_ + "/gns/weights.safetensors";
  EXPECT_EQ(nn::read_safetensors(weights).metadata.at("gns.latent"), "8");
  EXPECT_EQ(run({"gns", "--evaluate", weights, "--data", tiny_data_set(), "--stride", "5"}), 0) << log();
  EXPECT_NE(log().find("airborne"), std::string::npos);
  EXPECT_EQ(run({"hgn", "--evaluate", weights, "--data", tiny_data_set()}), 3);
  EXPECT_NE(log().find("(architecture 'gns', needed 'hgn'). Use graupel train gns"), std::string::npos) << log();
  EXPECT_EQ(run({"gns", "--print-defaults"}), 0);
  EXPECT_EQ(read_train_config(log(), "defaults").architecture, Architecture::gns);
  EXPECT_EQ(run({"gns", "--data", tiny_data_set(), "--set", "hgn.latent=8"}), 2);
}

TEST_F(Program, RefusesWeightsOfAnotherArchitecture) {
  nn::Weights weights;
  weights.metadata = graph::HgnConfig().to_metadata();
  weights.metadata["architecture"] = "segnn";
  nn::write_safetensors(folder_ + "/segnn.safetensors", weights);
  EXPECT_EQ(run({"hgn", "--evaluate", folder_ + "/segnn.safetensors", "--data", tiny_data_set()}), 3);
  EXPECT_NE(log().find("segnn"), std::string::npos);
}

TEST_F(Program, SigtermSavesAndEndsWith130) {
  EXPECT_EQ(interrupt("term", SIGTERM), 130) << log();
  EXPECT_NE(log().find("--resume"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder_ + "/term/weights.safetensors"));
}

TEST_F(Program, SigintSavesAndEndsWith130) { EXPECT_EQ(interrupt("int", SIGINT), 130) << log(); }

TEST_F(Program, Sigusr1SavesAndEndsWith75) { EXPECT_EQ(interrupt("usr1", SIGUSR1), 75) << log(); }

TEST_F(Program, AKilledRunGoesOnFromItsLastCheckpoint) {
  EXPECT_EQ(interrupt("killed", SIGKILL), 1000 + SIGKILL);
  ASSERT_EQ(run({"hgn", "--resume", "latest", "--out", folder_, "--minutes", "0.001", "--threads", "1"}), 0) << log();
  EXPECT_NE(log().find("resumed at step "), std::string::npos);
  EXPECT_EQ(log().find("resumed at step 0\n"), std::string::npos);
  EXPECT_EQ(run({"hgn", "--resume", folder_ + "/killed", "--steps", "5"}), 2);
  EXPECT_EQ(run({"hgn", "--resume", folder_ + "/killed", "--out", folder_ + "/other"}), 2);
  EXPECT_EQ(run({"hgn", "--resume", folder_ + "/killed", "--print-defaults"}), 0);
  EXPECT_EQ(config_hash(read_train_config(log(), "defaults")), config_hash(read_run_config(folder_ + "/killed")));
}

TEST_F(Program, AFullStandardOutputIsAnErrorOfWriting) {
  EXPECT_EQ(finish(start({"hgn", "--print-defaults"}, "/dev/full")), 5);
}

TEST_F(Program, RefusesWordsWithoutEffect) {
  const std::string weights = folder_ + "/w.safetensors";
  EXPECT_EQ(run({"hgn", "--data", std::string(tiny_data_set()) + "/train.h5"}), 2);
  EXPECT_NE(log().find("Name the folder that it is in"), std::string::npos) << log();
  EXPECT_EQ(run({"hgn", "--data", tiny_data_set(), "--split", "valid"}), 2);
  EXPECT_EQ(run({"hgn", "--data", tiny_data_set(), "--stride", "2"}), 2);
  EXPECT_EQ(run({"hgn", "--data", tiny_data_set(), "--evaluate", weights, "--minutes", "5"}), 2);
  EXPECT_EQ(run({"hgn", "--data", tiny_data_set(), "--evaluate", weights, "--emit-slurm", "1"}), 2);
  EXPECT_EQ(run({"hgn", "--data", tiny_data_set(), "--emit-slurm", "8", "--set", "batch_scenes=2"}), 2);
  EXPECT_NE(log().find("8 ranks are too many"), std::string::npos) << log();
}

}  // namespace
}  // namespace graupel::train
