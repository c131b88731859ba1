// Ranks as threads of one process that talk through Gloo: what they do together is tested without starting programs.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <exception>
#include <functional>
#include <stdexcept>
#include <thread>
#include <vector>

#include "train/parallel/comm.h"

namespace graupel::train {

/// A port that nothing listens on.
inline int free_port() {
  const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  if (::bind(listener, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::runtime_error("no free port");
  ::close(listener);
  return ntohs(address.sin_port);
}

inline RankEnvironment local_rank(int rank, int size, int port) {
  RankEnvironment environment;
  environment.launcher = "test";
  environment.rank = environment.local_rank = rank;
  environment.size = environment.local_size = size;
  environment.address = "127.0.0.1";
  environment.port = port;
  return environment;
}

/// Calls `body` once for each rank; returns what each threw, null for nothing.
inline std::vector<std::exception_ptr> run_ranks(int size, const std::function<void(Comm&)>& body,
                                                 double timeout = 60) {
  const int port = free_port();
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(size));
  std::vector<std::thread> threads;
  for (int rank = 0; rank < size; ++rank)
    threads.emplace_back([&, rank] {
      try {
        const auto comm = join_ranks(local_rank(rank, size, port), {Device::cpu, timeout, {}});
        body(*comm);
      } catch (...) {
        errors[static_cast<std::size_t>(rank)] = std::current_exception();
      }
    });
  for (std::thread& thread : threads) thread.join();
  return errors;
}

/// The message of what was thrown, empty for nothing.
inline std::string message_of(const std::exception_ptr& error) {
  if (!error) return "";
  try {
    std::rethrow_exception(error);
  } catch (const std::exception& e) {
    return e.what();
  }
}

}  // namespace graupel::train
