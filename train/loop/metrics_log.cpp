#include "train/loop/metrics_log.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/system/atomic_file.h"
#include "core/system/error.h"

namespace graupel::train {

namespace {

double now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

/// The lines of `path` that `keep` accepts.
template <typename Keep>
std::string kept_lines(const std::string& path, const Keep& keep) {
  if (!std::filesystem::exists(path)) return "";
  std::istringstream lines(read_file(path));
  std::string kept;
  for (std::string line; std::getline(lines, line);)
    if (keep(line)) kept += line + "\n";
  return kept;
}

int64_t step_of_json(const std::string& line) {
  const auto row = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
  return row.is_object() ? row.value("step", int64_t{-1}) : -1;
}

}  // namespace

MetricsLog::MetricsLog(const std::string& folder, std::vector<std::string> columns, int64_t last_step)
    : folder_(folder), columns_(std::move(columns)), events_(folder, now()) {
  std::string head = "step";
  for (const std::string& name : columns_) head += "," + name;
  const std::string csv_path = folder + "/metrics.csv", jsonl_path = folder + "/metrics.jsonl";
  const std::string rows = kept_lines(csv_path, [&](const std::string& line) {
    const int64_t step = std::strtoll(line.c_str(), nullptr, 10);
    // A kill may have cut the last line short.
    return step > 0 && step <= last_step &&
           std::count(line.begin(), line.end(), ',') == static_cast<std::ptrdiff_t>(columns_.size());
  });
  write_file_atomically(csv_path, head + "\n" + rows);
  write_file_atomically(jsonl_path, kept_lines(jsonl_path, [&](const std::string& line) {
                          const int64_t step = step_of_json(line);
                          return step > 0 && step <= last_step;
                        }));
  csv_.open(csv_path, std::ios::app);
  jsonl_.open(jsonl_path, std::ios::app);
}

void MetricsLog::write(int64_t step, const Values& values) {
  std::ostringstream row;
  row.precision(9);
  row << step;
  nlohmann::ordered_json object = {{"step", step}};
  for (const std::string& name : columns_) {
    row << ",";
    const auto found = std::find_if(values.begin(), values.end(), [&](const auto& v) { return v.first == name; });
    if (found == values.end()) continue;
    row << found->second;
    if (std::isfinite(found->second))
      object[name] = found->second;
    else
      object[name] = nullptr;
    events_.scalar(now(), step, name, found->second);
  }
  csv_ << row.str() << "\n" << std::flush;
  jsonl_ << object.dump() << "\n" << std::flush;
  events_.flush();
  if (!csv_ || !jsonl_)
    throw IoError("cannot write '" + folder_ + "/metrics.csv' and metrics.jsonl. Free space on that disk, then go on " +
                  "with --resume");
}

}  // namespace graupel::train
