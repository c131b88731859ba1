// graupel-bench view: frames a second that the viewer serves over the loopback, of a file that is made for it.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "bench/commands.h"
#include "core/math/random.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/process/common_options.h"
#include "experiments/viewer/view.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::bench {

using namespace experiments;

namespace {

struct BenchViewOptions {
  CommonOptions common;
  int64_t particles = 1'000'000, frames = 40;
  int deflate = 1;
};

/// Particles at random places that fall and drift: their low bits compress as badly as those of a run.
void write_run(const std::string& path, const BenchViewOptions& options) {
  const Random random(options.common.seed, RandomPurpose::metric_subset);
  const auto particles = static_cast<std::size_t>(options.particles);
  Trajectory header;
  header.particle_type.assign(particles, 5);
  ParticleFrame frame;
  for (std::size_t i = 0; i < particles; ++i)
    frame.position.push_back({static_cast<float>(random.uniform(3 * i, 0)),
                              static_cast<float>(random.uniform(3 * i + 1, 0)),
                              static_cast<float>(random.uniform(3 * i + 2, 0))});
  io::TrajectoryWriteOptions write;
  write.velocity = false;
  write.deflate = options.deflate;
  io::TrajectoryWriter writer(path, header, write);
  for (int64_t k = 0; k < options.frames; ++k) {
    frame.time = static_cast<double>(k) / 60;
    writer.append(frame);
    for (std::size_t i = 0; i < particles; ++i)
      frame.position[i] += Vec3f{0.003f * frame.position[i][1], -0.002f, 0.001f * frame.position[i][0]};
  }
  writer.finish();
}

/// One connection that is kept, as a browser's.
class Connection {
 public:
  explicit Connection(const std::string& address)
      : port_(std::atoi(address.c_str() + address.rfind(':') + 1)), root_(address.substr(address.find('/', 8))) {
    socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<uint16_t>(port_));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (socket_ < 0 || ::connect(socket_, reinterpret_cast<sockaddr*>(&to), sizeof to) != 0)
      throw IoError("cannot connect to the viewer. Check that this machine has its loopback network");
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Receives frame k of side 0, of `record` bytes.
  void get_frame(int64_t k, std::size_t record) {
    const auto first = static_cast<std::size_t>(k) * record;
    const std::string text = fmt::format("GET {}0/frames HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nRange: bytes={}-{}\r\n\r\n",
                                         root_, port_, first, first + record - 1);
    ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    std::string head;
    for (char c; head.find("\r\n\r\n") == std::string::npos && ::recv(socket_, &c, 1, 0) == 1;) head += c;
    if (head.find(" 206 ") == std::string::npos) throw IoError("the viewer did not send frame " + std::to_string(k));
    received_.resize(record);
    for (std::size_t have = 0; have < record;) {
      const ssize_t count = ::recv(socket_, received_.data() + have, record - have, 0);
      if (count <= 0) throw IoError("the viewer ended in frame " + std::to_string(k));
      have += static_cast<std::size_t>(count);
    }
  }

 private:
  int port_, socket_ = -1;
  std::string root_;
  std::vector<std::byte> received_;
};

double frames_per_second(int64_t frames, const Stopwatch& watch) {
  return static_cast<double>(frames) / watch.seconds();
}

void run_view(BenchViewOptions& options) {
  options.common.apply();
  const std::string path =
      (std::filesystem::temp_directory_path() / fmt::format("graupel_bench_view_{}.h5", ::getpid())).string();
  write_run(path, options);
  const double stored = static_cast<double>(std::filesystem::file_size(path)) / static_cast<double>(options.frames);
  nlohmann::ordered_json result = {
      {"particles", options.particles}, {"frames", options.frames},
      {"deflate", options.deflate},     {"threads", num_threads()},
      {"stored_bytes_a_frame", stored}, {"frames_per_second", nlohmann::ordered_json::object()}};
  const auto report = [&](const std::string& what, double speed) {
    result["frames_per_second"][what] = speed;
    std::printf("| %s | %.1f |\n", what.c_str(), speed);
    std::fflush(stdout);
  };
  std::printf(
      "%lld particles, %lld frames, deflate %d, %d threads, %.1f MB a frame in the file\n\n| | frames/s |\n|---|---|\n",
      static_cast<long long>(options.particles), static_cast<long long>(options.frames), options.deflate, num_threads(),
      1e-6 * stored);
  {
    const io::TrajectoryReader reader(path);
    std::vector<float> numbers(3 * static_cast<std::size_t>(options.particles));
    const Stopwatch watch;
    for (int64_t k = 0; k < options.frames; ++k) reader.positions(0, k, 1, numbers);
    report("reading the file alone", frames_per_second(options.frames, watch));
  }
  ViewOptions view;
  view.files = {path};
  const Viewer viewer(view, Device::cpu);
  std::filesystem::remove(path);  // it is open
  Connection connection(viewer.address());
  for (const char* pass : {"first pass", "second pass"}) {
    const Stopwatch watch;
    for (int64_t k = 0; k < options.frames; ++k)
      connection.get_frame(k, frame_record_bytes(static_cast<std::size_t>(options.particles), 0));
    report(pass, frames_per_second(options.frames, watch));
  }
  options.common.write_json(result);
}

}  // namespace

void add_view(const Command& program) {
  auto options = std::make_shared<BenchViewOptions>();
  const Command verb =
      program.command("view", "Frames a second that 'graupel view' serves, in a first and a second pass");
  verb.option("--particles", options->particles, "Of the run that is made").check(whole_number(1)).show_default();
  verb.option("--frames", options->frames, "Of it").check(whole_number(1)).show_default();
  verb.option("--deflate", options->deflate, "Its compression, 0 to 9").check(whole_number(0, 9)).show_default();
  options->common.add_to(verb);
  verb.footer("Example, all of it on one core:\n  taskset -c 0 graupel bench view --threads 1");
  verb.callback([options] { run_view(*options); });
}

}  // namespace graupel::bench
