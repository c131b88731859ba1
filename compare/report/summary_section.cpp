#include "compare/report/summary_section.h"

#include <fmt/format.h>

#include <algorithm>

#include "compare/comparison_files.h"
#include "compare/contest.h"
#include "compare/deciding_metrics.h"
#include "compare/report/plot_svg.h"

namespace graupel::compare {

namespace {

constexpr std::size_t most_verdicts = 4;  ///< more are in the table alone, which the first screen must hold

const char* style_of(Outcome outcome) {
  return outcome == Outcome::wins ? "wins" : outcome == Outcome::loses ? "loses" : "level";
}

std::string ratio_cell(const MetricContest& metric, bool is_rival_itself) {
  if (is_rival_itself) return "<td>1</td>";
  return fmt::format("<td class=\"{}\">{}</td>", style_of(metric.outcome), short_number(metric.ratio));
}

std::string optional_cell(const std::optional<double>& value) {
  return "<td>" + (value ? short_number(*value) : std::string("-")) + "</td>";
}

/// "wins", or what the row is.
std::string verdict_cell(const Contest& contest) {
  if (contest.model == contest.rival) return "<td class=\"text\">strongest cheap rival</td>";
  std::string text = contest.is_rival ? "cheap rival" : style_of(contest.outcome);
  if (contest.scenes > 1 && !contest.is_rival) text += fmt::format(" ({}:{})", contest.won, contest.lost);
  return fmt::format("<td class=\"text{}{}\">{}</td>", contest.is_rival ? "" : " ",
                     contest.is_rival ? "" : style_of(contest.outcome), text);
}

std::string row_of(const Contest& contest, const Comparison& comparison, const std::string& common_rival) {
  const bool itself = contest.model == contest.rival;
  std::string row =
      fmt::format("<tr{}><td title=\"{}\">{}", contest.is_rival ? " class=\"floor\"" : "", escape_markup(contest.model),
                  escape_markup(short_name(contest.model, models_of(comparison))));
  if (contest.outside_training > 0)
    row += fmt::format("<div class=\"mark\">outside its training in {} of {} scenes</div>", contest.outside_training,
                       contest.scenes);
  if (!itself && contest.rival != common_rival)
    row += "<div class=\"note\">against " + escape_markup(contest.rival) + "</div>";
  row += "</td>" + verdict_cell(contest);
  for (const char* key : deciding_metrics) row += ratio_cell(contest.metrics.at(key), itself);
  row += "<td>" + (contest.frame_ms > 0 ? short_number(contest.frame_ms) : std::string("-")) + "</td>";
  row += optional_cell(contest.time_ratio) + optional_cell(contest.mpm_ratio);
  return row + "<td class=\"text\">" + (itself ? "-" : escape_markup(failure_text(contest))) + "</td></tr>\n";
}

std::string floor_row(const Contest& of) {
  std::string row = "<tr class=\"floor\"><td>noise floor (MPM against itself)</td><td class=\"text\">below: a tie</td>";
  for (const char* key : deciding_metrics) row += "<td>" + short_number(of.metrics.at(key).floor_ratio) + "</td>";
  return row + "<td>-</td><td>-</td><td>-</td><td class=\"text\">-</td></tr>\n";
}

std::string truth_row(const Comparison& comparison) {
  double time = 0;
  for (const SceneResult& scene : comparison.scenes)
    time += scene.mpm_frame_ms / static_cast<double>(comparison.scenes.size());
  const bool stored = comparison.scenes.front().stored_truth;
  return fmt::format(
      "<tr class=\"floor\"><td>{}</td><td class=\"text\">the truth</td><td>0</td><td>0</td><td>0</td><td>{}</td>"
      "<td>-</td><td>{}</td><td class=\"text\">-</td></tr>\n",
      stored ? "the file" : "mpm", stored ? "-" : short_number(time), stored ? "-" : "1");
}

std::string header(const std::string& rival) {
  return "<thead><tr><th>model</th><th class=\"text\">verdict</th><th title=\"mean squared distance to the true "
         "particles, over that of the rival\">position MSE &divide; rival &darr;</th><th title=\"how far mass must be "
         "moved to be where it should, over that of the rival\">Sinkhorn &divide; rival &darr;</th><th "
         "title=\"relative "
         "L1 error of the density grid, over that of the rival\">density error &divide; rival &darr;</th><th "
         "title=\"median time of a frame, mean over the scenes\">a frame [ms] &darr;</th><th>time &divide; rival "
         "&darr;</th><th>time &divide; mpm &darr;</th><th class=\"text\" title=\"first of three frames in a row in "
         "which position and density error are both clearly beyond those of " +
         escape_markup(rival) + "\">falls behind first</th></tr></thead>\n";
}

}  // namespace

std::string summary_section(const Comparison& comparison) {
  std::vector<Contest> rows = contests(comparison);
  if (rows.empty()) return "";
  std::string html = "<div id=\"verdicts\">\n";
  const std::vector<Contest> decisive = decisive_contests(comparison);
  for (std::size_t k = 0; k < std::min(decisive.size(), most_verdicts); ++k)
    html += fmt::format("<p class=\"verdict {}\">{}</p>\n", style_of(decisive[k].outcome),
                        escape_markup(contest_sentence(decisive[k], comparison)));
  if (decisive.size() > most_verdicts)
    html += fmt::format("<p class=\"soft\">{} more are in the table.</p>\n", decisive.size() - most_verdicts);
  html += "<p class=\"soft\">" + escape_markup(floor_sentence(comparison)) + "</p>\n</div>\n";
  const std::string rival = rows.back().rival;  // of a rival that ran in all scenes
  std::stable_partition(rows.begin(), rows.end(), [](const Contest& contest) { return !contest.is_rival; });
  html +=
      "<div class=\"scroll\" id=\"summary\"><table>" + header(short_name(rival, models_of(comparison))) + "<tbody>\n";
  for (const Contest& row : rows) html += row_of(row, comparison, rival);
  if (computed(comparison, MetricGroup::floors)) html += floor_row(rows.back());
  return html + truth_row(comparison) + "</tbody></table></div>\n";
}

}  // namespace graupel::compare
