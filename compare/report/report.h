// The report: one self-contained HTML file with tables, curves, pictures and a 3-D particle player (WebGL2).
#pragma once

#include <cstddef>
#include <string>

#include "compare/comparison.h"

namespace graupel::compare {

inline constexpr std::size_t largest_report = std::size_t(25) << 20;  ///< [bytes]

/// The HTML text, at most `limit` bytes: player frames and then pictures are left out until it fits, and the page says
/// so. Throws ConfigError when the tables and curves alone are larger.
std::string report_html(Comparison comparison, std::size_t limit = largest_report);

/// Bytes that one picture row and one player track may take, so that `rows` of each fit into a report.
struct ReportBudget {
  std::size_t picture_pixels;  ///< of one picture of a row
  std::size_t track_bytes;
};
ReportBudget report_budget(std::size_t rows);

}  // namespace graupel::compare
