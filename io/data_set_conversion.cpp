#include "io/data_set_conversion.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/held_particles.h"
#include "io/converted_scene.h"
#include "io/data_set_input.h"
#include "io/gns_data_set.h"
#include "io/graupel_data_set.h"
#include "io/json_node.h"
#include "io/lagrangebench_data_set.h"
#include "io/motion_moments.h"
#include "io/particle_type_table.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

/// A folder that takes its name when all is in it, and is removed otherwise.
class AsideFolder {
 public:
  explicit AsideFolder(const std::string& target) : target_(fs::absolute(target).lexically_normal().string()) {
    while (target_.size() > 1 && target_.back() == '/') target_.pop_back();
    std::error_code code;
    const bool there = fs::exists(target_, code);
    if (there && !(fs::is_directory(target_, code) && fs::is_empty(target_, code)))
      throw ConfigError("'" + target + "' is there already and not empty. Name a new folder, or remove that one");
    path_ = target_ + "." + std::to_string(::getpid()) + ".part";
    make_folder(path_);
  }
  ~AsideFolder() {
    if (!finished_) remove_path(path_);
  }
  AsideFolder(const AsideFolder&) = delete;
  AsideFolder& operator=(const AsideFolder&) = delete;

  std::string file(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }
  void finish() {
    if (std::rename(path_.c_str(), target_.c_str()) != 0)
      throw IoError("cannot make '" + target_ + "' (" + std::strerror(errno) + "). Choose a folder you may write to");
    finished_ = true;
  }

 private:
  std::string target_, path_;
  bool finished_ = false;
};

Vec3d period_of(const SimulatorMetadata& metadata) {
  Vec3d period = Vec3d::zero();
  for (std::size_t axis = 0; axis < metadata.periodic.size(); ++axis)
    if (metadata.periodic[axis]) period[static_cast<int>(axis)] = metadata.bounds[axis][1] - metadata.bounds[axis][0];
  return period;
}

Vec3f position_at(const ParticleSeries& series, int64_t frame, int64_t particle) {
  const auto axes = static_cast<std::size_t>(series.dimensions);
  const auto first = static_cast<std::size_t>(frame * series.particles + particle) * axes;
  return {series.position[first], series.position[first + 1], axes == 3 ? series.position[first + 2] : 0.0f};
}

void check_positions(const ParticleSeries& series) {
  const auto bad =
      std::find_if_not(series.position.begin(), series.position.end(), [](float x) { return std::isfinite(x); });
  if (bad == series.position.end()) return;
  const int64_t place = (bad - series.position.begin()) / series.dimensions;
  throw InputError(series.where + " has a position that is not finite (frame " +
                   std::to_string(place / series.particles) + ", particle " + std::to_string(place % series.particles) +
                   "). Leave that run out");
}

/// Types of the series are ours.
MotionMoments motion_of(const ParticleSeries& series, const Vec3d& period) {
  MotionMoments out;
  for (int64_t t = 1; t < series.frames; ++t)
    for (int64_t p = 0; p < series.particles; ++p) {
      if (!moves_by_itself(static_cast<int32_t>(series.particle_type[static_cast<std::size_t>(p)]))) continue;
      const Vec3f x = position_at(series, t - 1, p);
      const Vec3d v = displacement(x, position_at(series, t, p), period);
      out.velocity.add(v);
      if (t >= 2) out.acceleration.add(v - displacement(position_at(series, t - 2, p), x, period));
    }
  return out;
}

MotionFigures figures_of(const MotionMoments& moments, int dimensions) {
  const auto axes = [&](const Vec3d& v) {
    std::vector<double> out = {v[0], v[1], v[2]};
    out.resize(static_cast<std::size_t>(dimensions));
    return out;
  };
  return {axes(moments.velocity.mean()), axes(moments.velocity.deviation()), axes(moments.acceleration.mean()),
          axes(moments.acceleration.deviation())};
}

class Conversion {
 public:
  explicit Conversion(const ConversionOptions& options)
      : options_(options),
        input_(open_data_set(options.input, options.splits, options.connectivity_radius)),
        table_(input_.format == DataSetFormat::graupel ? options.format : input_.format, options.types) {
    check_flags();
    for (const InputSplit& split : input_.splits) total_ += split.reader->count();
  }

  ConversionResult run() {
    AsideFolder folder(options_.output);
    for (const InputSplit& split : input_.splits) write_split(folder, split);
    write_metadata(folder);
    write_file_atomically(folder.file("dataset.json"), card());
    folder.finish();
    result_.from = input_.format;
    result_.with_obstacles = input_.with_obstacles;
    result_.connectivity_radius = input_.metadata.connectivity_radius;
    return std::move(result_);
  }

 private:
  void check_flags() const;
  ParticleSeries next(const InputSplit& split, int64_t i);
  void count(const std::string& split, const ParticleSeries& series);
  void number_types(ParticleSeries& series);
  void write_split(const AsideFolder& folder, const InputSplit& split);
  void write_metadata(const AsideFolder& folder) const;
  std::string card() const;

  const ConversionOptions& options_;
  DataSetInput input_;
  ParticleTypeTable table_;  ///< of the other program's format
  int64_t done_ = 0, total_ = 0;
  MotionMoments motion_;                       ///< of the split that counts
  std::map<int64_t, std::string> type_names_;  ///< of the output's numbers
  ConversionResult result_;
};

void Conversion::check_flags() const {
  const std::string from = word_of(input_.format), to = word_of(options_.format);
  if (input_.format == options_.format)
    throw ConfigError("'" + options_.input + "' is a data set of the format " + from +
                      " already. Choose another --format");
  if (!options_.set.empty() && options_.format != DataSetFormat::graupel)
    throw ConfigError("--set changes the scenes of our own data sets, and --format " + to + " has none. Leave it out");
  const auto& periodic = input_.metadata.periodic;
  if (options_.format == DataSetFormat::gns && std::find(periodic.begin(), periodic.end(), true) != periodic.end())
    throw InputError("'" + options_.input +
                     "' has periodic walls, which gns does not know. Convert to lagrangebench or graupel");
}

/// Trajectory i with the output's numbers of types, checked and counted.
ParticleSeries Conversion::next(const InputSplit& split, int64_t i) {
  ParticleSeries series = split.reader->read(i);
  if (series.dimensions != input_.metadata.dimensions)
    throw InputError(series.where + " has " + std::to_string(series.dimensions) +
                     " dimensions, metadata.json says dim " + std::to_string(input_.metadata.dimensions) +
                     ". Correct metadata.json");
  check_positions(series);
  if (input_.format != DataSetFormat::graupel) {
    const auto ours = table_.to_ours(series.particle_type, series.where);
    series.particle_type.assign(ours.begin(), ours.end());
  }
  count(split.name, series);
  number_types(series);
  if (options_.progress) options_.progress(++done_, total_);
  return series;
}

void Conversion::count(const std::string& split, const ParticleSeries& series) {
  SplitFigures& figures = result_.splits[split];
  figures.fewest_frames = figures.trajectories == 0 ? series.frames : std::min(figures.fewest_frames, series.frames);
  figures.most_frames = std::max(figures.most_frames, series.frames);
  figures.most_particles = std::max(figures.most_particles, series.particles);
  figures.material_property = figures.material_property || !series.material_property.empty();
  ++figures.trajectories;
  if (split == input_.splits.front().name) motion_.add(motion_of(series, period_of(input_.metadata)));
}

void Conversion::number_types(ParticleSeries& series) {
  if (options_.format == DataSetFormat::graupel) return;
  std::vector<int64_t> numbers;
  const std::vector<int32_t> ours(series.particle_type.begin(), series.particle_type.end());
  if (input_.format == DataSetFormat::graupel)
    numbers = table_.to_theirs(ours, series.where);
  else
    numbers = ParticleTypeTable(options_.format, "").to_theirs(ours, series.where);
  for (std::size_t p = 0; p < ours.size(); ++p) type_names_.emplace(numbers[p], particle_type_name(ours[p]));
  series.particle_type = std::move(numbers);
}

void Conversion::write_split(const AsideFolder& folder, const InputSplit& split) {
  const std::string file = folder.file(split_file(options_.format, split.name));
  const int64_t count = split.reader->count();
  const SeriesSource source = [&](int64_t i) { return next(split, i); };
  if (options_.format == DataSetFormat::graupel) {
    write_graupel_split(file, count, source, [&](const ParticleSeries& series) {
      OwnTrajectory own{converted_scene(input_.metadata, input_.format, series, options_.set),
                        std::string("converted from ") + word_of(input_.format)};
      if (!result_.scene) result_.scene = own.scene;
      return own;
    });
  } else if (options_.format == DataSetFormat::gns) {
    write_gns_split(file, count, source);
    sync_file(file);
  } else {
    write_lagrangebench_split(file, count, source);
    sync_file(file);
  }
}

/// Our own data sets have metadata of their training split alone, as those of `graupel generate`.
void Conversion::write_metadata(const AsideFolder& folder) const {
  if (options_.format == DataSetFormat::graupel) {
    if (result_.splits.contains("train"))
      write_data_set_metadata(folder.path(), *result_.scene, input_.metadata.connectivity_radius);
    return;
  }
  SimulatorMetadata metadata = input_.metadata;
  metadata.motion = figures_of(motion_, metadata.dimensions);
  write_file_atomically(folder.file("metadata.json"),
                        options_.format == DataSetFormat::gns
                            ? gns_metadata_text(metadata, result_.splits, type_names_)
                            : lagrangebench_metadata_text(metadata, result_.splits, type_names_));
}

/// dataset.json: where the data come from, and what was chosen.
std::string Conversion::card() const {
  JsonNode from = JsonNode::object();
  from.set("format", JsonNode::of(word_of(input_.format)));
  from.set("folder", JsonNode::of(fs::absolute(options_.input).lexically_normal().string()));
  JsonNode out = JsonNode::object();
  out.set("converted_from", std::move(from));
  out.set("format", JsonNode::of(word_of(options_.format)));
  if (!options_.types.empty()) out.set("types", JsonNode::of(options_.types));
  JsonNode changes = JsonNode::array();
  for (const std::string& change : options_.set) changes.items.push_back(JsonNode::of(change));
  if (!changes.items.empty()) out.set("set", std::move(changes));
  if (options_.format == DataSetFormat::graupel)
    out.set("initial_velocity", JsonNode::of("difference of the first two frames"));
  if (input_.with_obstacles > 0)
    out.set("trajectories_whose_obstacles_are_left_out", JsonNode::of(input_.with_obstacles));
  out.set("made_by", JsonNode::of(options_.made_by));
  return write_json(out, JsonLayout::indented);
}

}  // namespace

ConversionResult convert_data_set(const ConversionOptions& options) { return Conversion(options).run(); }

}  // namespace graupel::io
