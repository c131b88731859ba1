#include "experiments/process/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "core/system/printable.h"

namespace graupel::experiments {

Progress::Progress(const std::string& label, int64_t total)
    : label_(printable(label)),
      total_(total),
      terminal_(::isatty(STDERR_FILENO) == 1),
      start_(Clock::now()),
      last_print_(start_) {}

Progress::~Progress() {
  if (!finished_ && terminal_ && printed_) std::fputs("\n", stderr);
}

void Progress::update(int64_t done, const std::string& detail) {
  const auto now = Clock::now();
  const double interval = terminal_ ? 0.1 : 10;
  if (std::chrono::duration<double>(now - last_print_).count() < interval) return;
  last_print_ = now;
  print(done, detail, false);
}

void Progress::done() {
  if (finished_) return;
  finished_ = true;
  print(total_, "", true);
}

void Progress::print(int64_t done, const std::string& detail, bool last) {
  if (total_ == 0) return;
  const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
  std::string line;
  if (last) {
    if (!terminal_ && elapsed < 2) return;
    line = fmt::format("{}: done in {}", label_, human_time(elapsed));
  } else {
    const double left = done > 0 ? elapsed * static_cast<double>(total_ - done) / static_cast<double>(done) : 0;
    line = fmt::format("{}: {}/{} ({:.0f}%), {} left{}{}", label_, done, total_,
                       100.0 * static_cast<double>(done) / static_cast<double>(total_), human_time(left),
                       detail.empty() ? "" : ", ", detail);
  }
  printed_ = true;
  if (terminal_)
    std::fprintf(stderr, "\r\033[K%s%s", line.c_str(), last ? "\n" : "");
  else
    std::fprintf(stderr, "%s\n", line.c_str());
  std::fflush(stderr);
}

std::string human_bytes(double bytes) {
  const char* units[] = {"B", "KB", "MB", "GB", "TB"};
  int u = 0;
  while (bytes >= 1000 && u < 4) {
    bytes /= 1000;
    ++u;
  }
  return fmt::format("{:.{}f} {}", bytes, u == 0 ? 0 : 1, units[u]);
}

}  // namespace graupel::experiments
