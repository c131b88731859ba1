#include "experiments/export/film.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/process/process.h"
#include "io/config/config_document.h"

namespace graupel::experiments {

namespace {

namespace fs = std::filesystem;

/// Whether a program of this name is in a folder of PATH.
bool is_installed(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::string folders = path != nullptr ? path : "/usr/bin:/bin";
  folders += ':';
  for (std::size_t at = 0, end; (end = folders.find(':', at)) != std::string::npos; at = end + 1)
    if (::access((fs::path(folders.substr(at, end - at)) / program).c_str(), X_OK) == 0) return true;
  return false;
}

/// A GIF has 256 colours: they are chosen from the film's own.
std::vector<std::string> encoder_of(const std::string& format) {
  if (format == "gif")
    return {"-filter_complex", "split[a][b];[a]palettegen[p];[b][p]paletteuse", "-loop", "0", "-f", "gif"};
  // yuv420p is what all players read; faststart lets them begin before they have the whole file.
  return {"-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"};
}

/// The last line that is not empty.
std::string last_line(const std::string& file) {
  std::ifstream stream(file);
  std::string last;
  for (std::string line; std::getline(stream, line);)
    if (!line.empty()) last = line.substr(0, 300);
  return last;
}

}  // namespace

void check_film_program(const std::string& format) {
  if (!is_installed("ffmpeg"))
    throw ConfigError("a film (." + format + ") is made by ffmpeg, which is not in PATH. Install it (Debian: apt-get " +
                      "install ffmpeg), or choose --format png for single pictures");
}

Film::Film(const std::string& path, const std::string& format, double rate, int width, int height)
    : path_(path), part_(path + ".part"), log_(path + ".log.part") {
  std::vector<std::string> words = {"-nostdin", "-hide_banner", "-loglevel", "error", "-y"};
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  for (const std::string& word :
       {std::string("-f"), std::string("rawvideo"), std::string("-pix_fmt"), std::string("rgb24"), std::string("-s"),
        size, std::string("-r"), number_text(rate), std::string("-i"), std::string("pipe:0")})
    words.push_back(word);
  for (const std::string& word : encoder_of(format)) words.push_back(word);
  words.push_back("file:" + part_.path());
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    throw Error(ExitCode::failed, std::string("no pipe to ffmpeg could be made (") + std::strerror(errno) + ")");
  process_ = ::fork();
  if (process_ < 0) {
    ::close(ends[0]);
    ::close(ends[1]);
    throw Error(ExitCode::failed, std::string("ffmpeg cannot be started (") + std::strerror(errno) + ")");
  }
  if (process_ == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::signal(SIGINT, SIG_IGN);  // Ctrl-C reaches the whole group; the film ends with the pictures
    ::dup2(ends[0], STDIN_FILENO);
    const int log = ::open(log_.path().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (log >= 0) {
      ::dup2(log, STDOUT_FILENO);
      ::dup2(log, STDERR_FILENO);
    }
    execute("ffmpeg", words);
    ::_exit(127);
  }
  ::close(ends[0]);
  pictures_ = ends[1];
  sigpipe_before_ = ::signal(SIGPIPE, SIG_IGN);  // write() then tells that ffmpeg has ended
}

Film::~Film() {
  if (pictures_ >= 0) ::close(pictures_);
  if (process_ > 0) {
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  ::signal(SIGPIPE, sigpipe_before_);
}

void Film::fail() {
  const std::string said = last_line(log_.path());
  throw IoError("ffmpeg did not write '" + path_ + "' (" + (said.empty() ? "it said nothing" : said) +
                "). Free space there, choose another folder, or --format png for single pictures");
}

void Film::add(const compare::Image& picture) {
  const char* bytes = reinterpret_cast<const char*>(picture.rgb.data());
  for (std::size_t left = picture.rgb.size(); left > 0;) {
    const ssize_t written = ::write(pictures_, bytes, left);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    bytes += written;
    left -= static_cast<std::size_t>(written);
  }
}

void Film::finish() {
  ::close(pictures_);
  pictures_ = -1;
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) fail();
  finish_part_file(path_);
  part_.keep();
}

}  // namespace graupel::experiments
