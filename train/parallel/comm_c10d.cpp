// The only file that includes c10d. What of it there is depends on the libtorch: Debian's 1.13 has Gloo (headers:
// libgloo-dev) and no NCCL, PyTorch's own packages for CUDA have NCCL (nccl.h from the nvidia-nccl package) and no
// headers of Gloo.
#if defined(USE_DISTRIBUTED) && __has_include(<torch/csrc/distributed/c10d/TCPStore.hpp>)
#include <torch/version.h>
#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>
#if TORCH_VERSION_MAJOR >= 2
#include <torch/csrc/distributed/c10d/Backend.hpp>
#else
#include <torch/csrc/distributed/c10d/ProcessGroup.hpp>
#endif
#if defined(USE_C10D_GLOO) && __has_include(<gloo/algorithm.h>)
#define GRAUPEL_GLOO
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#endif
#if defined(USE_C10D_NCCL) && __has_include(<nccl.h>) && __has_include(<cuda_runtime.h>) && TORCH_VERSION_MAJOR >= 2
#define GRAUPEL_NCCL
#include <torch/csrc/distributed/c10d/ProcessGroupNCCL.hpp>
#endif
#endif

#include <ATen/core/Tensor.h>
#include <ATen/ops/zeros.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <vector>

#include "train/parallel/comm.h"

namespace graupel::train {

#if defined(GRAUPEL_GLOO) || defined(GRAUPEL_NCCL)

namespace {

#if TORCH_VERSION_MAJOR >= 2
using Group = c10d::Backend;
#else
using Group = c10d::ProcessGroup;
#endif
using Milliseconds = std::chrono::milliseconds;

Milliseconds milliseconds_of(double seconds) { return Milliseconds(static_cast<int64_t>(1000 * seconds)); }

std::string words_of(const RankEnvironment& environment) {
  return "rank " + std::to_string(environment.rank) + " of " + std::to_string(environment.size);
}

std::string first_line(const std::exception& error) {
  const std::string text = error.what();
  return text.substr(0, text.find('\n'));
}

struct Connection {
  c10::intrusive_ptr<Group> group;
  at::DeviceType transfer = at::kCPU;  ///< where the group's tensors must lie
  std::function<void()> leave;         ///< in good order; may be empty
};

/// Ranks that c10d connects.
class ConnectedRanks : public Comm {
 public:
  /// `store` must live as long as the connection.
  ConnectedRanks(const RankEnvironment& environment, c10::intrusive_ptr<c10d::Store> store, Connection connection)
      : environment_(environment), store_(std::move(store)), connection_(std::move(connection)) {}
  ~ConnectedRanks() override {
    if (connection_.leave && std::uncaught_exceptions() == 0) connection_.leave();
  }
  ConnectedRanks(const ConnectedRanks&) = delete;
  ConnectedRanks& operator=(const ConnectedRanks&) = delete;

  int rank() const override { return environment_.rank; }
  int size() const override { return environment_.size; }

  void all_reduce_sum(at::Tensor& tensor) override {
    finish(tensor, [this](std::vector<at::Tensor>& parts) { return connection_.group->allreduce(parts); });
  }
  void broadcast(at::Tensor& tensor) override {
    finish(tensor, [this](std::vector<at::Tensor>& parts) { return connection_.group->broadcast(parts); });
  }
  void barrier() override {
    at::Tensor token = at::zeros({1});
    all_reduce_sum(token);
  }

 private:
  /// Starts `collective` on the tensor, or on a copy where it lies elsewhere, and waits for it.
  template <typename Collective>
  void finish(at::Tensor& tensor, const Collective& collective) {
    try {
      std::vector<at::Tensor> parts = {
          tensor.device().type() == connection_.transfer ? tensor : tensor.to(connection_.transfer)};
      collective(parts)->wait();
      if (!parts[0].is_same(tensor)) tensor.copy_(parts[0]);
    } catch (const std::exception& error) {
      throw CommError(words_of(environment_) + ": another rank has ended or does not answer (" + first_line(error) +
                      "). Its own message tells why; go on from the last checkpoint with --resume");
    }
  }

  RankEnvironment environment_;
  c10::intrusive_ptr<c10d::Store> store_;
  Connection connection_;
};

[[noreturn]] void throw_not_met(const RankEnvironment& environment, double timeout, const std::string& why) {
  throw CommError(words_of(environment) + ": the ranks did not meet at " + environment.address + ":" +
                  std::to_string(environment.port) + " within " + std::to_string(std::lround(timeout)) + " s (" + why +
                  "). Start as many processes as there are ranks, let MASTER_ADDR name the machine of rank 0, and set "
                  "MASTER_PORT to a free port");
}

/// Where the ranks find each other. torchrun keeps its own keys there, and those of runs that it has started anew.
c10::intrusive_ptr<c10d::Store> open_store(const RankEnvironment& environment, double timeout) {
  c10d::TCPStoreOptions options;
  options.port = static_cast<uint16_t>(environment.port);
  options.isServer = environment.rank == 0 && !environment.served;
  options.waitWorkers = false;
  options.timeout = milliseconds_of(timeout);
  try {
    return c10::make_intrusive<c10d::PrefixStore>("graupel/" + std::to_string(environment.restart),
                                                  c10::make_intrusive<c10d::TCPStore>(environment.address, options));
  } catch (const std::exception& error) {
    throw_not_met(environment, timeout, first_line(error));
  }
}

/// What each rank says before they connect: those with different plans would wait for each other.
class Meeting {
 public:
  Meeting(const RankEnvironment& environment, c10d::Store& store, double timeout)
      : environment_(environment), store_(store), timeout_(timeout) {}

  /// Rank 0 keeps the store: it speaks first and ends last, so that no other rank misses what it says.
  void agree_on(const std::string& plan) {
    if (environment_.rank > 0) {
      const std::string first = hear(plan_key(0), "rank 0 is missing");
      say(plan_key(environment_.rank), plan);
      check_plan(plan, 0, first);
      hear("all are here", "rank 0 has given up");
      return;
    }
    say(plan_key(0), plan);
    for (int rank = 1; rank < environment_.size; ++rank)
      check_plan(plan, rank, hear(plan_key(rank), "rank " + std::to_string(rank) + " is missing"));
    say("all are here", "yes");
  }

 private:
  static std::string plan_key(int rank) { return "plan/" + std::to_string(rank); }
  void say(const std::string& key, const std::string& text) {
    store_.set(key, std::vector<uint8_t>(text.begin(), text.end()));
  }
  std::string hear(const std::string& key, const std::string& else_why) {
    try {
      store_.wait({key}, milliseconds_of(timeout_));
      const std::vector<uint8_t> bytes = store_.get(key);
      return {bytes.begin(), bytes.end()};
    } catch (const std::exception& error) {
      throw_not_met(environment_, timeout_, else_why + ": " + first_line(error));
    }
  }
  void check_plan(const std::string& plan, int rank, const std::string& other) const {
    if (other == plan) return;
    throw CommError(words_of(environment_) + " would use " + plan + ", rank " + std::to_string(rank) + " " + other +
                    ". Give all ranks the same program and the same --device");
  }

  const RankEnvironment& environment_;
  c10d::Store& store_;
  double timeout_;
};

#ifdef GRAUPEL_GLOO
/// The network that Gloo uses: loopback on one machine, GLOO_SOCKET_IFNAME where it is set, else this machine's name.
std::shared_ptr<::gloo::transport::Device> gloo_device(const RankEnvironment& environment) {
  if (const auto interface = process_variable("GLOO_SOCKET_IFNAME"))
    return c10d::ProcessGroupGloo::createDeviceForInterface(*interface);
  if (environment.local_size == environment.size) return c10d::ProcessGroupGloo::createDeviceForHostname("127.0.0.1");
  return c10d::ProcessGroupGloo::createDefaultDevice();
}
#endif

Connection connect([[maybe_unused]] const RankEnvironment& environment,
                   [[maybe_unused]] const c10::intrusive_ptr<c10d::Store>& store, [[maybe_unused]] double timeout,
                   [[maybe_unused]] bool nccl) {
#ifdef GRAUPEL_NCCL
  if (nccl) {
    const auto settings = c10d::ProcessGroupNCCL::Options::create();
    settings->timeout = milliseconds_of(timeout);
    const auto group = c10::make_intrusive<c10d::ProcessGroupNCCL>(store, environment.rank, environment.size, settings);
    return {group, at::kCUDA, [group] { group->shutdown(); }};
  }
#endif
#ifdef GRAUPEL_GLOO
  const auto settings = c10d::ProcessGroupGloo::Options::create(milliseconds_of(timeout));
  settings->devices.push_back(gloo_device(environment));
  return {
      c10::make_intrusive<c10d::ProcessGroupGloo>(store, environment.rank, environment.size, settings), at::kCPU, {}};
#else
  throw ConfigError(
      "several ranks on the CPU are not possible (this build has no Gloo: its headers were not found beside libtorch). "
      "Use --device cuda, or build against Debian's libtorch-dev with libgloo-dev");
#endif
}

}  // namespace

bool can_join_ranks([[maybe_unused]] Device device) {
#ifdef GRAUPEL_GLOO
  return true;
#else
  return device == Device::cuda;
#endif
}

std::unique_ptr<Comm> join_ranks(const RankEnvironment& environment, const CommOptions& options) {
#ifdef GRAUPEL_NCCL
  const bool nccl = options.device == Device::cuda;
#else
  const bool nccl = false;
  if (options.device == Device::cuda && options.message)
    options.message("this build has no NCCL: the ranks add their gradients on the CPU, through Gloo");
#endif
  const auto store = open_store(environment, options.timeout);
  const std::string plan = std::string(nccl ? "NCCL" : "Gloo") + " on device " + name_of(options.device);
  Meeting(environment, *store, options.timeout).agree_on(plan);
  try {
    return std::make_unique<ConnectedRanks>(environment, store, connect(environment, store, options.timeout, nccl));
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw CommError(words_of(environment) + ": cannot connect to the other ranks (" + first_line(error) +
                    "). Where machines have several networks, GLOO_SOCKET_IFNAME or NCCL_SOCKET_IFNAME names the one "
                    "that joins them");
  }
}

#else

bool can_join_ranks(Device) { return false; }

std::unique_ptr<Comm> join_ranks(const RankEnvironment& environment, const CommOptions&) {
  throw ConfigError("training on " + std::to_string(environment.size) +
                    " processes is not possible (this build has neither Gloo nor NCCL). Install libgloo-dev and build "
                    "anew, or start one process");
}

#endif

}  // namespace graupel::train
