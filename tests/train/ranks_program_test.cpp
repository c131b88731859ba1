// graupel-train started as several processes, as Open MPI's mpirun starts them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>
#include <thread>

#include "core/parallel/device.h"
#include "core/system/atomic_file.h"
#include "nn/weights.h"
#include "tests/train/rank_threads.h"
#include "tests/train/started_program.h"
#include "tests/train/tiny_data.h"
#include "train/loop/run_folder.h"
#include "train/networks/network_module.h"

namespace graupel::train {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class RanksProgram : public testing::Test {
 protected:
  RanksProgram() : folder_(test_folder("ranks_program")), port_(free_port()) {
    write_file_atomically(folder_ + "/config.json", train_config_text(tiny_config()));
  }
  ~RanksProgram() override { remove_path(folder_); }

  std::vector<std::string> training(const std::string& run, const std::string& device = "cpu") const {
    return {"hgn",       "--data", tiny_data_set(), "--out", folder_ + "/" + run, "--config", folder_ + "/config.json",
            "--threads", "1",      "--device",      device};
  }
  std::map<std::string, std::string> variables(int rank, int size) const {
    return {{"OMPI_COMM_WORLD_RANK", std::to_string(rank)},
            {"OMPI_COMM_WORLD_SIZE", std::to_string(size)},
            {"OMPI_COMM_WORLD_LOCAL_RANK", std::to_string(rank)},
            {"OMPI_COMM_WORLD_LOCAL_SIZE", std::to_string(size)},
            {"MASTER_PORT", std::to_string(port_)}};
  }
  std::string log_file(int rank) const { return folder_ + "/log" + std::to_string(rank); }
  std::string log(int rank) const { return fs::exists(log_file(rank)) ? read_file(log_file(rank)) : ""; }
  std::vector<pid_t> start_ranks(int size, const std::vector<std::string>& words) const {
    std::vector<pid_t> ranks;
    for (int rank = 0; rank < size; ++rank) ranks.push_back(start(words, log_file(rank), variables(rank, size)));
    return ranks;
  }
  /// Two ranks of an endless training that has begun.
  std::vector<pid_t> endless(const std::string& timeout) const {
    auto words = training("endless");
    words.insert(words.end(),
                 {"--steps", "1000000", "--set", "validation_interval=1000000", "--rank-timeout", timeout});
    const std::vector<pid_t> ranks = start_ranks(2, words);
    for (int i = 0; i < 1200 && log(0).find("step 10/") == std::string::npos; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return ranks;
  }
  void expect_the_steps_of_one_process(const std::string& device, double tolerance) {
    ASSERT_EQ(finish(start(training("one", device), log_file(0))), 0) << log(0);
    const std::vector<pid_t> ranks = start_ranks(2, training("two", device));
    for (int rank = 0; rank < 2; ++rank) EXPECT_EQ(finish(ranks[static_cast<std::size_t>(rank)]), 0) << log(rank);
    EXPECT_THAT(log(0), HasSubstr("2 ranks (Open MPI), CPU threads of each: 1"));
    EXPECT_THAT(log(1), testing::Not(HasSubstr("step ")));  // libtorch may warn there
    const nn::Weights a = nn::read_safetensors(folder_ + "/one/weights.safetensors"),
                      b = nn::read_safetensors(folder_ + "/two/weights.safetensors");
    for (const auto& [name, tensor] : a.tensors) {
      const std::vector<float> x = a.get(name, tensor.shape), y = b.get(name, tensor.shape);
      for (std::size_t i = 0; i < x.size(); ++i) ASSERT_NEAR(x[i], y[i], tolerance) << name;
    }
  }

  std::string folder_;
  int port_;
};

#define NEEDS_RANKS_ON_THE_CPU() \
  if (!can_join_ranks(Device::cpu)) GTEST_SKIP() << "this build has no Gloo"

TEST_F(RanksProgram, TwoProcessesTakeTheStepsOfOne) {
  NEEDS_RANKS_ON_THE_CPU();
  expect_the_steps_of_one_process("cpu", 1e-4);
}

TEST_F(RanksProgram, TwoGpusTakeTheStepsOfOne) {
  const char* const visible = std::getenv("CUDA_VISIBLE_DEVICES");
  const bool hidden = visible != nullptr && std::string(visible).find(',') == std::string::npos;
  if (!torch_has_cuda() || !cuda_available() || hidden || !fs::exists("/dev/nvidia1"))
    GTEST_SKIP() << "fewer than two GPUs here: NCCL was not run";
  expect_the_steps_of_one_process("cuda", 2e-3);
}

TEST_F(RanksProgram, AKilledRankEndsTheOther) {
  NEEDS_RANKS_ON_THE_CPU();
  const std::vector<pid_t> ranks = endless("600");
  ::kill(ranks[1], SIGKILL);
  EXPECT_EQ(finish(ranks[1]), 1000 + SIGKILL);
  EXPECT_EQ(finish(ranks[0]), 1);
  EXPECT_THAT(log(0), HasSubstr("rank 0 of 2: another rank has ended or does not answer"));
  EXPECT_THAT(log(0), HasSubstr("--resume"));
}

TEST_F(RanksProgram, ARankThatHangsEndsTheOtherAfterTheTimeout) {
  NEEDS_RANKS_ON_THE_CPU();
  const std::vector<pid_t> ranks = endless("4");
  ::kill(ranks[1], SIGSTOP);
  EXPECT_EQ(finish(ranks[0]), 1);
  EXPECT_THAT(log(0), HasSubstr("does not answer"));
  ::kill(ranks[1], SIGKILL);
  finish(ranks[1]);
}

TEST_F(RanksProgram, WhatRunsInOneProcessRefusesRanks) {
  EXPECT_EQ(finish(start({"nsf", "--data", folder_, "--out", folder_ + "/nsf"}, log_file(0), variables(0, 2))), 2);
  EXPECT_THAT(log(0), HasSubstr("'graupel train nsf' runs in one process (rank 0 of 2 by Open MPI)"));
  EXPECT_EQ(finish(start({"hgn", "--evaluate", "w", "--data", folder_}, log_file(0), variables(0, 2))), 2);
  EXPECT_THAT(log(0), HasSubstr("--evaluate runs in one process"));
  EXPECT_EQ(finish(start(training("x"), log_file(0), {{"RANK", "0"}})), 2);
  EXPECT_THAT(log(0), HasSubstr("WORLD_SIZE is missing"));
}

}  // namespace
}  // namespace graupel::train
