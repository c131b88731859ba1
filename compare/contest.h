// Who won: every model against the strongest cheap rival, by how much, and where it falls behind first.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "compare/comparison.h"

namespace graupel::compare {

enum class Outcome { wins, level, loses };

/// A deciding metric over the scenes of a contest.
struct MetricContest {
  Outcome outcome = Outcome::level;  ///< level: within the noise floor, or better in as many scenes as worse
  double ratio = 1;                  ///< geometric mean of the error over the rival's, of the floor each at least
  double floor_ratio = 0;            ///< of the noise floor over the rival's error; 0 where it was not computed
};

/// Where a model falls behind: the first of three frames in a row in which both its position and its density error are
/// beyond the rival's, by more than the frame's floor and a twentieth of the rival's largest error; or where it
/// diverges.
struct FirstFailure {
  std::string scene;
  int64_t frame = 0;
  bool diverged = false;
};

/// A model against the cheap rival with the smallest errors on the model's scenes.
struct Contest {
  std::string model, rival;          ///< as in the tables; the same for the strongest rival itself
  bool is_rival = false;             ///< a coarse grid or a baseline, which others are held against
  Outcome outcome = Outcome::level;  ///< better, or worse, in two deciding metrics or more
  std::size_t scenes = 0, won = 0, lost = 0;
  std::map<std::string, MetricContest> metrics;  ///< by deciding metric
  double frame_ms = 0;                           ///< mean over the scenes that have one; 0 for what computes nothing
  std::optional<double> time_ratio;              ///< over the rival's time, by geometric mean; none where it takes none
  std::optional<double> mpm_ratio;               ///< over the time of mpm
  std::optional<FirstFailure> failure;           ///< the earliest of all scenes; never of the rival itself
  std::size_t outside_training = 0;              ///< scenes unlike those of the model's training
};

/// Of every model but the truth, then of rivals that ran without being asked for. Empty without rollouts.
std::vector<Contest> contests(const Comparison& comparison);
/// Those to speak of: of models that are no cheap rivals; where there are none, of the rivals among the models but the
/// strongest, or else of the strongest against the next.
std::vector<Contest> decisive_contests(const Comparison& comparison);
/// "hgn wins against mpm:coarse:fast, ...": who, by how much, at which time, and where it fails first.
std::string contest_sentence(const Contest& contest, const Comparison& comparison);
/// "sand_cone, frame 23", "sand_cone, diverged at frame 23", "nowhere".
std::string failure_text(const Contest& contest);
/// "position MSE" for a deciding metric.
const char* deciding_name(const std::string& key);
/// What is worth saying of the noise floors, as a sentence.
std::string floor_sentence(const Comparison& comparison);

}  // namespace graupel::compare
