// What the page may ask for: fixed routes below a secret word, each a file of the page, facts, or bytes of a run. No
// part of an address ever names a file.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "experiments/viewer/frame_source.h"
#include "experiments/viewer/http_server.h"

namespace graupel::experiments {

/// One side of the page.
class ViewerSide {
 public:
  /// `begin` makes the source of run 0, 1, ...; it is called once here. Throws what it throws.
  explicit ViewerSide(std::function<std::shared_ptr<FrameSource>(uint32_t run)> begin);

  std::shared_ptr<FrameSource> source() const;
  /// Begins anew; where that fails the run that was stays. Throws what `begin` throws.
  void restart();

 private:
  std::function<std::shared_ptr<FrameSource>(uint32_t)> begin_;
  mutable std::mutex mutex_;
  std::shared_ptr<FrameSource> source_;
  uint32_t run_ = 0;
};

class ViewerRoutes {
 public:
  /// `sides` must outlive the routes.
  ViewerRoutes(std::string token, std::vector<std::unique_ptr<ViewerSide>>& sides)
      : token_(std::move(token)), sides_(sides) {}

  /// Requests are answered only for http://127.0.0.1:port and http://localhost:port.
  void set_port(int port) { port_ = port; }

  /// Throws HttpError 403 without the token, and for another Host or Origin; 404 and 405.
  HttpResponse answer(const HttpRequest& request) const;

 private:
  void check_sender(const HttpRequest& request) const;
  HttpResponse get(const std::string& path) const;
  HttpResponse post(const std::string& path) const;

  std::string token_;
  std::vector<std::unique_ptr<ViewerSide>>& sides_;
  std::atomic<int> port_ = 0;  ///< known once the server listens
};

/// 32 hexadecimal digits from the system's random numbers. Throws IoError.
std::string random_token();

}  // namespace graupel::experiments
