// graupel launch: several ranks of a training run on this machine.
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "apps/verbs.h"
#include "core/system/error.h"
#include "experiments/process/rank_processes.h"

namespace graupel::apps {

using namespace experiments;

namespace {

void check_command(const std::vector<std::string>& words) {
  if (words.front() == "train") return;
  throw ConfigError(
      "'" + words.front() +
      "' cannot be launched (other verbs than 'train' know nothing of ranks). Example: graupel launch -n 2 "
      "-- train hgn --data data/hgn");
}

}  // namespace

void add_launch(const Command& app, int& exit_code) {
  auto ranks = std::make_shared<RankProcesses>();
  const Command verb = app.command("launch", "Train on several processes or GPUs of this machine");
  verb.option("-n,--ranks", ranks->count, "Processes: one for a GPU, or some on the CPU")
      .check(whole_number(1, 1024))
      .required();
  verb.option("command", ranks->arguments, "What to start: 'train' and its words, after '--'").required();
  verb.footer(
      "Starts the same training N times. The ranks divide each batch and add up their gradients, so that the steps "
      "are\n"
      "those of one process. Rank 0 prints, validates and writes the run folder; lines of the others carry [rank K].\n"
      "Ctrl-C, SIGTERM and SIGUSR1 reach every rank; when one fails the others are ended, and its exit code is "
      "returned.\n"
      "On several machines use torchrun, srun or mpirun (docs/guide/training.md, \"Several "
      "processes\").\n\nExamples:\n"
      "  graupel launch -n 2 -- train hgn --data data/hgn --out runs/hgn --device cuda\n"
      "  graupel launch -n 4 -- train hgn --resume runs/hgn");
  verb.callback([ranks, &exit_code] {
    check_command(ranks->arguments);
    ranks->program = std::filesystem::read_symlink("/proc/self/exe");
    exit_code = run_rank_processes(*ranks);
  });
}

}  // namespace graupel::apps
