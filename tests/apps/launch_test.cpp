// graupel launch: several ranks on this machine, from the command line to the weights.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>

#include "core/system/atomic_file.h"
#include "nn/weights.h"
#include "tests/apps/program.h"
#include "tests/train/tiny_data.h"

namespace graupel::test {
namespace {

using testing::HasSubstr;
using train::tiny_data_set;

constexpr const char* settings =
    " --preset paper --device cpu --threads 1 --set hgn.latent=16 --set hgn.levels=2 --set hgn.message_passing=1 --set "
    "hgn.embedding=4 "
    "--set hgn.history=2 --set hgn.spacing=0.07 --set hgn.dx=0.03125 --set batch_scenes=4 --set noise_std=1e-4 --set "
    "log_interval=10 --set validation_interval=1000000 --set validation_samples=4 --set rollout_scenes=0 --set "
    "learning_rate=3e-3 ";

double largest_difference(const std::string& file_a, const std::string& file_b) {
  const nn::Weights a = nn::read_safetensors(file_a), b = nn::read_safetensors(file_b);
  double largest = 0;
  for (const auto& [name, tensor] : a.tensors) {
    const std::vector<float> x = a.get(name, tensor.shape), y = b.get(name, tensor.shape);
    for (std::size_t i = 0; i < x.size(); ++i) largest = std::max(largest, std::abs(double{x[i]} - double{y[i]}));
  }
  return largest;
}

/// `graupel launch` in a process of its own.
class Launched {
 public:
  Launched(int ranks, const std::string& train, const std::string& log) : log_(log) {
    std::istringstream text("launch -n " + std::to_string(ranks) + " -- train hgn " + train);
    std::vector<std::string> words = {GRAUPEL_BINARY_DIR "/graupel"};
    for (std::string word; text >> word;) words.push_back(word);
    process_ = ::fork();
    if (process_ != 0) return;
    if (!std::freopen(log.c_str(), "w", stdout) || ::dup2(STDOUT_FILENO, STDERR_FILENO) < 0) ::_exit(126);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ~Launched() {
    if (process_ > 0) ::kill(process_, SIGKILL);
  }
  Launched(const Launched&) = delete;
  Launched& operator=(const Launched&) = delete;

  void send(int signal) const { ::kill(process_, signal); }
  std::string log() const { return std::filesystem::exists(log_) ? read_file(log_) : ""; }
  bool wait_for(const std::string& text) const {
    for (int i = 0; i < 1200; ++i) {
      if (log().find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  }
  /// Process of a rank, by its environment.
  std::optional<pid_t> rank(int number) const {
    const std::string task = "/proc/" + std::to_string(process_) + "/task/" + std::to_string(process_) + "/children";
    std::istringstream children(read_proc(task));
    const std::string wanted = std::string("\0RANK=", 6) + std::to_string(number) + std::string("\0", 1);
    for (pid_t child; children >> child;)
      if ((std::string("\0", 1) + read_proc("/proc/" + std::to_string(child) + "/environ")).find(wanted) !=
          std::string::npos)
        return child;
    return std::nullopt;
  }
  int exit_code() {
    int status = 0;
    ::waitpid(process_, &status, 0);
    process_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
  }

 private:
  static std::string read_proc(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  pid_t process_ = 0;
  std::string log_;
};

class Launch : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(GRAUPEL_BINARY_DIR "/graupel-train")) GTEST_SKIP() << "this build has no training";
    static const bool connected =
        !graupel("launch -n 2 -- train hgn --device cpu --data /nonexistent --rank-timeout 60").says("this build has");
    if (!connected) GTEST_SKIP() << "this build has no Gloo";
  }
  std::string training(const std::string& run) const {
    return "--data " + tiny_data_set() + " --out " + folder_.file(run) + settings;
  }
  /// One that goes on until it is ended.
  std::string endless(const std::string& run) const {
    return training(run) + "--steps 1000000 --set checkpoint_interval=1000000";
  }
  bool has_checkpoint(const std::string& run) const {
    return std::filesystem::exists(folder_.file(run) + "/weights.safetensors") ||
           !std::filesystem::is_empty(folder_.file(run) + "/checkpoints");
  }
  Folder folder_;
};

TEST(LaunchUsage, HelpAndErrors) {
  const Outcome help = graupel("launch --help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_TRUE(help.says("graupel launch -n 2 -- train hgn"));
  EXPECT_LT(std::count(help.output.begin(), help.output.end(), '\n'), 40);
  EXPECT_EQ(graupel("launch -- train hgn").exit_code, 2);
  EXPECT_EQ(graupel("launch -n 0 -- train hgn").exit_code, 2);
  const Outcome other = graupel("launch -n 2 -- simulate scene.json");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_TRUE(other.says("'simulate' cannot be launched")) << other.output;
  EXPECT_EQ(graupel("launch -n 2").exit_code, 2);
}

TEST_F(Launch, TwoRanksGiveTheWeightsOfOneProcessAndThreeGoOn) {
  const Outcome one = graupel("train hgn " + training("one") + "--steps 6");
  ASSERT_EQ(one.exit_code, 0) << one.output;
  const Outcome two =
      graupel("launch -n 2 -- train hgn " + training("two") + "--steps 6 --json " + folder_.file("result.json"));
  ASSERT_EQ(two.exit_code, 0) << two.output;
  EXPECT_LT(
      largest_difference(folder_.file("one") + "/weights.safetensors", folder_.file("two") + "/weights.safetensors"),
      2e-5);
  EXPECT_EQ(two.output.find("[rank 1]"), std::string::npos) << two.output;
  EXPECT_EQ(two.output.find("step 6/6"), two.output.rfind("step 6/6")) << two.output;
  EXPECT_EQ(nlohmann::json::parse(read_file(folder_.file("two") + "/run.json")).at("ranks"), 2);
  EXPECT_EQ(nlohmann::json::parse(read_file(folder_.file("result.json"))).at("steps"), 6);
  EXPECT_THAT(read_file(folder_.file("two") + "/log.txt"), HasSubstr("step 6/6"));

  // Stopped on three ranks, finished by one process.
  const Outcome part = graupel("launch -n 3 -- train hgn " + training("part") + "--steps 6 --stop-step 2");
  ASSERT_EQ(part.exit_code, 0) << part.output;
  const Outcome rest = graupel("launch -n 2 -- train hgn --device cpu --threads 1 --resume " + folder_.file("part"));
  ASSERT_EQ(rest.exit_code, 0) << rest.output;
  EXPECT_TRUE(rest.says("resumed at step 2 on 2 ranks")) << rest.output;
  EXPECT_LT(
      largest_difference(folder_.file("one") + "/weights.safetensors", folder_.file("part") + "/weights.safetensors"),
      2e-5);
}

TEST_F(Launch, AnErrorOfTheRanksIsTheErrorOfTheLauncher) {
  const Outcome outcome = graupel("launch -n 2 -- train hgn --device cpu --data " + folder_.file("none"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_TRUE(outcome.says("train.h5")) << outcome.output;
  EXPECT_TRUE(outcome.says("ended with exit code 3")) << outcome.output;
  // Found by rank 0 alone, which tells the others.
  const Outcome usage = graupel("launch -n 3 -- train hgn " + training("usage") + "--set hgn.latnt=3");
  EXPECT_EQ(usage.exit_code, 2) << usage.output;
  EXPECT_TRUE(usage.says("Did you mean 'latent'")) << usage.output;
  EXPECT_TRUE(usage.says("[rank 2] graupel-train: rank 0 refuses the run")) << usage.output;
}

TEST_F(Launch, AKilledRankEndsTheOthersAndTheRunGoesOn) {
  Launched run(3, endless("killed"), folder_.file("log"));
  ASSERT_TRUE(run.wait_for("step 10/")) << run.log();
  const auto victim = run.rank(1);
  ASSERT_TRUE(victim);
  const auto start = std::chrono::steady_clock::now();
  ::kill(*victim, SIGKILL);
  EXPECT_EQ(run.exit_code(), 128 + SIGKILL) << run.log();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  EXPECT_THAT(run.log(), HasSubstr("rank 1 was ended by signal Killed"));
  EXPECT_TRUE(has_checkpoint("killed"));  // rank 0 kept its last whole step
  const Outcome rest =
      graupel("train hgn --device cpu --threads 1 --minutes 0.0001 --resume " + folder_.file("killed"));
  EXPECT_EQ(rest.exit_code, 0) << rest.output;
  EXPECT_FALSE(rest.says("starting at step 0")) << rest.output;
}

TEST_F(Launch, SignalsReachEveryRank) {
  for (const int signal : {SIGTERM, SIGINT}) {
    const std::string name = "signal" + std::to_string(signal);
    Launched run(2, endless(name), folder_.file(name + ".log"));
    ASSERT_TRUE(run.wait_for("step 10/")) << run.log();
    run.send(signal);
    EXPECT_EQ(run.exit_code(), 130) << run.log();
    EXPECT_THAT(run.log(), HasSubstr("stopped at step "));
    EXPECT_TRUE(has_checkpoint(name));
  }
}

}  // namespace
}  // namespace graupel::test
