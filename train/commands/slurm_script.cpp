#include "train/commands/slurm_script.h"

#include <filesystem>

#include "core/system/shell_words.h"
#include "core/system/stop_signal.h"

namespace graupel::train {

namespace {

constexpr const char* after_start = R"(
stopping=
stop() {
  stopping=1
  kill -USR1 "$training" 2> /dev/null
}
trap stop USR1
wait "$training"
status=$?
while [ -n "$stopping" ]; do  # a signal ends 'wait' before the training has ended
  stopping=
  wait "$training"
  status=$?
done
)";

}  // namespace

SlurmTraining slurm_training(int ranks, const std::string& run, const std::vector<std::string>& resume, bool is_new) {
  SlurmTraining training = {
      ranks, std::filesystem::read_symlink("/proc/self/exe"), resume, resume, run, std::filesystem::current_path()};
  if (is_new) {
    training.begin = without_option(without_option(process_words(), "--emit-slurm"), "--out");
    training.begin.erase(training.begin.begin());
    training.begin.insert(training.begin.end(), {"--out", run});
  }
  return training;
}

std::string slurm_training_script(const SlurmTraining& training) {
  const std::string ranks = std::to_string(training.ranks), code = std::to_string(start_again_exit_code);
  std::string program = "${GRAUPEL_TRAIN:-" + shell_word(training.program) + "}";
  if (training.ranks > 1) program = "srun --ntasks=" + ranks + " " + program;
  std::string text = "#!/usr/bin/env bash\n#SBATCH --job-name=graupel-train\n#SBATCH --ntasks=" + ranks;
  text += "\n#SBATCH --signal=B:USR1@120\n#SBATCH --requeue\n#SBATCH --open-mode=append\n";
  text +=
      "# Begins the run, or goes on where its folder is there. Options of the cluster come before the file's name:\n";
  text += "#   sbatch --partition=gpu --time=4:00:00 --gpus-per-task=1 FILE\n";
  text += "# GRAUPEL_TRAIN='apptainer exec graupel.sif graupel-train' in the environment starts that instead.\n";
  text += "cd " + shell_word(training.folder) + " || exit 1\n";
  text += "if [ -e " + shell_word(training.run + "/config.json") + " ]; then\n";
  text += "  " + program + " " + shell_line(training.resume) + " &\nelse\n";
  text += "  " + program + " " + shell_line(training.begin) + " &\nfi\ntraining=$!";
  text += after_start;
  text += "if [ \"$status\" = " + code + " ]; then\n  scontrol requeue \"$SLURM_JOB_ID\" ||\n";
  text += "    echo \"the job was not requeued; submit this script again to go on\" >&2\nfi\nexit \"$status\"\n";
  return text;
}

}  // namespace graupel::train
