// Files of a comparison: table, JSON, CSV, curves, and the report in a headless browser.
#include "compare/report/report.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "compare/comparison_files.h"
#include "compare/report/base64.h"
#include "compare/report/force_plots.h"
#include "compare/report/plot_svg.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/compare/synthetic_comparison.h"

namespace graupel::compare {
namespace {

/// Whether every tag of an XML text is closed, in order.
bool well_formed(const std::string& xml) {
  std::vector<std::string> open;
  const std::regex tag("<(/?)([a-z]+)([^>]*?)(/?)>");
  for (auto m = std::sregex_iterator(xml.begin(), xml.end(), tag); m != std::sregex_iterator(); ++m) {
    if ((*m)[4].length() > 0) continue;
    if ((*m)[1].length() == 0) {
      open.push_back((*m)[2]);
    } else {
      if (open.empty() || open.back() != (*m)[2]) return false;
      open.pop_back();
    }
  }
  return open.empty();
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size()) ++count;
  return count;
}

TEST(PlotSvg, DrawsEveryLineWithItsLabelEscaped) {
  Plot plot{.title = "a < b & c", .x_label = "frame", .y_label = "error", .y_axis = Axis::logarithmic, .lines = {}};
  plot.lines.push_back({"first <1>", {1, 2, 3}, {1e-3, 1e-2, 1e-1}});
  plot.lines.push_back({"second", {1, 2, 3}, {0, 1e-4, 1}, true});  // 0 cannot be shown on a logarithmic axis
  const std::string svg = plot_svg(plot);
  EXPECT_TRUE(well_formed(svg));
  EXPECT_NE(svg.find("first &lt;1&gt;"), std::string::npos);
  EXPECT_NE(svg.find("a &lt; b &amp; c"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_NE(svg.find("stroke-dasharray"), std::string::npos);
}

TEST(ForcePlots, ShowTheMostLoadedFirstAndNothingThatIsNotTouched) {
  EXPECT_TRUE(force_plots({}).empty());
  EXPECT_TRUE(force_plots({{"truth", {}}}).empty());
  ContactForces forces{{"obstacle_0", "obstacle_1", "wall_x_low"}, {}};
  for (int frame = 0; frame < 4; ++frame) {
    std::vector<ContactForce> on(3);
    on[1].force = {0, -4.0 * frame, 3.0 * frame};
    on[2].force = {7, 0, 0};
    forces.frames.push_back(on);
  }
  const std::vector<Plot> plots = force_plots({{"truth", forces}, {"network", {}}});
  ASSERT_EQ(plots.size(), 1u);  // there is no torque
  ASSERT_EQ(plots[0].lines.size(), 2u);
  EXPECT_EQ(plots[0].lines[0].label, "obstacle_1");
  EXPECT_EQ(plots[0].lines[0].y, (std::vector<double>{5, 10, 15}));
  EXPECT_EQ(plots[0].lines[0].x, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(plots[0].lines[1].label, "wall_x_low");
}

TEST(ForcePlots, RunsOfMpmStandBesideTheTruth) {
  ContactForces truth{{"obstacle_0", "wall_x_low"}, {}};
  for (int frame = 0; frame < 4; ++frame) {
    truth.frames.emplace_back(2);
    truth.frames.back()[1].force = {2.0 * frame, 0, 0};
  }
  ContactForces coarse = truth;
  coarse.frames.pop_back();  // it diverged
  const std::vector<Plot> plots = force_plots({{"truth", truth}, {"network", {}}, {"mpm:coarse", coarse}});
  ASSERT_EQ(plots.size(), 1u);
  EXPECT_EQ(plots[0].title, "Force on wall_x_low");
  ASSERT_EQ(plots[0].lines.size(), 2u);
  EXPECT_EQ(plots[0].lines[0].y, (std::vector<double>{2, 4, 6}));
  EXPECT_EQ(plots[0].lines[1].label, "mpm:coarse");
  EXPECT_EQ(plots[0].lines[1].y, (std::vector<double>{2, 4}));
}

TEST(PlotSvg, PlacesPointsByTheAxis) {
  Plot plot{.title = "", .x_label = "", .y_label = "", .lines = {}};
  plot.lines.push_back({"line", {0, 10}, {0, 5}});
  const std::string svg = plot_svg(plot);
  // Corners of the plotting area: left 62, bottom 280 - 40; right 390 - 14, top 30.
  EXPECT_NE(svg.find("M62.0 240.0L376.0 30.0"), std::string::npos) << svg;
}

TEST(PlotSvg, AFileOfItsOwnHasColoursOfItsOwn) {
  Plot plot{.title = "", .x_label = "", .y_label = "", .lines = {}};
  plot.lines.push_back({"line", {0, 10}, {0, 5}});
  EXPECT_EQ(plot_svg(plot).find("background"), std::string::npos);
  plot.standalone = true;
  EXPECT_NE(plot_svg(plot).find("style=\"background:#fff;color:#222\""), std::string::npos);
  EXPECT_TRUE(well_formed(plot_svg(plot)));
}

TEST(PlotSvg, EmptyPlotsAreStillPictures) {
  EXPECT_TRUE(well_formed(plot_svg({.title = "none", .x_label = "", .y_label = "", .lines = {}})));
  Plot zero{.title = "", .x_label = "", .y_label = "", .y_axis = Axis::logarithmic, .lines = {}};
  zero.lines.push_back({"all zero", {1, 2}, {0, 0}});
  EXPECT_EQ(plot_svg(zero).find("nan"), std::string::npos);
}

TEST(Base64, KnownAnswers) {
  EXPECT_EQ(encode_base64(""), "");
  EXPECT_EQ(encode_base64("f"), "Zg==");
  EXPECT_EQ(encode_base64("fo"), "Zm8=");
  EXPECT_EQ(encode_base64("foobar"), "Zm9vYmFy");
}

TEST(ShortNumber, ThreeSignificantDigits) {
  EXPECT_EQ(short_number(0), "0");
  EXPECT_EQ(short_number(0.0123456), "0.0123");
  EXPECT_EQ(short_number(12.3456), "12.3");
  EXPECT_EQ(short_number(4.5678e-6), "4.57e-06");
  EXPECT_EQ(short_number(1234.5), "1234");
}

TEST(PlayerTrack, PositionsSurviveQuantisation) {
  const Scene scene = unit_scene();
  const auto run = make_run(block(4, {0.2f, 0.2f, 0.2f}, 0.3f), std::vector<int32_t>(64, 5), 5, stay);
  const PlayerTrack track = make_track(scene, run, "truth", {64, 2});
  EXPECT_EQ(track.frames, (std::vector<int64_t>{0, 2, 4}));
  ASSERT_EQ(track.position.size(), 3u * 64 * 3);
  EXPECT_NEAR(track.position[5 * 3] / 65535.0, run.position(0)[5][0], 1e-5);
  const PlayerTrack few = make_track(scene, run, "truth", {10, 1});
  EXPECT_EQ(few.particles, 10u);
  EXPECT_EQ(few.all_particles, 64u);
  EXPECT_GT(few.radius, track.radius);
}

TEST(PlayerTrack, ThinningKeepsTheBudget) {
  const Thinning all = choose_thinning(1000, 60, 1 << 20);
  EXPECT_EQ(all.particles, 1000u);
  EXPECT_EQ(all.frame_stride, 1u);
  for (const std::size_t particles : {3000, 40000, 1000000})
    for (const std::size_t frames : {60, 300})
      for (const std::size_t budget : {50000, 1000000}) {
        const Thinning t = choose_thinning(particles, frames, budget);
        EXPECT_LE(t.particles * (frames / t.frame_stride + 1) * 6, budget) << particles << " " << frames;
        EXPECT_GT(t.particles * (frames / t.frame_stride + 1) * 6, budget / 4);
      }
}

TEST(PlayerObstacles, PointsLieOnTheSurface) {
  const Scene scene = scene_with_sphere();
  const PlayerObstacles points = make_player_obstacles(scene, sparsegrid::ObstacleSet(scene), 3000);
  const std::size_t n = points.position.size() / 3;
  ASSERT_GT(n, 500u);
  ASSERT_LE(n, 3000u);
  for (std::size_t i = 0; i < n; ++i) {
    Vec3d x;
    for (int d = 0; d < 3; ++d) x[d] = points.position[3 * i + static_cast<std::size_t>(d)] / 65535.0;
    EXPECT_NEAR(norm(x - scene.obstacles[0].position), 0.15, 0.1 * scene.domain.dx);
  }
}

TEST(ComparisonFiles, JsonHoldsEveryKeyForEverySceneAndModel) {
  Comparison comparison = synthetic_comparison(2);
  EXPECT_TRUE(incomplete_results(comparison).empty());
  comparison.scenes[1].models[1].diverged_at_frame = 7;
  const auto json = comparison_json(comparison);
  ASSERT_EQ(json["results"].size(), 4u);
  for (const auto& entry : json["results"]) {
    for (const MetricInfo& metric : metric_list()) EXPECT_TRUE(entry.at(metric.key).is_number()) << metric.key;
    for (const char* material : {"water", "sand"})
      for (const MetricInfo& metric : material_metric_list())
        EXPECT_TRUE(entry.at("materials").at(material).at(metric.key).is_number()) << metric.key;
  }
  EXPECT_FALSE(json["results"][0].contains("diverged_at_frame"));
  EXPECT_EQ(json["results"][3]["diverged_at_frame"], 7);
  EXPECT_NE(comparison_table(comparison).find("diverged at frame 7"), std::string::npos);
}

TEST(ComparisonFiles, DivergedReferencesAreMarked) {
  Comparison comparison = synthetic_comparison(2);
  EXPECT_EQ(comparison_table(comparison).find("reference runs"), std::string::npos);
  comparison.scenes[1].diverged_references = {{"moved", 9}, {"mpm:coarse", 4}};
  const auto json = comparison_json(comparison);
  EXPECT_FALSE(json["scenes"][0].contains("diverged_references"));
  EXPECT_EQ(json["scenes"][1]["diverged_references"]["mpm:coarse"], 4);
  const std::string mark = "moved diverged at frame 9; mpm:coarse diverged at frame 4";
  EXPECT_NE(comparison_table(comparison).find(mark), std::string::npos);
  EXPECT_NE(report_html(comparison).find(mark), std::string::npos);
}

TEST(ComparisonFiles, IncompleteResultsAreNamed) {
  Comparison comparison = synthetic_comparison();
  comparison.scenes[0].models[0].values.erase("sinkhorn");
  comparison.scenes[0].models[1].values["front_error"] = std::nan("");
  EXPECT_EQ(incomplete_results(comparison),
            (std::vector<std::string>{"sinkhorn of mpm in falling 0",
                                      "front_error of models/<net>.safetensors in falling 0"}));
}

TEST(ComparisonFiles, CsvHasOneRowForEachResultAndEqualColumns) {
  const std::string csv = comparison_csv(synthetic_comparison(2));
  EXPECT_EQ(count_of(csv, "\n"), 5u);
  std::size_t columns = 0;
  for (std::size_t start = 0; start < csv.size();) {
    const std::size_t end = csv.find('\n', start);
    const std::size_t commas = count_of(csv.substr(start, end - start), ",");
    if (columns == 0) columns = commas;
    EXPECT_EQ(commas, columns);
    start = end + 1;
  }
}

TEST(ComparisonFiles, ShortNamesTellModelsApart) {
  const std::vector<std::string> models = {"mpm", "runs/a/weights.safetensors", "runs/b/weights.safetensors",
                                           "weights.safetensors", "/models/hgn.safetensors"};
  EXPECT_EQ(short_name(models[0], models), "mpm");
  EXPECT_EQ(short_name(models[1], models), "a/weights.safetensors");
  EXPECT_EQ(short_name(models[2], models), "b/weights.safetensors");
  EXPECT_EQ(short_name(models[3], models), "weights.safetensors");
  EXPECT_EQ(short_name(models[4], models), "hgn.safetensors");
}

TEST(ComparisonFiles, TableFitsATerminal) {
  const std::string table = comparison_table(synthetic_comparison(2));
  EXPECT_NE(table.find("mean of 2 scenes"), std::string::npos);
  EXPECT_NE(table.find("(chaos floor)"), std::string::npos);
  for (std::size_t start = 0; start < table.size(); start = table.find('\n', start) + 1)
    EXPECT_LE(table.find('\n', start) - start, 120u);
}

TEST(ComparisonFiles, CategoriesHaveATableEverywhere) {
  Comparison comparison = synthetic_comparison(3);
  comparison.scenes[0].category = comparison.scenes[2].category = "stream";
  comparison.scenes[1].category = "moving_obstacle";
  const std::string table = comparison_table(comparison), html = report_html(comparison);
  for (const std::string row : {"stream (2)", "moving_obstacle (1)", "all (3)"}) {
    EXPECT_NE(table.find(row), std::string::npos) << row;
    EXPECT_NE(html.find("<td>" + row + ","), std::string::npos) << row;
  }
  for (std::size_t start = 0; start < table.size(); start = table.find('\n', start) + 1)
    EXPECT_LE(table.find('\n', start) - start, 120u);
  const auto json = comparison_json(comparison);
  EXPECT_EQ(json["categories"]["stream"]["scenes"], 2);
  EXPECT_TRUE(json["categories"]["stream"]["geometric_mean"]["mpm"].contains("ratio_sinkhorn"));
  const std::string sentence = json["headline"];
  EXPECT_EQ(sentence.find("Against mpm:coarse:fast on 3 scenes, "), 0u);
  const std::string verdict = json["verdicts"][0]["sentence"];
  EXPECT_NE(table.find(verdict.substr(0, 60)), std::string::npos);
  EXPECT_NE(html.find(escape_markup(verdict)), std::string::npos);
  EXPECT_EQ(comparison_table(synthetic_comparison(3)).find("by category"), std::string::npos);
  comparison.groups = {MetricGroup::one_step};
  EXPECT_EQ(comparison_table(comparison).find("by category"), std::string::npos);
  EXPECT_EQ(report_html(comparison).find("<h2>Categories"), std::string::npos);
}

TEST(Report, HoldsTablesCurvesPicturesAndCommand) {
  const std::string html = report_html(synthetic_comparison());
  for (const MetricInfo& metric : metric_list())
    EXPECT_NE(html.find("<code>" + metric.key), std::string::npos) << metric.key;
  EXPECT_EQ(count_of(html, "<svg "), 3u);
  EXPECT_EQ(count_of(html, "data:image/png;base64,"), 2u);  // the truth is mpm: once
  EXPECT_NE(html.find("--models mpm,&lt;b&gt;&amp;&quot;c&quot;"), std::string::npos);
  EXPECT_EQ(html.find("<net>"), std::string::npos);  // names are escaped in text and in the player's data
  for (const char* link : {"src=\"http", "href=\"http", "url(", "@import", "fetch("})
    EXPECT_EQ(html.find(link), std::string::npos) << link;  // self-contained
}

TEST(Report, SaysWhoWonFirstThenPicturesThenTables) {
  Comparison comparison = synthetic_comparison(2);
  comparison.scenes[0].models[1].remarks = {"outside the training: sand.friction_angle is 50"};
  for (SceneResult& scene : comparison.scenes) scene.models[1].values["frame_ms"] = 0.5;
  comparison.offline["models/<net>.safetensors"] = {1.0, 2.0, {}};
  const std::string html = report_html(comparison);
  std::size_t before = 0;
  for (const char* part :
       {"<h1>", "class=\"verdict", "id=\"summary\"", "noise floor", "<h2>falling 0", "data:image/png", "<svg ",
        "id=\"player\"", "id=\"tables\"", "Mean of 2 scenes", "When a model pays", "id=\"made\""}) {
    const std::size_t at = html.find(part, before);
    ASSERT_NE(at, std::string::npos) << part;
    before = at;
  }
  const std::string body = html.substr(html.find("<body>"));
  EXPECT_LT(body.find("outside its training in 1 of 2 scenes"), body.find("<h2>falling 0"));
  EXPECT_NE(body.find("(outside its training)"), std::string::npos);  // in the curves
  EXPECT_NE(body.find("noise floor: another seed"), std::string::npos);
  EXPECT_EQ(body.find("largest stable step (searched"), std::string::npos);  // mpm:fast was not asked for
  EXPECT_EQ(body.find("position_<wbr>mse_<wbr>20"), std::string::npos) << "headings are words";
  EXPECT_NE(body.find("position MSE, 20 frames [m\u00b2] &darr;"), std::string::npos);
}

TEST(Report, IsWellFormed) {
  std::string html = report_html(synthetic_comparison(2));
  html = std::regex_replace(html.substr(html.find("<body>")), std::regex("<(img|wbr|input)[^>]*>"), "");
  for (std::size_t from; (from = html.find("<script")) != std::string::npos;)  // not markup
    html.erase(from, html.find("</script>", from) + 9 - from);
  html = std::regex_replace(html, std::regex("<h([1-4])( [^>]*)?>"), "<h>");
  html = std::regex_replace(html, std::regex("</h[1-4]>"), "</h>");
  html.erase(html.rfind("</html>"));
  EXPECT_TRUE(well_formed(html));
}

TEST(Report, IsThinnedToItsLimit) {
  const Comparison comparison = synthetic_comparison(6);
  const std::size_t whole = report_html(comparison).size();
  const std::string thinner = report_html(comparison, whole - 1000);
  EXPECT_LE(thinner.size(), whole - 1000);
  EXPECT_EQ(thinner.find("Pictures left out"), std::string::npos);  // frames of the player go first
  Comparison bare = comparison;
  for (SceneResult& scene : bare.scenes) {
    scene.picture.clear();
    while (halve_frames(scene.truth)) continue;
    for (ModelResult& result : scene.models) {
      result.picture.clear();
      while (halve_frames(result.track)) continue;
    }
  }
  const std::size_t smallest = report_html(bare).size();
  ASSERT_LT(smallest, whole);
  const std::string thin = report_html(comparison, smallest);
  EXPECT_LE(thin.size(), smallest);
  EXPECT_NE(thin.find("Pictures left out"), std::string::npos);
  EXPECT_THROW(report_html(comparison, 1000), ConfigError);
}

/// Runs headless Chromium on a page; `more` are further arguments. The exit status is not used: the output tells.
void run_browser(const std::string& folder, const std::string& more) {
  const std::string command =
      "timeout 150 chromium --headless --no-sandbox --disable-gpu-sandbox --use-angle=swiftshader "
      "--enable-unsafe-swiftshader --hide-scrollbars --window-size=1280,1000 "
      "--enable-logging=stderr --user-data-dir='" +
      folder + "/profile' " + more + " 'file://" + folder + "/report.html' > '" + folder + "/dom.html' 2> '" + folder +
      "/log.txt'";
  if (std::system(command.c_str()) != 0) std::fputs("chromium ended with an error\n", stderr);
}

TEST(Report, DrawsInABrowserWithoutConsoleErrors) {
  if (std::system("command -v chromium > /dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
  std::string folder = std::filesystem::temp_directory_path() / "graupel_report_XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  write_file_atomically(folder + "/report.html", report_html(synthetic_comparison()));

  run_browser(folder, "--dump-dom --screenshot='" + folder + "/page.png'");
  const std::string dom = read_file(folder + "/dom.html"), log = read_file(folder + "/log.txt");
  std::smatch drawn;
  ASSERT_TRUE(std::regex_search(dom, drawn, std::regex("data-player=\"drawn ([0-9]+) ([0-9]+)\""))) << log;
  EXPECT_GT(std::stoi(drawn[1]), 2000);  // pixels of the truth's side
  EXPECT_GT(std::stoi(drawn[2]), 2000);  // and of the model's
  EXPECT_EQ(dom.find("data-error"), std::string::npos);
  EXPECT_EQ(log.find("CONSOLE"), std::string::npos) << log;
  std::filesystem::remove_all(folder);
}

/// Width of the page beyond a screen of 390 pixels, as a script in it finds it.
TEST(Report, FitsAPhone) {
  if (std::system("command -v chromium > /dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
  std::string folder = std::filesystem::temp_directory_path() / "graupel_report_XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  write_file_atomically(folder + "/page.html", report_html(synthetic_comparison(2)));
  write_file_atomically(folder + "/report.html",
                        "<iframe src=\"page.html\" width=\"390\" height=\"844\" onload=\"document.title = 'beyond ' + "
                        "(contentDocument.documentElement.scrollWidth - 390)\"></iframe>");
  run_browser(folder, "--allow-file-access-from-files --dump-dom");
  const std::string dom = read_file(folder + "/dom.html");
  std::smatch beyond;
  ASSERT_TRUE(std::regex_search(dom, beyond, std::regex("<title>beyond (-?[0-9]+)"))) << dom;
  EXPECT_LE(std::stoi(beyond[1]), 0);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace graupel::compare
