// A scene that MPM runs while it is looked at: frames come as they are made, and stay in a temporary file.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "experiments/viewer/frame_file.h"
#include "experiments/viewer/frame_source.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

struct LiveRequest {
  std::string scene;               ///< file
  std::vector<std::string> set;    ///< changes of its keys
  mpm::SimulationOptions options;  ///< the seed: `seed_given`, or the scene's
  bool seed_given = false;
};

class LiveSource : public FrameSource {
 public:
  /// Reads the scene's file and begins at once. Throws ConfigError and InputError for a scene that cannot be run.
  LiveSource(const LiveRequest& request, uint32_t run);
  ~LiveSource() override;

  const RunFacts& facts() const override { return facts_; }
  RunStatus status() const override;
  void read(int64_t frame, std::size_t offset, std::span<std::byte> out) override;
  void stop() override;
  void pause(bool on) override;

 private:
  void run();
  bool advance();
  bool wait_while_paused();
  void add_frame();
  bool stopped() const;

  RunFacts facts_;
  Box limits_;
  std::unique_ptr<mpm::Simulation> simulation_;
  std::unique_ptr<FrameFile> frames_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  RunStatus status_;
  bool paused_ = false, stopped_ = false;
  std::thread thread_;
};

}  // namespace graupel::experiments
