// graupel convert: data sets of learned simulators from one format to another.
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/common_options.h"
#include "apps/progress.h"
#include "apps/verbs.h"
#include "core/command_line.h"
#include "core/error.h"
#include "io/data_set_conversion.h"

namespace graupel::apps {

namespace {

struct ConvertOptions {
  CommonOptions common;
  std::string input, output, format = "graupel", types;
  std::vector<std::string> splits, set;
  std::optional<double> connectivity_radius;
};

io::DataSetFormat format_named(const std::string& word) {
  for (const auto& [name, format] : EnumWords<io::DataSetFormat>::words)
    if (word == name) return format;
  throw ConfigError("--format '" + word + "' is not known (allowed: graupel, gns, lagrangebench). Use one of these");
}

nlohmann::ordered_json result_json(const ConvertOptions& options, const io::ConversionResult& result) {
  nlohmann::ordered_json splits;
  for (const auto& [name, split] : result.splits)
    splits[name] = {{"trajectories", split.trajectories},
                    {"most_frames", split.most_frames},
                    {"most_particles", split.most_particles}};
  return {{"output", options.output},
          {"from", word_of(result.from)},
          {"format", options.format},
          {"splits", splits},
          {"trajectories_whose_obstacles_are_left_out", result.with_obstacles}};
}

std::string split_list(const io::ConversionResult& result) {
  std::string text;
  for (const char* name : io::split_names)
    if (const auto found = result.splits.find(name); found != result.splits.end())
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", found->second.trajectories, name);
  return text;
}

void convert(ConvertOptions& options) {
  options.common.apply();
  std::optional<Progress> progress;
  io::ConversionOptions job;
  job.input = options.input;
  job.output = options.output;
  job.format = format_named(options.format);
  job.types = options.types;
  job.splits = options.splits;
  job.set = options.set;
  job.connectivity_radius = options.connectivity_radius;
  job.made_by = version_text();
  job.progress = [&](int64_t done, int64_t total) {
    stop_if_interrupted("; nothing was written");
    if (!progress) progress.emplace("convert", total);
    progress->update(done);
  };
  const io::ConversionResult result = io::convert_data_set(job);
  if (progress) progress->done();
  std::fprintf(stderr, "%s: %s trajectories, %s to %s\n", options.output.c_str(), split_list(result).c_str(),
               word_of(result.from), options.format.c_str());
  if (result.with_obstacles > 0)
    std::fprintf(stderr, "convert: the obstacles of %lld trajectories are left out (%s knows them as particles only)\n",
                 static_cast<long long>(result.with_obstacles), options.format.c_str());
  options.common.write_json(result_json(options, result));
}

}  // namespace

void add_convert(CLI::App& app) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* verb = app.add_subcommand("convert", "Convert data sets: ours, geoelements/gns, LagrangeBench");
  verb->add_option("input", options->input, "Folder of a data set; its files say which format it has")->required();
  verb->add_option("output", options->output, "Folder to make")->required();
  verb->add_option("-f,--format", options->format, "Format of the output: graupel, gns (.npz) or lagrangebench (.h5)")
      ->check(CLI::IsMember({"graupel", "gns", "lagrangebench"}))
      ->capture_default_str();
  verb->add_option("--types", options->types,
                   "Particle types of the other program: NUMBER=MATERIAL,..., or NUMBER=obstacle; the rest as below");
  verb->add_option("--split", options->splits, "Convert these alone: train,valid,test (default: all there are)")
      ->check(CLI::IsMember({"train", "valid", "test"}))
      ->delimiter(',')
      ->allow_extra_args(false);
  verb->add_option("--set", options->set,
                   "Change a key of the scenes that are made: --set gravity=[0,-9.8,0] --set domain.dx=0.02")
      ->allow_extra_args(false);
  verb->add_option("--connectivity-radius", options->connectivity_radius,
                   "Written to metadata.json for graph networks [m]; default the input's")
      ->check(real_number(LowerBound::above_zero));
  options->common.add_to(*verb);
  verb->footer(
      "Positions keep their bits. Types: gns 3 obstacle, 4 jelly, 5 water, 6 sand, 7 toothpaste (goop), 8 snow;\n"
      "lagrangebench 0 water, 1 obstacle (wall), 2 stationary (moving wall), 4 jelly, 6 sand, 7 toothpaste, 8 snow.\n"
      "Other programs' data have no scene: walls come from their bounds, gravity is 0 unless --set says otherwise.\n"
      "Their pickles are never executed. The output appears when all of it is written.\n\nExamples:\n"
      "  graupel convert data/hgn data/hgn-gns --format gns\n"
      "  graupel convert WaterDropSample data/water --set gravity=[0,-9.8,0]\n"
      "  graupel convert 3D_LDC_8160_10kevery100 data/ldc --types 2=obstacle --split train,valid");
  verb->callback([options] { convert(*options); });
}

}  // namespace graupel::apps
