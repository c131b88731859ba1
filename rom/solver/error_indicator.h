// Whether a reduced run may be trusted, told without the full model's run: what every frame shows of itself, over what
// the same frame showed in roll-outs of training runs,
//   number_f = max_i indicator_i(f) / usual_i(f),
// and a verdict: from a bound on the error where there is one (rom/interpolation_bound.h), else from the largest
// mean of the number over a few frames.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace graupel::rom {

/// How far a frame is from what the model knows.
struct ErrorIndicator {
  double residual = 0;         ///< distance that the inversion left over the distance that the samples moved, largest
  double down_weighted = 0;    ///< share of samples that did not fit the others, mean
  double latent_distance = 0;  ///< to the nearest training snapshot, over the reach of the training runs
};

/// What is usual in every frame, from the first one after the start; empty: unknown.
using TrustLevels = std::vector<ErrorIndicator>;

/// The largest of each indicator over the runs and the frames beside, and nowhere less than half of its median over
/// the frames; a latent as far as training runs are from one another (1) and 2 % of
/// down-weighted samples are usual. `runs`: frames of each.
TrustLevels usual_levels(const std::vector<std::vector<ErrorIndicator>>& runs);

enum class Verdict { unknown, ok, doubtful, do_not_trust };
const char* verdict_text(Verdict verdict);

/// The verdict on a run, frame by frame.
class ErrorIndicatorRecord {
 public:
  static constexpr int window = 5;                           ///< frames that are averaged: one frame alone tells little
  static constexpr double doubtful = 1.5, do_not_trust = 3;  ///< of the number
  /// Of errors over the displacement: of the bound on the run's own and, without one, of the largest error of training
  /// runs, as what is usual there is no better.
  static constexpr double doubtful_error = 0.05, failed_error = 0.2;
  /// Of the materials' difference from the training's, shares of the body: what makes the number 1.
  static constexpr double usual_material_difference = 0.005;

  /// `material_difference`: of the scene from the model's (rom/solver/material_difference.h).
  /// `training_error`: the largest of the training runs that the levels are of, over the displacement.
  explicit ErrorIndicatorRecord(TrustLevels usual, double material_difference = 0, double training_error = 0);
  /// The next frame, in the order of the run; frames beyond the levels are held against the last of them. Returns its
  /// number, 0 where the levels are unknown.
  double add(const ErrorIndicator& frame);
  /// The run's error so far is at most this, over the displacement; none: unknown.
  void set_bound(std::optional<double> bound) { bound_ = bound; }
  const std::optional<double>& bound() const { return bound_; }
  /// The scene is another one than the training's, whatever its parameters: nothing is known of it.
  void foreign_scene() { foreign_scene_ = true; }
  /// The run has ended in a failure.
  void diverged() { diverged_ = true; }

  double number() const { return largest_; }  ///< largest mean over the window
  Verdict verdict() const;

 private:
  TrustLevels usual_;
  double from_materials_, training_error_;
  std::vector<double> numbers_;
  double largest_ = 0;
  std::optional<double> bound_;
  bool foreign_scene_ = false, diverged_ = false;
};

}  // namespace graupel::rom
