// Reduced-order models beside full order, its cheaper forms, networks and baselines: error, time and memory, as a table
// of a scene and a sentence a model.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/comparison.h"

namespace graupel::compare {

/// A column of the table; `scale` times the metric is shown.
struct ReducedColumn {
  const char* key;
  const char* title;
  double scale;
};
inline constexpr ReducedColumn reduced_columns[] = {{"displacement_relative_error", "displ. %", 100},
                                                    {"delta", "delta %", 100},
                                                    {"frame_ms", "ms/frame", 1},
                                                    {"speed_ratio", "speed", 1},
                                                    {"model_memory_mib", "MiB", 1}};

/// Whether a reduced-order model was rolled out in the scene, which then has a table.
bool has_reduced_model(const SceneResult& scene);
/// The value of a column in a row, of three digits; "-" where it was not computed.
std::string reduced_cell(const ModelResult& result, const ReducedColumn& column);
/// "ok (0.98; 1.1 %)" for a model that judges itself, with the number and the largest error of training runs, and
/// ", pull 0.1" where its steps go part of the way to the training runs; empty for others.
std::string trust_text(const ModelResult& result);
/// What the columns mean, a sentence; with what is left out.
std::string reduced_legend(const Comparison& comparison);

/// For each reduced-order model whom it beats and who beats it in error, time and memory, by means over the scenes that
/// it was run on, and its verdict on itself.
std::vector<std::string> reduced_sentences(const Comparison& comparison);

}  // namespace graupel::compare
