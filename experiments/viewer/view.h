// graupel view: stored and running simulations in a page of the browser, served on this machine alone.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "experiments/process/common_options.h"
#include "experiments/viewer/http_server.h"
#include "experiments/viewer/viewer_routes.h"

namespace graupel::experiments {

struct ViewOptions {
  CommonOptions common;
  std::vector<std::string> files;  ///< one or two: trajectories, and scenes (JSON), which are run
  std::vector<std::string> set;    ///< changes of the scenes' keys
  int trajectory = 0;              ///< of data sets
  int port = 0;                    ///< 0: a free one
};

/// The runs and the server, for as long as it lives.
class Viewer {
 public:
  /// Throws ConfigError and InputError for files that cannot be shown and a port in use.
  explicit Viewer(const ViewOptions& options, Device device);
  ~Viewer();

  /// The page's address, with its secret word.
  std::string address() const;
  /// What a user should know of the files; a line each.
  std::vector<std::string> notes() const;

 private:
  std::string token_;
  std::vector<std::unique_ptr<ViewerSide>> sides_;
  std::unique_ptr<ViewerRoutes> routes_;
  std::unique_ptr<HttpServer> server_;
};

/// Prints the address and serves until Ctrl-C or SIGTERM, which is the way to end it.
void view(ViewOptions& options);

}  // namespace graupel::experiments
