#include "train/snapshot_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "io/scene_reader.h"
#include "io/trajectory_file.h"
#include "mpm/sampling.h"

namespace graupel::train {

namespace {

FieldSet fields_for(SnapshotField field) {
  if (field == SnapshotField::stress) return {ParticleField::stress};
  if (field == SnapshotField::affine) return {ParticleField::affine};
  return {};
}

/// The numbers of a field in a frame, particle by particle.
const float* values_of(const ParticleFrame& frame, SnapshotField field) {
  switch (field) {
    case SnapshotField::position:
      return frame.position.data()->a;
    case SnapshotField::velocity:
      return frame.velocity.data()->a;
    case SnapshotField::stress:
      return frame.fields[ParticleField::stress].data();
    case SnapshotField::affine:
      return frame.fields[ParticleField::affine].data();
  }
  return nullptr;
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
      return 9;
  }
  return 0;
}

SnapshotSet::SnapshotSet(const std::string& file) : file_(file) {
  const io::TrajectoryReader reader(file);
  if (reader.count() == 0) throw InputError("'" + file + "' holds no run. Make the data set again");
  for (int run = 0; run < reader.count(); ++run) {
    const Trajectory header = reader.header(run);
    const auto wrong = [&](const std::string& what) {
      return InputError(
          fmt::format("run {} of '{}' {}. Reduced models train on the runs of a sweep: 'graupel generate "
                      "scenes/recipes/nsf_*.json'",
                      run, file, what));
    };
    if (header.diverged_at_frame >= 0) throw wrong("diverged");
    for (const ParticleField field : {ParticleField::stress, ParticleField::affine})
      if (!reader.fields(run).contains(field)) throw wrong(fmt::format("lacks the field '{}'", info_of(field).name));
    const ParticleFrame start = reader.frames(run, 0, 1).front();
    if (start.velocity.empty()) throw wrong("lacks velocities");
    if (run == 0) {
      reference_ = start.position;
      frame_time_ = header.frame_time;
      scene_json_ = header.scene_json;
      if (scene_json_.empty()) throw wrong("lacks its scene");
      const Scene scene = io::parse_stored_scene(scene_json_, file, file);
      if (scene.time_step.policy != StepPolicy::fixed) throw wrong("has no fixed step (time_step.policy)");
      substeps_per_frame_ = scene.time_step.substeps_per_frame;
      const mpm::SampledParticles particles = mpm::sample_sources(scene, header.seed);
      if (particles.position.size() != reference_.size()) throw wrong("has other particles than its scene");
      const auto scripts = static_cast<int32_t>(particles.scripts.size()) + 1;
      for (std::size_t p = 0; p < reference_.size(); ++p)
        particle_kind_.push_back(particles.material[p] * scripts +
                                 (particles.script.empty() ? 0 : particles.script[p] + 1));
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

std::vector<float> SnapshotSet::read(SnapshotField field, int64_t first, int64_t count) const {
  const io::TrajectoryReader reader(file_);
  const auto width = static_cast<std::size_t>(components_of(field));
  const std::size_t row = static_cast<std::size_t>(count) * width;
  std::vector<float> values(static_cast<std::size_t>(snapshots()) * row);
  float* to = values.data();
  for (int run = 0; run < runs(); ++run) {
    const int64_t frames = first_snapshot(run + 1) - first_snapshot(run);
    for (int64_t f = 0; f < frames; ++f, to += row) {
      const ParticleFrame frame = reader.frames(run, f, 1, fields_for(field)).front();
      std::memcpy(to, values_of(frame, field) + static_cast<std::size_t>(first) * width, row * sizeof(float));
    }
  }
  return values;
}

}  // namespace graupel::train
