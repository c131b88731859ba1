// Which rank this process is, by the variables that each launcher sets.
#include "train/parallel/rank_environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "core/system/error.h"

namespace graupel::train {
namespace {

using testing::HasSubstr;

using Map = std::map<std::string, std::string>;

RankEnvironment read(const Map& map) {
  return read_rank_environment([&](const std::string& name) -> std::optional<std::string> {
    const auto found = map.find(name);
    return found == map.end() ? std::nullopt : std::optional(found->second);
  });
}

std::string refusal(const Map& map) {
  try {
    read(map);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

const Map torchrun = {{"RANK", "5"},
                      {"WORLD_SIZE", "8"},
                      {"LOCAL_RANK", "1"},
                      {"LOCAL_WORLD_SIZE", "4"},
                      {"MASTER_ADDR", "node7"},
                      {"MASTER_PORT", "1234"}};
const Map open_mpi = {{"OMPI_COMM_WORLD_RANK", "1"},
                      {"OMPI_COMM_WORLD_SIZE", "2"},
                      {"OMPI_COMM_WORLD_LOCAL_RANK", "1"},
                      {"OMPI_COMM_WORLD_LOCAL_SIZE", "2"},
                      {"PMIX_NAMESPACE", "1804926977"}};
const Map mpich = {{"PMI_RANK", "2"}, {"PMI_SIZE", "3"}, {"MPI_LOCALRANKID", "2"}, {"MPI_LOCALNRANKS", "3"}};
const Map srun = {{"SLURM_PROCID", "5"},
                  {"SLURM_STEP_NUM_TASKS", "7"},
                  {"SLURM_LOCALID", "1"},
                  {"SLURM_NODEID", "2"},
                  {"SLURM_STEP_TASKS_PER_NODE", "2(x3),1"},
                  {"SLURM_STEP_NODELIST", "gpu[03-05,9],login"},
                  {"SLURM_JOB_ID", "4711"},
                  {"SLURM_STEP_ID", "0"}};

Map with(Map map, const Map& changes) {
  for (const auto& [name, value] : changes)
    if (value.empty())
      map.erase(name);
    else
      map[name] = value;
  return map;
}

TEST(RankEnvironment, NothingSetIsOneProcess) {
  EXPECT_TRUE(read({}).alone());
  EXPECT_EQ(read({}).launcher, "");
  // A batch script of Slurm, where srun has started nothing.
  EXPECT_TRUE(read({{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "4"}, {"SLURM_LOCALID", "0"}}).alone());
}

TEST(RankEnvironment, Torchrun) {
  const RankEnvironment e = read(torchrun);
  EXPECT_EQ(e.launcher, "RANK, WORLD_SIZE");
  EXPECT_EQ(e.rank, 5);
  EXPECT_EQ(e.size, 8);
  EXPECT_EQ(e.local_rank, 1);
  EXPECT_EQ(e.local_size, 4);
  EXPECT_EQ(e.address, "node7");
  EXPECT_EQ(e.port, 1234);
  EXPECT_FALSE(e.served);
  const RankEnvironment elastic = read(with(torchrun, {{"TORCHELASTIC_RUN_ID", "none"},
                                                       {"TORCHELASTIC_USE_AGENT_STORE", "True"},
                                                       {"TORCHELASTIC_RESTART_COUNT", "2"}}));
  EXPECT_EQ(elastic.launcher, "torchrun");
  EXPECT_TRUE(elastic.served);
  EXPECT_EQ(elastic.restart, 2);
}

TEST(RankEnvironment, OpenMpi) {
  const RankEnvironment e = read(open_mpi);
  EXPECT_EQ(e.launcher, "Open MPI");
  EXPECT_EQ(e.rank, 1);
  EXPECT_EQ(e.size, 2);
  EXPECT_EQ(e.local_rank, 1);
  EXPECT_EQ(e.local_size, 2);
  EXPECT_EQ(e.address, "127.0.0.1");
  // Two runs on one machine meet at ports of their own; MASTER_PORT decides where it is set.
  EXPECT_NE(e.port, read(with(open_mpi, {{"PMIX_NAMESPACE", "1804926978"}})).port);
  EXPECT_EQ(read(with(open_mpi, {{"MASTER_PORT", "999"}})).port, 999);
  // On several machines nobody says where rank 0 is.
  EXPECT_THAT(refusal(with(open_mpi, {{"OMPI_COMM_WORLD_SIZE", "4"}})), HasSubstr("MASTER_ADDR"));
  EXPECT_EQ(read(with(open_mpi, {{"OMPI_COMM_WORLD_SIZE", "4"}, {"MASTER_ADDR", "a"}})).address, "a");
}

TEST(RankEnvironment, Mpich) {
  const RankEnvironment e = read(mpich);
  EXPECT_EQ(e.launcher, "MPICH");
  EXPECT_EQ(e.rank, 2);
  EXPECT_EQ(e.size, 3);
  EXPECT_EQ(e.local_rank, 2);
  EXPECT_EQ(e.local_size, 3);
  EXPECT_EQ(e.address, "127.0.0.1");
}

TEST(RankEnvironment, Srun) {
  const RankEnvironment e = read(srun);
  EXPECT_EQ(e.launcher, "srun");
  EXPECT_EQ(e.rank, 5);
  EXPECT_EQ(e.size, 7);
  EXPECT_EQ(e.local_rank, 1);
  EXPECT_EQ(e.local_size, 2);
  EXPECT_EQ(e.address, "gpu03");
  EXPECT_GE(e.port, 20000);
  EXPECT_LT(e.port, 30000);
  EXPECT_EQ(e.port, read(with(srun, {{"SLURM_PROCID", "0"}, {"SLURM_LOCALID", "0"}, {"SLURM_NODEID", "0"}})).port);
  EXPECT_NE(e.port, read(with(srun, {{"SLURM_STEP_ID", "1"}})).port);
  EXPECT_EQ(read(with(srun, {{"SLURM_NODEID", "3"}, {"SLURM_LOCALID", "0"}})).local_size, 1);
  EXPECT_EQ(read(with(srun, {{"MASTER_ADDR", "ib7"}})).address, "ib7");
  // srun --mpi=pmi2 sets MPICH's variables as well.
  EXPECT_EQ(read(with(srun, {{"PMI_RANK", "5"}, {"PMI_SIZE", "7"}})).launcher, "srun");
}

TEST(RankEnvironment, OneLauncherInsideAnother) {
  // mpirun starts its helpers by srun, one on each machine.
  Map both = srun;
  both.insert(open_mpi.begin(), open_mpi.end());
  EXPECT_EQ(read(both).launcher, "Open MPI");
  // One torchrun on each of two machines.
  Map nested = torchrun;
  nested.insert(open_mpi.begin(), open_mpi.end());
  EXPECT_EQ(read(nested).size, 8);
  // torchrun numbers machines as they come.
  const Map swapped = {{"SLURM_PROCID", "0"}, {"SLURM_STEP_NUM_TASKS", "8"}, {"SLURM_LOCALID", "0"}};
  EXPECT_EQ(read(with(with(torchrun, swapped), {{"TORCHELASTIC_RUN_ID", "x"}})).rank, 5);
}

TEST(RankEnvironment, Contradictions) {
  EXPECT_THAT(refusal({{"RANK", "0"}}), HasSubstr("WORLD_SIZE is missing"));
  EXPECT_THAT(refusal({{"WORLD_SIZE", "2"}}), HasSubstr("RANK is missing"));
  EXPECT_THAT(refusal(with(torchrun, {{"RANK", "8"}})), HasSubstr("0 to 7"));
  EXPECT_THAT(refusal(with(torchrun, {{"RANK", "one"}})), HasSubstr("RANK='one'"));
  EXPECT_THAT(refusal(with(torchrun, {{"LOCAL_RANK", "4"}})), HasSubstr("0 to 3"));
  EXPECT_THAT(refusal(with(torchrun, {{"LOCAL_RANK", ""}})), HasSubstr("LOCAL_RANK is missing"));
  EXPECT_THAT(refusal(with(torchrun, {{"MASTER_ADDR", ""}})), HasSubstr("MASTER_ADDR is missing"));
  EXPECT_THAT(refusal(with(torchrun, {{"MASTER_PORT", "70000"}})), HasSubstr("65535"));
  EXPECT_THAT(refusal({{"SLURM_PROCID", "4"}, {"SLURM_STEP_NUM_TASKS", "4"}}), HasSubstr("SLURM_PROCID"));
  // RANK left over in the shell that mpirun was called from.
  const Map left_over = {{"RANK", "0"}, {"WORLD_SIZE", "2"}, {"LOCAL_RANK", "0"}};
  EXPECT_THAT(refusal(with(open_mpi, left_over)), HasSubstr("contradicts itself"));
  EXPECT_THAT(refusal(with(open_mpi, {{"RANK", "0"}, {"WORLD_SIZE", "1"}})), HasSubstr("Unset RANK"));
}

TEST(RankEnvironment, ThreadsAreSharedUnlessTheLauncherBoundThem) {
  RankEnvironment e;
  EXPECT_EQ(threads_of_rank(e, 16, 16), 16);
  e.size = e.local_size = 3;
  EXPECT_EQ(threads_of_rank(e, 16, 16), 5);
  EXPECT_EQ(threads_of_rank(e, 2, 2), 1);
  // A container of 4 of 64 cores: torchrun binds nobody.
  EXPECT_EQ(threads_of_rank(e, 4, 64), 1);
  e.bound = true;
  EXPECT_EQ(threads_of_rank(e, 4, 64), 4);
  EXPECT_EQ(threads_of_rank(e, 64, 64), 21);
}

TEST(RankEnvironment, EachRankSeesItsOwnGpu) {
  RankEnvironment e;
  e.size = 4;
  e.local_size = 2;
  e.local_rank = 1;
  EXPECT_EQ(gpu_of_rank(e, std::nullopt), "1");
  EXPECT_EQ(gpu_of_rank(e, "4,6"), "6");
  EXPECT_EQ(gpu_of_rank(e, "GPU-a,GPU-b,GPU-c"), "GPU-b");
  EXPECT_EQ(gpu_of_rank(e, ""), "");
  EXPECT_THROW(gpu_of_rank(e, "3"), ConfigError);
  e.bound = true;  // srun --gpus-per-task=1
  EXPECT_EQ(gpu_of_rank(e, "3"), "3");
}

TEST(RankEnvironment, FirstHostOfASlurmList) {
  EXPECT_EQ(first_host("n1"), "n1");
  EXPECT_EQ(first_host("n1,n2"), "n1");
  EXPECT_EQ(first_host("n[08-11],m"), "n08");
  EXPECT_EQ(first_host("n[3,5]x"), "n3x");
  EXPECT_EQ(first_host("rack[2-4]-node[07,9-12].cluster"), "rack2-node07.cluster");
}

}  // namespace
}  // namespace graupel::train
