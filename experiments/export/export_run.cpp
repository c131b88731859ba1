#include "experiments/export/export_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "compare/metrics/particle_run.h"
#include "compare/pictures/png.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "core/system/output_files.h"
#include "experiments/data/particle_sizes.h"
#include "experiments/data/stored_scene.h"
#include "experiments/export/film.h"
#include "experiments/export/force_table.h"
#include "experiments/export/frame_range.h"
#include "experiments/export/other_frames.h"
#include "experiments/export/run_pictures.h"
#include "experiments/process/input_file.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "io/export/export.h"
#include "io/export/export_frames.h"
#include "io/trajectory/input_files.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

namespace {

const std::vector<std::string> picture_formats = {"png", "gif", "mp4"};
const std::string force_format = "csv";

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::string listed(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, ", ")); }

std::vector<io::SurfaceBody> surface_bodies(const ExportRequest& request, const StoredScene& stored,
                                            const std::vector<float>& sizes, const Trajectory& header) {
  if (stored.best() != nullptr && stored.best()->domain.is_plane())
    throw ConfigError("'" + request.input + "' has 2 dimensions, surfaces are for 3. Leave --surface out");
  if (sizes.empty() && !request.radius)
    throw ConfigError("the size of the particles in '" + request.input + "' is not known (" + stored.problem +
                      "). Give it by --radius, 1.5 times their spacing");
  std::vector<io::SurfaceBody> bodies = io::surface_bodies(header.particle_type, header.materials, {});
  for (io::SurfaceBody& body : bodies) {
    body.settings =
        io::default_surface_settings(sizes.empty() ? *request.radius / 1.5 : widest_size(sizes, header, body));
    body.settings.radius = request.radius.value_or(body.settings.radius);
    body.settings.voxel = request.voxel.value_or(body.settings.voxel);
    body.settings.smoothing = request.smoothing.value_or(body.settings.smoothing);
    io::check_surface_settings(body.settings);
  }
  return bodies;
}

/// What a frame is written to.
class Sink {
 public:
  virtual ~Sink() = default;
  virtual void write(int64_t frame, const io::PointFrame& points) = 0;
  virtual void finish() = 0;
};

class PointSink : public Sink {
 public:
  PointSink(const std::string& format, const io::ExportTarget& target)
      : writer_(io::make_point_writer(format, target)) {}
  void write(int64_t frame, const io::PointFrame& points) override { writer_->write(frame, points); }
  void finish() override { writer_->finish(); }

 private:
  std::unique_ptr<io::PointWriter> writer_;
};

class SurfaceSink : public Sink {
 public:
  SurfaceSink(const std::string& format, const io::ExportTarget& target, std::vector<io::SurfaceBody> bodies)
      : writer_(io::make_surface_writer(format, target)), bodies_(std::move(bodies)) {}
  void write(int64_t frame, const io::PointFrame& points) override {
    writer_->write(frame, points.time, io::surfaces_of(points, bodies_, fmt::format("frame {}", frame)));
  }
  void finish() override { writer_->finish(); }

 private:
  std::unique_ptr<io::SurfaceWriter> writer_;
  std::vector<io::SurfaceBody> bodies_;
};

/// Single pictures, or a film of them.
class PictureSink : public Sink {
 public:
  PictureSink(const ExportRequest& request, const io::ExportTarget& target, const StoredScene& stored)
      : target_(target) {
    if (!stored.whole)
      throw ConfigError("pictures of '" + request.input + "' need its scene (" + stored.problem +
                        "). Choose a format of particles: " + listed(io::point_formats()));
    const int width = request.width.value_or(default_width), height = request.height.value_or(default_height);
    if (width % 2 != 0 || height % 2 != 0)
      throw ConfigError(
          fmt::format("pictures of {} x {} pixels cannot be a film (allowed: even numbers). Change --width "
                      "or --height",
                      width, height));
    if (request.format != "png") check_film_program(request.format);
    io::prepare_export(target);
    if (request.format != "png")
      film_ =
          std::make_unique<Film>(target.folder + "/" + target.name + "." + request.format, request.format,
                                 request.rate.value_or(std::clamp(1 / target.frame_time, 1.0, 60.0)), width, height);
    pictures_ = std::make_unique<RunPictures>(*stored.whole, target.point_size, width, height);
  }
  void write(int64_t frame, const io::PointFrame& points) override {
    const compare::Image picture = pictures_->draw(frame, points);
    if (film_)
      film_->add(picture);
    else
      write_file_atomically(io::frame_file(target_, frame, ".png"), compare::encode_png(picture));
  }
  void finish() override {
    if (film_) film_->finish();
  }

 private:
  io::ExportTarget target_;
  std::unique_ptr<Film> film_;
  std::unique_ptr<RunPictures> pictures_;
};

void check_format(const ExportRequest& request) {
  if (!request.surface && request.format == force_format) return;
  if (request.surface && !contains(io::surface_formats(), request.format))
    throw ConfigError("surfaces are not written as '" + request.format + "' (allowed with --surface: " +
                      listed(io::surface_formats()) + "). Choose one of these, or leave --surface out");
  if (!request.surface && !contains(io::point_formats(), request.format) && !contains(picture_formats, request.format))
    throw ConfigError("particles are not written as '" + request.format + "' (allowed: " + listed(io::point_formats()) +
                      "; pictures: " + listed(picture_formats) +
                      "; forces: csv). Choose one of these, or add --surface");
}

/// Whether the files of particles hold their sizes.
bool stores_sizes(const ExportRequest& request) {
  return !request.surface && contains({"bgeo", "usda"}, request.format);
}
bool shows_sizes(const ExportRequest& request) {
  return request.surface || stores_sizes(request) || contains(picture_formats, request.format);
}

/// What is written, in the plural.
const char* written_things(const ExportRequest& request) {
  if (request.surface) return "surfaces";
  if (request.format == force_format) return "forces";
  if (request.format == "png") return "pictures";
  return contains(picture_formats, request.format) ? "films" : "particles";
}

/// Flags that would have no effect.
void check_flags_fit(const ExportRequest& request) {
  const auto refuse = [&](const char* flag, const char* things, const char* remedy) {
    throw ConfigError(fmt::format("{} is for {}, and {} are written. {}, or leave {} out", flag, things,
                                  written_things(request), remedy, flag));
  };
  const char* of_surfaces = request.radius      ? "--radius"
                            : request.voxel     ? "--voxel"
                            : request.smoothing ? "--smoothing"
                                                : nullptr;
  if (!request.surface && of_surfaces != nullptr) refuse(of_surfaces, "surfaces", "Add --surface");
  const bool draws = !request.surface && contains(picture_formats, request.format);
  if (request.width && !draws) refuse("--width", "pictures", "Choose --format png, gif or mp4");
  if (request.height && !draws) refuse("--height", "pictures", "Choose --format png, gif or mp4");
  if (request.rate && (!draws || request.format == "png")) refuse("--rate", "films", "Choose --format gif or mp4");
  if (!request.name.empty() && request.format == force_format) refuse("--name", "frames", "Name the file by --output");
}

/// Files that begin with '.' are hidden.
void check_name(const std::string& name) {
  if (name.starts_with('.') || io::as_file_name(name) != name)
    throw ConfigError("--name '" + name +
                      "' cannot name exported files (allowed: letters, digits, '.', '_', '-', no '.' at the "
                      "beginning). Choose another");
}

/// The input's name with '_' for what cannot be in names of exported files.
std::string name_from(const std::string& input) {
  std::string name = io::as_file_name(std::filesystem::path(input).stem().string());
  if (name.starts_with('.')) name.front() = '_';
  return name;
}

/// Exports that do not replace each other have names of their own.
std::string default_name(const ExportRequest& request, int trajectories) {
  std::string name = name_from(request.input);
  if (trajectories > 1) name += fmt::format("_{:05d}", request.trajectory);
  return name + (request.surface ? "_surface" : "");
}

std::unique_ptr<Sink> make_sink(const ExportRequest& request, const io::ExportTarget& target, const StoredScene& stored,
                                const std::vector<float>& sizes, const Trajectory& header) {
  if (request.surface)
    return std::make_unique<SurfaceSink>(request.format, target, surface_bodies(request, stored, sizes, header));
  if (contains(picture_formats, request.format)) return std::make_unique<PictureSink>(request, target, stored);
  return std::make_unique<PointSink>(request.format, target);
}

struct ExportResult {
  std::string folder;
  int64_t frames = 0, particles = 0;  ///< frames written, particles of the trajectory
};

/// Forces on obstacles and walls, one file for all frames.
ExportResult export_forces(const ExportRequest& request, const std::string& json, const io::TrajectoryReader& reader,
                           const Trajectory& header, const std::vector<int64_t>& frames) {
  ForceTable table;
  table.names = reader.contact_names(request.trajectory);
  if (table.names.empty())
    throw InputError("'" + request.input +
                     "' stores no forces on obstacles and walls. Make it by graupel simulate SCENE --forces");
  const std::vector<std::vector<ContactForce>> forces = reader.contact_forces(request.trajectory);
  for (const int64_t frame : frames) {
    const auto at = static_cast<std::size_t>(frame);
    table.rows.push_back({frame, header.frames[at].time, forces.at(at)});
  }
  const std::string stem = std::filesystem::path(request.input).stem().string();
  const std::string file = request.folder.empty() ? stem + "_forces.csv" : request.folder;
  check_output_file(file);
  io::check_inputs_kept({{"the trajectory", request.input}}, {{"--output", file}, {"--json", json}});
  write_file_atomically(file, force_csv(table));
  return {file, static_cast<int64_t>(frames.size()), static_cast<int64_t>(header.particle_count())};
}

FieldSet volume_ratio_fields(const FieldSet& stored) {
  FieldSet fields;
  for (const ParticleField field : io::volume_ratio_fields)
    if (stored.contains(field)) fields.add(field);
  return fields;
}

}  // namespace

std::vector<std::string> export_formats() {
  std::vector<std::string> formats = io::point_formats();
  for (const auto* more : {&io::surface_formats(), &picture_formats})
    for (const std::string& format : *more)
      if (!contains(formats, format)) formats.push_back(format);
  formats.push_back(force_format);
  return formats;
}

namespace {

bool is_one_file(const ExportRequest& request) { return contains({"usda", "gif", "mp4"}, request.format); }

/// Series keep the frames before; what is one file for all frames is not written.
void stop(const ExportRequest& request, Sink& sink, const std::string& folder) {
  if (!is_one_file(request)) sink.finish();
  stop_if_interrupted(is_one_file(request) ? "; nothing was written" : "; the frames before are in '" + folder + "'");
}

/// Programs that open a series by its numbers read all that is there.
void warn_of_other_frames(const ExportRequest& request, const io::ExportTarget& target,
                          const std::vector<int64_t>& frames) {
  if (is_one_file(request)) return;
  const std::vector<std::string> others =
      other_frames(target.folder, target.name, request.surface, "." + request.format, frames);
  if (others.empty()) return;
  const std::string names = others.size() == 1
                                ? "'" + others.front() + "'"
                                : fmt::format("'{}' to '{}', {} files", others.front(), others.back(), others.size());
  warn(
      fmt::format("'{}' also has frames of another export by these names ({}), which programs take for this one's. "
                  "Remove them, or choose another folder by --output",
                  target.folder, names));
}

/// `json`: another output.
ExportResult export_trajectory(const ExportRequest& request, const std::string& json) {
  check_format(request);
  check_flags_fit(request);
  check_name(request.name);
  check_readable(request.input);
  const io::TrajectoryReader reader(request.input);
  if (request.trajectory < 0 || request.trajectory >= reader.count())
    throw ConfigError(fmt::format("--trajectory {} is not in '{}' (allowed: 0 to {})", request.trajectory,
                                  request.input, reader.count() - 1));
  const Trajectory header = reader.header(request.trajectory);
  const auto frame_count = static_cast<int64_t>(header.frame_count());
  if (frame_count == 0) throw InputError("'" + request.input + "' has no frames (0). Export another trajectory");
  const std::vector<int64_t> frames = parse_frame_range(request.frames, frame_count, request.input);
  if (request.format == force_format) return export_forces(request, json, reader, header, frames);
  const StoredScene stored = stored_scene(header.scene_json, request.input);

  io::ExportTarget target;
  target.name = request.name.empty() ? default_name(request, reader.count()) : request.name;
  target.folder = request.folder.empty() ? target.name + "_" + request.format : request.folder;
  target.frame_time = header.frame_time;
  if (stored.best() != nullptr) target.up_axis = compare::vertical_axis(stored.best()->gravity) == 2 ? 'Z' : 'Y';
  const std::vector<float> sizes = shows_sizes(request) ? particle_sizes(stored, header) : std::vector<float>();
  if (!sizes.empty()) {
    const auto [least, most] = std::minmax_element(sizes.begin(), sizes.end());
    target.point_size = *most;
    if (*least < *most) target.sizes = sizes;
  } else if (stores_sizes(request)) {
    warn(fmt::format("the size of the particles in '{}' is not known ({}): {} m is written. Change it in the program",
                     request.input, stored.problem, target.point_size));
  }
  const NamedFile input = {"the trajectory", request.input};
  io::check_inputs_kept({input}, {{"--json", json}});
  std::vector<NamedFile> kept = io::files_behind({input});
  if (!json.empty()) kept.push_back({"the file of --json", follow_links(json).path});
  check_apart_from_series(kept, target.folder, target.name, {"." + request.format, ".pvd"});
  const std::unique_ptr<Sink> sink = make_sink(request, target, stored, sizes, header);
  const FieldSet fields = volume_ratio_fields(reader.fields(request.trajectory));
  Progress progress("export", static_cast<int64_t>(frames.size()));
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const std::vector<ParticleFrame> read = reader.frames(request.trajectory, frames[k], 1, fields);
    if (interrupted()) stop(request, *sink, target.folder);
    const io::PointFrame points = io::points_of(header.particle_type, read.front(), header.materials);
    io::check_finite(frames[k], points);
    sink->write(frames[k], points);
    progress.update(static_cast<int64_t>(k) + 1);
  }
  if (interrupted()) stop(request, *sink, target.folder);
  sink->finish();
  progress.done();
  warn_of_other_frames(request, target, frames);
  return {target.folder, static_cast<int64_t>(frames.size()), static_cast<int64_t>(header.particle_count())};
}

}  // namespace

void run_export(const ExportRequest& request, CommonOptions& common) {
  common.apply();
  const ExportResult result = export_trajectory(request, common.json);
  std::fprintf(stderr, "%s: %lld frames of %lld particles as .%s\n", result.folder.c_str(),
               static_cast<long long>(result.frames), static_cast<long long>(result.particles), request.format.c_str());
  common.write_json({{"output", result.folder},
                     {"format", request.format},
                     {"frames", result.frames},
                     {"particles", result.particles}});
}

}  // namespace graupel::experiments
