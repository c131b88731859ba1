// A comparison as JSON, CSV and a table for the terminal. docs/reference/metrics.md describes the files.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "compare/comparison.h"

namespace graupel::compare {

/// A metric in a table, with a title of at most 8 characters for the terminal.
struct Column {
  const char* key;
  const char* title;
};
/// Of the table of geometric means by category.
inline constexpr Column category_columns[] = {{"frame_ms", "ms/frame"},
                                              {"position_mse_all", "MSE all"},
                                              {"sinkhorn", "sinkhorn"},
                                              {"density_error", "density"},
                                              {"ratio_position_mse_all", "r. MSE"},
                                              {"ratio_sinkhorn", "r. sink."},
                                              {"ratio_density_error", "r. dens."},
                                              {"ratio_frame_ms", "r. time"}};

nlohmann::ordered_json comparison_json(const Comparison& comparison);
/// One row a scene and model; columns scene, model, role, verdict, trust_number, error_bound, diverged_at_frame, every
/// metric, "<material>.<metric>".
std::string comparison_csv(const Comparison& comparison);
/// Main metrics, a block a scene and one of means, at most 120 columns wide.
std::string comparison_table(const Comparison& comparison);

/// Three significant digits: "0.0123", "4.56e-06", "1230".
std::string short_number(double value);

}  // namespace graupel::compare
