#include "train/networks/teacher.h"

#include <cmath>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "graph/features/normalization.h"
#include "nn/weights.h"

namespace graupel::train {

namespace {

TrainConfig with_network(TrainConfig config, const NetworkConfig& network) {
  config.architecture = architecture_of(network);
  if (const auto* gns = std::get_if<graph::GnsConfig>(&network))
    config.gns = *gns;
  else
    config.hgn = std::get<graph::HgnConfig>(network);
  return config;
}

void check_frames(const std::string& file, const TrainConfig& teacher, const TrainConfig& student) {
  const auto check = [&](const char* name, int64_t theirs, int64_t ours) {
    if (theirs != ours)
      throw ConfigError("'" + file + "' has " + name + " " + std::to_string(theirs) + ", the network that learns " +
                        std::to_string(ours) + " (a teacher's must be equal). Set " + word_of(student.architecture) +
                        "." + name + "=" + std::to_string(theirs) + ", or take another teacher");
  };
  check("history", teacher.features().history, student.features().history);
  check("bundle", teacher.features().bundle, student.features().bundle);
}

}  // namespace

std::string file_hash(const std::string& file) { return fnv1a_digits(read_file(file)); }

std::unique_ptr<Teacher> read_teacher(const std::string& file, const TrainConfig& student, Device device) {
  if (file.empty()) {
    if (student.teacher_share == TrainConfig().teacher_share) return nullptr;
    throw ConfigError("teacher_share is set (" + std::to_string(student.teacher_share) +
                      "), but there is no teacher. Name its weights by --teacher, or leave teacher_share out");
  }
  const nn::Weights weights = nn::read_safetensors(file);
  const TrainConfig config = with_network(student, network_config_of(weights));
  check_frames(file, config, student);
  auto teacher = std::make_unique<Teacher>(Teacher{
      .file = file,
      .hash = file_hash(file),
      .config = config,
      .normalization = graph::read_normalization(weights),
      .module = NetworkModule(config.network(), device, 0, config.mixed_precision ? NumberType::mixed : NumberType::f32,
                              config.checkpoint_layers)});
  teacher->module.set_state(StateArray::weights, weights);
  return teacher;
}

void check_equal_teachers(Comm& ranks, const Teacher* own) {
  const std::string hash = own != nullptr ? own->hash : "none", first = broadcast_text(ranks, hash);
  const double others = sum_over_ranks(ranks, {hash == first ? 0.0 : 1.0}).front();
  if (others == 0) return;
  throw ConfigError("rank " + std::to_string(ranks.rank()) + " of " + std::to_string(ranks.size()) + ": the teacher '" +
                    (own != nullptr ? own->file : "") + "' has the hash " + hash + ", that of rank 0 " + first +
                    " (ranks with another: " + std::to_string(std::lround(others)) +
                    ", allowed: none). Copy rank 0's file to every machine");
}

}  // namespace graupel::train
