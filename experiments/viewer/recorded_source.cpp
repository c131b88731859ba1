#include "experiments/viewer/recorded_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <unordered_set>

#include "core/system/error.h"
#include "experiments/data/particle_sizes.h"

namespace graupel::experiments {

namespace {

constexpr int64_t frames_ahead = 24;            ///< of the one asked for last
constexpr std::size_t most_recent = 12;         ///< records kept in memory
constexpr int64_t bytes_at_once = 24 << 20;     ///< of positions that are read together: the allocator keeps that much
constexpr int64_t most_frames_at_once = 8;      ///< as many as the writer puts into a chunk
constexpr std::size_t spacing_sample = 200000;  ///< particles

/// Of particles that fill a part of a box: the volume of the cells that hold some, shared among them.
double spacing_of(const std::vector<Vec3f>& position, const Box& box, int dimensions) {
  const std::size_t stride = position.size() / spacing_sample + 1;
  const double count = static_cast<double>(position.size()) / static_cast<double>(stride);
  double measure = 1;
  for (int d = 0; d < dimensions; ++d) measure *= std::max(1e-9, static_cast<double>(box.high[d] - box.low[d]));
  const double cell = std::pow(8 * measure / count, 1.0 / dimensions);
  std::unordered_set<int64_t> cells;
  for (std::size_t i = 0; i < position.size(); i += stride) {
    int64_t key = 0;
    for (int d = 0; d < dimensions; ++d)
      key = key * 100003 + static_cast<int64_t>(std::floor((position[i][d] - box.low[d]) / cell));
    cells.insert(key);
  }
  const double filled = static_cast<double>(cells.size()) * std::pow(cell, dimensions);
  return std::pow(filled / static_cast<double>(position.size()), 1.0 / dimensions);
}

void grow(Box& box, const std::vector<Vec3f>& position) {
  for (const Vec3f& x : position)
    for (int d = 0; d < 3; ++d) {
      if (!std::isfinite(x[d])) continue;
      box.low[d] = std::min(box.low[d], x[d]);
      box.high[d] = std::max(box.high[d], x[d]);
    }
}

std::vector<Vec3f> as_points(const std::vector<float>& numbers) {
  std::vector<Vec3f> points(numbers.size() / 3);
  std::memcpy(points.data(), numbers.data(), points.size() * sizeof(Vec3f));
  return points;
}

}  // namespace

RecordedSource::RecordedSource(const std::string& file, int trajectory) : reader_(file), trajectory_(trajectory) {
  if (trajectory < 0 || trajectory >= reader_.count())
    throw ConfigError(
        fmt::format("--trajectory {} is not in '{}' (allowed: 0 to {})", trajectory, file, reader_.count() - 1));
  Trajectory header = reader_.header(trajectory);
  if (header.frames.empty()) throw InputError("'" + file + "' has no frames (0). Choose another file");
  facts_.name = std::filesystem::path(file).filename().string();
  if (reader_.count() > 1) facts_.name += fmt::format(" [{}]", trajectory);
  facts_.made_by = header.made_by;
  if (!header.scene_json.empty()) take_scene(header, file);
  facts_.particle_type = std::move(header.particle_type);
  facts_.materials = std::move(header.materials);
  for (const ParticleFrame& frame : header.frames) facts_.times.push_back(frame.time);
  if (header.diverged_at_frame >= 0 && facts_.note.empty())
    facts_.note = fmt::format("diverged at frame {}", header.diverged_at_frame);
  if (!facts_.scene) find_box_and_spacing();
  const auto frame_bytes = static_cast<int64_t>(12 * facts_.particle_type.size());
  most_at_once_ = std::clamp<int64_t>(bytes_at_once / frame_bytes, 1, most_frames_at_once);
  stored_ = std::make_unique<FrameFile>(frame_count(), facts_.record_bytes());
  thread_ = std::thread([this] { read_in_background(); });
}

RecordedSource::~RecordedSource() {
  stop();
  thread_.join();
}

/// Particles are drawn as wide as the widest is, also those that a rollout refined.
void RecordedSource::take_scene(const Trajectory& header, const std::string& file) {
  const StoredScene stored = stored_scene(header.scene_json, file);
  if (!stored.whole) {
    facts_.note = "its scene is not shown: " + stored.problem;
    return;
  }
  set_scene(facts_, *stored.whole);
  const std::vector<float> sizes = particle_sizes(stored, header);
  if (!sizes.empty()) facts_.spacing = *std::max_element(sizes.begin(), sizes.end());
}

/// Of a file without a scene: what particles take in the first, middle and last frame.
void RecordedSource::find_box_and_spacing() {
  facts_.box = {Vec3f::filled(INFINITY), Vec3f::filled(-INFINITY)};
  const std::vector<Vec3f> start = as_points(reader_.positions(trajectory_, 0, 1));
  grow(facts_.box, start);
  facts_.dimensions = facts_.box.low[2] == facts_.box.high[2] ? 2 : 3;
  facts_.spacing = spacing_of(start, facts_.box, facts_.dimensions);
  for (const int64_t frame : {frame_count() / 2, frame_count() - 1})
    grow(facts_.box, as_points(reader_.positions(trajectory_, frame, 1)));
  for (int d = 0; d < 3; ++d)
    if (!(facts_.box.low[d] <= facts_.box.high[d])) facts_.box.low[d] = 0, facts_.box.high[d] = 1;
}

RunStatus RecordedSource::status() const { return {.frames = frame_count(), .message = {}}; }

void RecordedSource::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  work_.notify_all();
  ready_.notify_all();
}

void RecordedSource::read(int64_t frame, std::size_t offset, std::span<std::byte> out) {
  const Record record = wait_for(frame);
  if (record)
    std::copy_n(record->begin() + static_cast<std::ptrdiff_t>(offset), out.size(), out.begin());
  else
    stored_->read(frame, offset, out);
}

/// Until the frame is there; its record, or null where the file has it.
RecordedSource::Record RecordedSource::wait_for(int64_t frame) {
  std::unique_lock lock(mutex_);
  last_wanted_ = frame;
  work_.notify_one();
  const auto ticket = wanted_.insert(frame);
  ready_.wait(lock, [&] { return stopped_ || !problem_.empty() || is_ready(frame); });
  wanted_.erase(ticket);
  if (stopped_) throw Error(ExitCode::interrupted, "the viewer ends");
  if (!is_ready(frame)) throw InputError(problem_);
  return recent(frame);
}

RecordedSource::Record RecordedSource::recent(int64_t frame) const {
  for (const auto& [number, record] : recent_)
    if (number == frame) return record;
  return nullptr;
}

/// What is waited for, then what comes after the last frame asked for. With a full disk nothing is read ahead, which
/// would push out what is waited for.
RecordedSource::Range RecordedSource::next_work() const {
  for (const int64_t frame : wanted_)
    if (!is_ready(frame)) return {frame, 1};
  if (last_wanted_ < 0 || disk_is_full_) return {};
  for (int64_t k = last_wanted_ + 1; k < std::min(frame_count(), last_wanted_ + 1 + frames_ahead); ++k) {
    if (is_ready(k)) continue;
    Range range = {k, 1};
    while (range.count < most_at_once_ && k + range.count < frame_count() && !is_ready(k + range.count)) ++range.count;
    return range;
  }
  return {};
}

void RecordedSource::read_in_background() {
  std::unique_lock lock(mutex_);
  while (!stopped_) {
    const Range range = next_work();
    if (range.count == 0) {
      work_.wait(lock);
      continue;
    }
    lock.unlock();
    try {
      load(range);
      lock.lock();
    } catch (const std::exception& error) {
      lock.lock();
      problem_ = error.what();
      ready_.notify_all();
      return;
    }
  }
}

void RecordedSource::load(const Range& range) {
  const std::size_t particles = facts_.particle_type.size();
  numbers_.resize(std::max(numbers_.size(), 3 * particles * static_cast<std::size_t>(range.count)));
  reader_.positions(trajectory_, range.first, range.count,
                    std::span(numbers_).first(3 * particles * static_cast<std::size_t>(range.count)));
  const std::vector<uint8_t> active = reader_.active(trajectory_, range.first, range.count);
  for (int64_t k = 0; k < range.count; ++k) {
    const int64_t frame = range.first + k;
    const std::size_t row = static_cast<std::size_t>(k) * particles;
    FrameToEncode encoded;
    encoded.time = facts_.times[static_cast<std::size_t>(frame)];
    encoded.position = {reinterpret_cast<const Vec3f*>(numbers_.data()) + row, particles};
    if (!active.empty()) encoded.active = {active.data() + row, particles};
    encoded.obstacle_pose = facts_.obstacle_poses(encoded.time);
    keep(frame, std::make_shared<const std::vector<std::byte>>(encode_frame(encoded, facts_.limits())));
  }
}

void RecordedSource::keep(int64_t frame, Record record) {
  if (!disk_is_full_) try {
      stored_->put(frame, *record);
    } catch (const IoError&) {
      disk_is_full_ = true;  // from now on frames are made each time
    }
  const std::lock_guard lock(mutex_);
  recent_.emplace_back(frame, std::move(record));
  if (recent_.size() > most_recent) recent_.pop_front();
  ready_.notify_all();
}

}  // namespace graupel::experiments
