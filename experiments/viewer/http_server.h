// A small HTTP/1.1 server on this machine's loopback address: a thread for each connection, kept alive between
// requests.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "experiments/viewer/http_message.h"

namespace graupel::experiments {

struct HttpResponse {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string text;                                 ///< the body, unless there is `content`
  std::shared_ptr<const HttpContent> content = {};  ///< a body of which ranges are sent
};

/// Called from several threads. An HttpError becomes its status; another error 500 with its text.
using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

class HttpServer {
 public:
  /// Listens on 127.0.0.1, on any free port for 0. Throws ConfigError for a port in use, IoError.
  HttpServer(int port, HttpHandler handler);
  /// Ends all connections. Reads of content that wait must be released before.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const { return port_; }

 private:
  struct Connection {
    int socket = -1;
    bool done = false;
    std::thread thread = {};
  };
  void accept_connections();
  void start_connection(int socket);
  void serve(int socket);
  bool answer(int socket, const std::string& head);
  void drop_finished();

  HttpHandler handler_;
  int listener_ = -1, port_ = 0;
  int wake_[2] = {-1, -1};  ///< a pipe: closed to end accept_connections()
  std::mutex mutex_;
  std::list<Connection> connections_;
  std::thread acceptor_;
};

}  // namespace graupel::experiments
