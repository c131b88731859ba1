#include "bench/graph/libtorch_time.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/process/sibling_program.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::bench {

using namespace experiments;

namespace {

/// A folder that is removed with this object.
class ScratchFolder {
 public:
  ScratchFolder() : path_((std::filesystem::temp_directory_path() / "graupel_XXXXXX").string()) {
    if (::mkdtemp(path_.data()) == nullptr)
      throw IoError("cannot make a folder '" + path_ + "' (" + std::strerror(errno) + "). Set TMPDIR to another place");
  }
  ~ScratchFolder() { remove_path(path_); }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

void write_state(const std::string& file, const NetworkState& state) {
  Trajectory header;
  header.particle_type = state.particle_type;
  header.frame_time = state.frame_time;
  header.scene_json = state.scene_json;
  io::TrajectoryWriter writer(file, header, {.velocity = false});
  for (std::size_t f = 0; f < state.history.size(); ++f) {
    ParticleFrame frame;
    frame.time = static_cast<double>(f) * state.frame_time;
    frame.position = state.history[f];
    writer.append(frame);
  }
  writer.finish();
}

}  // namespace

LibtorchTime time_in_libtorch(const std::string& weights_file, const NetworkState& state,
                              graph::FirstLayers first_layers, Device device) {
  const ScratchFolder folder;
  const std::string data = folder.file("state.h5"), result = folder.file("time.json");
  write_state(data, state);
  run_to_end(training_program,
             {"time", weights_file, "--data", data, "--first-layers", name_of(first_layers), "--device",
              name_of(device), "--threads", std::to_string(num_threads()), "--json", result});
  const auto json = nlohmann::json::parse(read_file(result));
  LibtorchTime time;
  time.first_layers = first_layers;
  time.seconds = json.at("seconds");
  time.flop = json.at("flop");
  time.threads = json.at("threads");
  time.version = json.at("libtorch");
  time.blas = json.at("blas");
  time.device = json.at("device");
  time.number_type = json.at("number_type");
  return time;
}

}  // namespace graupel::bench
