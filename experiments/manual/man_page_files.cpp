#include "experiments/manual/man_page_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <system_error>

#include "core/system/atomic_file.h"
#include "core/system/edit_distance.h"
#include "core/system/error.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

namespace {

namespace fs = std::filesystem;

/// YYYY-MM-DD in UTC.
std::string date_of_program() {
  std::time_t seconds = 0;
  struct stat status {};
  if (const char* epoch = std::getenv("SOURCE_DATE_EPOCH"))
    seconds = std::strtoll(epoch, nullptr, 10);
  else if (::stat("/proc/self/exe", &status) == 0)
    seconds = status.st_mtime;
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  return fmt::format("{:04}-{:02}-{:02}", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday);
}

}  // namespace

std::vector<ManPage> program_man_pages(const CommandDescription& program) {
  return man_pages(program, version_text(), date_of_program());
}

const ManPage& find_page(const std::vector<ManPage>& pages, const std::vector<std::string>& command) {
  std::string name = pages.front().name;
  for (const std::string& word : command) name += "-" + word;
  std::vector<std::string> known;
  for (const ManPage& page : pages) {
    if (page.name == name) return page;
    known.push_back(page.name);
  }
  const std::string close = closest_of(name, known);
  throw ConfigError(fmt::format("there is no man page '{}'{}. 'graupel --help' lists the commands", name,
                                close.empty() ? "" : " (the closest is '" + close + "')"));
}

void write_pages(const std::vector<ManPage>& pages, const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw IoError(fmt::format("cannot make the folder '{}' ({}). Choose another one", folder, error.message()));
  for (const ManPage& page : pages) write_file_atomically((fs::path(folder) / (page.name + ".1")).string(), page.text);
}

}  // namespace graupel::experiments
