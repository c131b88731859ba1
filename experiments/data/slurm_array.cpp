#include "experiments/data/slurm_array.h"

#include <algorithm>
#include <map>
#include <string_view>

#include "core/system/shell_words.h"

namespace graupel::experiments {

namespace {

constexpr const char* head = R"(#!/usr/bin/env bash
# Makes a data set by a Slurm array of @TASKS@ tasks and, after them, a job that finishes the set:
#   bash FILE [OPTIONS OF SBATCH FOR ALL JOBS, such as --partition=cpu --time=2:00:00 --cpus-per-task=8]
# The same again makes what is missing. GRAUPEL='apptainer exec graupel.sif graupel' in the environment starts that
# instead of the program that wrote this.
set -euo pipefail
if ! command -v sbatch > /dev/null; then
  echo "sbatch is not there. Run this script on a machine that submits to Slurm" >&2
  exit 1
fi
)";

constexpr const char* submission = R"(
@NAME@=$(sbatch --parsable --requeue --job-name=graupel-@NAME@ @OPTIONS@ "$@" << '@END@'
#!/usr/bin/env bash
cd @FOLDER@ || exit 1
exec @COMMAND@
@END@
)
echo "@NAME@: job $@NAME@"
)";

/// The template with all its marks "@NAME@" replaced; values may hold what looks like one.
std::string filled(std::string_view text, const std::map<std::string_view, std::string>& values) {
  std::string out;
  for (std::size_t at; (at = text.find('@')) != std::string_view::npos;) {
    const std::size_t end = text.find('@', at + 1);
    const auto value = end == std::string_view::npos ? values.end() : values.find(text.substr(at + 1, end - at - 1));
    const std::size_t taken = value == values.end() ? at + 1 : end + 1;
    out += text.substr(0, value == values.end() ? taken : at);
    if (value != values.end()) out += value->second;
    text.remove_prefix(taken);
  }
  return out + std::string(text);
}

/// What ends the here-document of a job: no part of the job itself, whose arguments may have lines.
std::string end_of_job(const std::string& job) {
  std::string end = "END_OF_JOB";
  while (job.find(end) != std::string::npos) end += "_";
  return end;
}

}  // namespace

std::string slurm_array_script(const std::string& program, const std::vector<std::string>& words,
                               const std::string& folder, int tasks) {
  const std::string count = std::to_string(tasks);
  const bool threads_given =
      std::any_of(words.begin(), words.end(), [](const std::string& word) { return word.rfind("--threads", 0) == 0; });
  const auto command = [&](const std::vector<std::string>& all) {
    const std::vector<std::string> arguments(all.begin() + 1, all.end());
    return "${GRAUPEL:-" + shell_word(program) + "} " + shell_line(arguments) +
           (threads_given ? "" : " --threads \"${SLURM_CPUS_ON_NODE:-0}\"");
  };
  const auto job = [&](const std::string& name, const std::string& options, const std::string& line) {
    const std::string place = shell_word(folder);
    return filled(submission, {{"NAME", name},
                               {"OPTIONS", options},
                               {"END", end_of_job(place + "\n" + line)},
                               {"FOLDER", place},
                               {"COMMAND", line}});
  };
  // The number of parts is written out: a task that is submitted alone later still makes its own part.
  return filled(head, {{"TASKS", count}}) +
         job("shards", "--array=0-" + std::to_string(tasks - 1),
             command(without_option(words, "--json")) + " --shard \"$SLURM_ARRAY_TASK_ID/" + count + "\"") +
         job("merge", "--dependency=\"afterok:${shards%%;*}\" --kill-on-invalid-dep=yes", command(words));
}

}  // namespace graupel::experiments
