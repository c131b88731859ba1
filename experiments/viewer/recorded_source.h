// A stored trajectory for the viewer. One thread reads the file: frames that are asked for first, then those after the
// last one, ahead of the page. Each is expanded and made a record once, and kept in a temporary file.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "experiments/viewer/frame_file.h"
#include "experiments/viewer/frame_source.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

class RecordedSource : public FrameSource {
 public:
  /// `trajectory` of a data set. Throws InputError for a file that is missing or damaged, ConfigError for another
  /// number of a trajectory and for one without frames.
  RecordedSource(const std::string& file, int trajectory);
  ~RecordedSource() override;

  const RunFacts& facts() const override { return facts_; }
  RunStatus status() const override;
  void read(int64_t frame, std::size_t offset, std::span<std::byte> out) override;
  void stop() override;

 private:
  using Record = std::shared_ptr<const std::vector<std::byte>>;
  struct Range {
    int64_t first = 0, count = 0;
  };

  int64_t frame_count() const { return static_cast<int64_t>(facts_.times.size()); }
  void take_scene(const Trajectory& header, const std::string& file);
  void find_box_and_spacing();
  Record wait_for(int64_t frame);
  Record recent(int64_t frame) const;
  bool is_ready(int64_t frame) const { return stored_->has(frame) || recent(frame); }
  Range next_work() const;
  void read_in_background();
  void load(const Range& range);
  void keep(int64_t frame, Record record);

  io::TrajectoryReader reader_;
  int trajectory_;
  RunFacts facts_;
  std::vector<float> numbers_;  ///< positions that were read last: new memory for each would cost as much as a copy
  int64_t most_at_once_ = 1;    ///< frames that are read together: all threads then expand them

  mutable std::mutex mutex_;
  std::condition_variable work_, ready_;
  std::multiset<int64_t> wanted_;  ///< frames that requests wait for
  int64_t last_wanted_ = -1;
  std::deque<std::pair<int64_t, Record>> recent_;  ///< the last ones made; all there are once the disk is full
  std::unique_ptr<FrameFile> stored_;
  bool disk_is_full_ = false, stopped_ = false;
  std::string problem_;  ///< of reading; it ends the thread
  std::thread thread_;
};

}  // namespace graupel::experiments
