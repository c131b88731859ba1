#include "experiments/viewer/view.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/system/error.h"
#include "core/system/printable.h"
#include "core/system/standard_output.h"
#include "core/system/stop_signal.h"
#include "experiments/process/process.h"
#include "experiments/viewer/live_source.h"
#include "experiments/viewer/recorded_source.h"
#include "io/trajectory/input_files.h"

namespace graupel::experiments {

namespace {

std::function<std::shared_ptr<FrameSource>(uint32_t)> source_of(const std::string& file, const ViewOptions& options,
                                                                Device device) {
  if (std::filesystem::path(file).extension() != ".json")
    return [file, trajectory = options.trajectory](uint32_t) {
      return std::make_shared<RecordedSource>(file, trajectory);
    };
  LiveRequest request = {file, options.set, {}, options.common.seed_given};
  request.options.device = device;
  request.options.seed = options.common.seed;
  return [request](uint32_t run) { return std::make_shared<LiveSource>(request, run); };
}

void check_files(const ViewOptions& options) {
  if (options.files.size() > 2)
    throw ConfigError(
        fmt::format("{} files are given (allowed: 1, or 2 side by side). Leave some out", options.files.size()));
  const bool runs = std::any_of(options.files.begin(), options.files.end(), [](const std::string& file) {
    return std::filesystem::path(file).extension() == ".json";
  });
  if (!runs && !options.set.empty())
    throw ConfigError("--set changes a scene that is run, and no scene (.json) is given. Leave --set out");
  if (!runs && options.common.seed_given)
    throw ConfigError("--seed is of a scene that is run, and no scene (.json) is given. Leave --seed out");
}

}  // namespace

Viewer::Viewer(const ViewOptions& options, Device device) : token_(random_token()) {
  check_files(options);
  for (const std::string& file : options.files)
    sides_.push_back(std::make_unique<ViewerSide>(source_of(file, options, device)));
  routes_ = std::make_unique<ViewerRoutes>(token_, sides_);
  server_ = std::make_unique<HttpServer>(options.port,
                                         [this](const HttpRequest& request) { return routes_->answer(request); });
  routes_->set_port(server_->port());
}

Viewer::~Viewer() {
  for (const auto& side : sides_) side->source()->stop();
  server_.reset();
}

std::string Viewer::address() const { return fmt::format("http://127.0.0.1:{}/{}/", server_->port(), token_); }

std::vector<std::string> Viewer::notes() const {
  std::vector<std::string> notes;
  std::vector<std::size_t> particles;
  for (const auto& side : sides_) {
    const RunFacts& facts = side->source()->facts();
    particles.push_back(facts.particle_type.size());
    if (!facts.note.empty()) notes.push_back(facts.name + ": " + facts.note);
  }
  if (particles.size() == 2 && particles[0] != particles[1])
    notes.push_back(
        fmt::format("the two have {} and {} particles, so that no error is shown (it needs the same "
                    "particles)",
                    particles[0], particles[1]));
  return notes;
}

namespace {

void serve_until_stopped(ViewOptions& options) {
  const Device device = options.common.apply();
  std::vector<NamedFile> inputs;
  for (const std::string& file : options.files) inputs.push_back({"the file", file});
  io::check_inputs_kept(inputs, {{"--json", options.common.json}}, options.set);
  const Viewer viewer(options, device);
  for (const std::string& note : viewer.notes()) std::fprintf(stderr, "graupel: note: %s\n", printable(note).c_str());
  options.common.write_json({{"address", viewer.address()}});
  std::printf("%s\n", viewer.address().c_str());
  flush_standard_output();
  std::fprintf(stderr, "Open this address in a browser of this machine. Ctrl-C ends the viewer\n");
  while (!interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
}

}  // namespace

void view(ViewOptions& options) {
  const StopPolicyScope ends_so(StopPolicy::usual_end);
  try {
    serve_until_stopped(options);
  } catch (const StoppedError&) {  // while a file was read
  }
}

}  // namespace graupel::experiments
