#include "experiments/viewer/http_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

constexpr std::size_t most_connections = 64;
constexpr std::size_t piece_bytes = std::size_t(1) << 20;  ///< of content that is read and sent at once
constexpr int idle_seconds = 30;                           ///< between requests, and within one

[[noreturn]] void throw_system_error(const std::string& what) {
  throw IoError(what + " (" + std::strerror(errno) + "). Check that this machine has its loopback network");
}

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

void set_time_limit(int socket, int option) {
  const timeval limit{.tv_sec = idle_seconds, .tv_usec = 0};
  ::setsockopt(socket, SOL_SOCKET, option, &limit, sizeof limit);
}

bool send_all(int socket, const void* data, std::size_t count, int flags) {
  const char* at = static_cast<const char*>(data);
  while (count > 0) {
    const ssize_t sent = ::send(socket, at, count, flags | MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    at += sent;
    count -= static_cast<std::size_t>(sent);
  }
  return true;
}

bool send_text(int socket, int status, const std::string& type, const std::string& text, bool keep_alive) {
  const std::string whole = http_response_head(status, type, text.size(), std::nullopt, keep_alive) + text;
  return send_all(socket, whole.data(), whole.size(), 0);
}

/// An answer to HEAD has no text.
bool send_error(int socket, const HttpError& error, bool keep_alive, bool with_text = true) {
  const std::string text = error.what(),
                    head = http_response_head(error.status, "text/plain; charset=utf-8", text.size(), std::nullopt,
                                              keep_alive, error.fields),
                    whole = with_text ? head + text : head;
  return send_all(socket, whole.data(), whole.size(), 0);
}

/// The first piece is made before anything is sent, so that its error can still be told.
bool send_content(int socket, const HttpContent& content, const std::optional<ByteRange>& range,
                  const std::string& type, bool keep_alive) {
  const uint64_t size = content.size();
  uint64_t first = range ? range->first : 0, left = range ? range->count : size;
  thread_local std::vector<std::byte> piece(piece_bytes);
  const std::string head = http_response_head(range ? 206 : 200, type, size, range, keep_alive);
  for (bool begun = false; left > 0; begun = true) {
    const auto count = static_cast<std::size_t>(std::min<uint64_t>(left, piece_bytes));
    content.read(first, std::span(piece.data(), count));
    if (!begun && !send_all(socket, head.data(), head.size(), MSG_MORE)) return false;
    left -= count;
    first += count;
    if (!send_all(socket, piece.data(), count, left > 0 ? MSG_MORE : 0)) return false;
  }
  return true;
}

/// The next head, with its blank line; "" where the other side is done or sends nothing for too long.
std::string receive_head(int socket, std::string& received) {
  while (true) {
    if (const auto end = received.find("\r\n\r\n"); end != std::string::npos) {
      std::string head = received.substr(0, end + 4);
      received.erase(0, end + 4);
      return head;
    }
    if (received.size() > most_head_bytes) throw HttpError(431, "the head of the request is too long");
    char buffer[4096];
    const ssize_t count = ::recv(socket, buffer, sizeof buffer, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return "";
    received.append(buffer, static_cast<std::size_t>(count));
  }
}

}  // namespace

HttpServer::HttpServer(int port, HttpHandler handler) : handler_(std::move(handler)) {
  listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (listener_ < 0) throw_system_error("cannot open a socket");
  const int yes = 1;  // a port that was left a moment ago may be used again; one that is listened on may not
  ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address = loopback(port);
  socklen_t length = sizeof address;
  const bool listens = ::bind(listener_, reinterpret_cast<sockaddr*>(&address), length) == 0 &&
                       ::listen(listener_, 64) == 0 &&
                       ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length) == 0;
  if (!listens) {
    const int problem = errno;
    ::close(listener_);
    if (problem == EADDRINUSE || problem == EACCES)
      throw ConfigError("port " + std::to_string(port) + " cannot be used (" + std::strerror(problem) + "). Give " +
                        (problem == EACCES ? "one from 1024 to 65535" : "another") +
                        " by --port, or leave --port out: a free one is then taken");
    errno = problem;
    throw_system_error("cannot listen on 127.0.0.1:" + std::to_string(port));
  }
  port_ = ntohs(address.sin_port);
  if (::pipe2(wake_, O_CLOEXEC) != 0) {
    ::close(listener_);
    throw_system_error("cannot open a pipe");
  }
  acceptor_ = std::thread([this] { accept_connections(); });
}

HttpServer::~HttpServer() {
  ::close(wake_[1]);
  acceptor_.join();
  {
    const std::lock_guard lock(mutex_);
    for (const Connection& connection : connections_)
      if (!connection.done) ::shutdown(connection.socket, SHUT_RDWR);
  }
  for (Connection& connection : connections_) connection.thread.join();
  ::close(wake_[0]);
  ::close(listener_);
}

void HttpServer::accept_connections() {
  while (true) {
    pollfd ready[] = {{listener_, POLLIN, 0}, {wake_[0], POLLIN, 0}};
    if (::poll(ready, 2, -1) < 0 && errno != EINTR) return;
    if (ready[1].revents != 0) return;
    if ((ready[0].revents & POLLIN) == 0) continue;
    const int socket = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket >= 0) start_connection(socket);
  }
}

void HttpServer::start_connection(int socket) {
  drop_finished();
  const std::lock_guard lock(mutex_);
  if (connections_.size() >= most_connections) {
    send_text(socket, 503, "text/plain", "too many connections", false);
    ::close(socket);
    return;
  }
  set_time_limit(socket, SO_RCVTIMEO);
  set_time_limit(socket, SO_SNDTIMEO);
  const int yes = 1;
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  Connection& connection = connections_.emplace_back();
  connection.socket = socket;
  try {
    connection.thread = std::thread([this, &connection] {
      serve(connection.socket);
      const std::lock_guard done_lock(mutex_);
      ::close(connection.socket);
      connection.done = true;
    });
  } catch (const std::system_error&) {
    connections_.pop_back();
    send_text(socket, 503, "text/plain", "the system starts no more threads", false);
    ::close(socket);
  }
}

void HttpServer::drop_finished() {
  const std::lock_guard lock(mutex_);
  connections_.remove_if([](Connection& connection) {
    if (connection.done) connection.thread.join();
    return connection.done;
  });
}

void HttpServer::serve(int socket) {
  std::string received;
  try {
    for (std::string head; !(head = receive_head(socket, received)).empty();)
      if (!answer(socket, head)) return;
  } catch (const HttpError& error) {
    send_error(socket, error, /*keep_alive=*/false);
  }
}

/// Whether the connection stays open.
bool HttpServer::answer(int socket, const std::string& head) {
  const HttpRequest request = parse_http_request(head);
  const auto refuse = [&](const HttpError& error) {
    return send_error(socket, error, request.keep_alive, request.method != "HEAD");
  };
  bool sent = false;
  try {
    const HttpResponse response = handler_(request);
    if (response.content)
      sent = send_content(socket, *response.content, parse_byte_range(request.field("range"), response.content->size()),
                          response.type, request.keep_alive);
    else
      sent = send_text(socket, response.status, response.type, response.text, request.keep_alive);
  } catch (const HttpError& error) {
    sent = refuse(error);
  } catch (const std::exception& error) {
    refuse(HttpError(500, error.what()));  // of content it may come in the middle: the connection ends
  }
  return sent && request.keep_alive;
}

}  // namespace graupel::experiments
