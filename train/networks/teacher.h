// A trained network whose predictions another one learns (distillation; Hinton, Vinyals and Dean 2015).
#pragma once

#include <memory>
#include <string>

#include "graph/features/feature_rules.h"
#include "train/config/train_config.h"
#include "train/networks/network_module.h"
#include "train/parallel/comm.h"

namespace graupel::train {

struct Teacher {
  std::string file;
  std::string hash;                         ///< of the file's bytes: file_hash()
  TrainConfig config;                       ///< of the run that learns, with the teacher's network
  graph::Normalization normalization = {};  ///< the teacher's own
  NetworkModule module;
};

/// 64-bit FNV-1a of a file's bytes, 16 hexadecimal digits. Throws InputError where there is no such file.
std::string file_hash(const std::string& file);

/// The network in `file` as the teacher of a run with the settings `student`. It may be of any architecture and size,
/// with inputs and a grid of its own. Null for "". Throws InputError for files that are no network; ConfigError where
/// its history or bundle differ from the student's, and where `student` has a share of no teacher.
std::unique_ptr<Teacher> read_teacher(const std::string& file, const TrainConfig& student, Device device);

/// Throws ConfigError on every rank where those of some ranks have other bytes than rank 0's: ranks open a file of one
/// name, which may be another one on another machine. Null where there is no teacher.
void check_equal_teachers(Comm& ranks, const Teacher* own);

}  // namespace graupel::train
