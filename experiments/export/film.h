// Pictures of a run as a film: ffmpeg encodes it, where it is installed.
#pragma once

#include <sys/types.h>

#include <string>

#include "compare/pictures/image.h"
#include "core/system/unfinished_file.h"

namespace graupel::experiments {

/// Throws ConfigError where the program that makes films (mp4, gif) is not installed.
void check_film_program(const std::string& format);

/// A film that grows by a picture at a time, in the order of the pictures.
class Film {
 public:
  /// `format` is mp4 (H.264) or gif, `rate` the pictures a second, from 1 to 240; all pictures have this size, which is
  /// even along both edges.
  Film(const std::string& path, const std::string& format, double rate, int width, int height);
  /// Leaves nothing behind unless finish() was called.
  ~Film();
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  /// Throws IoError with ffmpeg's last words where it ended.
  void add(const compare::Image& picture);
  /// Waits for ffmpeg and gives the film its name.
  void finish();

 private:
  [[noreturn]] void fail();

  std::string path_;
  UnfinishedFile part_, log_;
  pid_t process_ = -1;
  int pictures_ = -1;  ///< file descriptor that ffmpeg reads from
  void (*sigpipe_before_)(int) = nullptr;
};

}  // namespace graupel::experiments
