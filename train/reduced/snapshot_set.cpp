#include "train/reduced/snapshot_set.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/parallel/parallel_for.h"
#include "core/scene/checks/frame_time_check.h"
#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/sampling.h"

namespace graupel::train {

namespace {

constexpr int64_t bytes_at_once = int64_t(96) << 20;  ///< of the values that are read together

std::vector<float> read_values(const io::TrajectoryReader& reader, int run, SnapshotField field, int64_t first,
                               int64_t count) {
  switch (field) {
    case SnapshotField::position:
      return reader.positions(run, first, count);
    case SnapshotField::velocity:
      return reader.velocities(run, first, count);
    case SnapshotField::stress:
      return reader.values(run, ParticleField::stress, first, count);
    case SnapshotField::affine:
      return reader.values(run, ParticleField::affine, first, count);
    case SnapshotField::deformation_gradient:
      return reader.values(run, ParticleField::deformation_gradient, first, count);
  }
  return {};
}

}  // namespace

int components_of(SnapshotField field) {
  switch (field) {
    case SnapshotField::position:
    case SnapshotField::velocity:
      return 3;
    case SnapshotField::stress:
      return 6;
    case SnapshotField::affine:
    case SnapshotField::deformation_gradient:
      return 9;
  }
  return 0;
}

SnapshotSet::SnapshotSet(const std::string& file, const FieldSet& fields) : file_(file) {
  const io::TrajectoryReader reader(file);
  if (reader.count() == 0) throw InputError("'" + file + "' holds no run. Make the data set again");
  for (int run = 0; run < reader.count(); ++run) {
    const Trajectory header = reader.header(run);
    const auto wrong = [&](const std::string& what) {
      return InputError(fmt::format(
          "run {} of '{}' {}. Reduced models train on the runs of a sweep: 'graupel generate' of a recipe "
          "with \"fields\": \"{}\", as scenes/recipes/{}_*.json",
          run, file, what, fields.names(), fields.contains(ParticleField::deformation_gradient) ? "crom" : "nsf"));
    };
    if (header.diverged_at_frame >= 0) throw wrong("diverged");
    for (const ParticleField field : all_particle_fields)
      if (fields.contains(field) && !reader.fields(run).contains(field))
        throw wrong(fmt::format("lacks the field '{}'", info_of(field).name));
    const ParticleFrame start = reader.frames(run, 0, 1).front();
    if (start.velocity.empty()) throw wrong("lacks velocities");
    if (run == 0) {
      reference_ = start.position;
      frame_time_ = header.frame_time;
      scene_json_ = header.scene_json;
      if (scene_json_.empty()) throw wrong("lacks its scene");
      const Scene scene = io::parse_stored_scene(scene_json_, file, file);
      check_frame_time(frame_time_, scene.frame_time, "'" + file + "'");
      if (scene.time_step.policy != StepPolicy::fixed) throw wrong("has no fixed step (time_step.policy)");
      substeps_per_frame_ = scene.time_step.substeps_per_frame;
      const mpm::SampledParticles particles = mpm::sample_sources(scene, header.seed);
      if (particles.position.size() != reference_.size()) throw wrong("has other particles than its scene");
      const auto scripts = static_cast<int32_t>(particles.scripts.size()) + 1;
      particle_volume_ = particles.volume;
      for (std::size_t p = 0; p < reference_.size(); ++p) {
        particle_kind_.push_back(particles.material[p] * scripts +
                                 (particles.script.empty() ? 0 : particles.script[p] + 1));
        const std::string& material = particles.material_names[static_cast<std::size_t>(particles.material[p])];
        particle_mass_.push_back(particles.volume[p] * scene.materials.at(material).density);
      }
    } else if (!(start.position == reference_)) {
      throw wrong("starts with other particles than the first run");
    } else if (header.frame_time != frame_time_) {
      throw wrong("has another time between frames than the first run");
    }
    const std::vector<io::NamedValue> values = reader.parameters(run);
    if (run == 0)
      for (const io::NamedValue& p : values) parameters_.push_back({p.name, p.unit, p.keys, {}});
    if (values.size() != parameters_.size()) throw wrong("has other parameters than the first run");
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i].keys != parameters_[i].keys) throw wrong("has other parameters than the first run");
      parameters_[i].values.push_back(values[i].value);
    }
    first_snapshot_.push_back(first_snapshot_.back() + static_cast<int64_t>(header.frame_count()));
  }
}

std::string SnapshotSet::hash() const {
  uint64_t sum = fnv_start;
  const auto add = [&](const auto& values) { sum = fnv1a(sum, values.data(), values.size() * sizeof(values[0])); };
  add(scene_json_);
  add(first_snapshot_);
  add(reference_);
  for (const SweptParameter& parameter : parameters_) {
    add(parameter.name);
    add(parameter.values);
  }
  return fmt::format("{:016x}", sum);
}

std::vector<float> SnapshotSet::read(SnapshotField field, int64_t snapshot) const {
  int run = 0;
  while (first_snapshot(run + 1) <= snapshot) ++run;
  return read_values(io::TrajectoryReader(file_), run, field, snapshot - first_snapshot(run), 1);
}

void SnapshotSet::visit(SnapshotField field, const std::function<void(int64_t, const float*)>& use) const {
  const io::TrajectoryReader reader(file_);
  const int64_t row = particles() * components_of(field);
  const int64_t at_once = std::max<int64_t>(1, bytes_at_once / (row * static_cast<int64_t>(sizeof(float))));
  for (int run = 0; run < runs(); ++run) {
    const int64_t frames = first_snapshot(run + 1) - first_snapshot(run);
    for (int64_t f = 0; f < frames; f += at_once) {
      const int64_t count = std::min(at_once, frames - f);
      const std::vector<float> values = read_values(reader, run, field, f, count);
      const auto visit_one = [&](int64_t i) { use(first_snapshot(run) + f + i, values.data() + i * row); };
      parallel_for_cpu(count, visit_one, Grain{1});
    }
  }
}

}  // namespace graupel::train
