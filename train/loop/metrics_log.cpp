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

/// The whole lines of `path` that `keep` accepts: a kill may have cut the last one short.
template <typename Keep>
std::string kept_lines(const std::string& path, const Keep& keep) {
  if (!std::filesystem::exists(path)) return "";
  std::istringstream lines(read_file(path));
  std::string kept;
  for (std::string line; std::getline(lines, line);)
    if (!lines.eof() && keep(line)) kept += line + "\n";
  return kept;
}

/// What tells the rows of one step apart: which columns they have.
template <typename Has>
std::string kind_of_row(int64_t step, const std::vector<std::string>& columns, const Has& has) {
  std::string kind = std::to_string(step);
  for (const std::string& name : columns) kind += has(name) ? ",1" : ",0";
  return kind;
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line)
    if (c == ',')
      cells.emplace_back();
    else
      cells.back() += c;
  return cells;
}

}  // namespace

MetricsLog::MetricsLog(const std::string& folder, std::vector<std::string> columns, int64_t last_step)
    : folder_(folder), columns_(std::move(columns)), events_(folder, now()) {
  std::string head = "step";
  for (const std::string& name : columns_) head += "," + name;
  const std::string csv_path = folder + "/metrics.csv", jsonl_path = folder + "/metrics.jsonl";
  const auto is_kept = [&](int64_t step) { return step > 0 && step <= last_step; };
  const std::string rows = kept_lines(csv_path, [&](const std::string& line) {
    const int64_t step = std::strtoll(line.c_str(), nullptr, 10);
    const std::vector<std::string> cells = cells_of(line);
    if (!is_kept(step) || cells.size() != columns_.size() + 1) return false;
    std::size_t column = 0;
    csv_rows_.insert(kind_of_row(step, columns_, [&](const std::string&) { return !cells[++column].empty(); }));
    return true;
  });
  const std::string objects = kept_lines(jsonl_path, [&](const std::string& line) {
    const auto row = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
    const bool tells_step = row.is_object() && row.contains("step") && row.at("step").is_number_integer();
    const int64_t step = tells_step ? row.at("step").get<int64_t>() : -1;
    if (!is_kept(step)) return false;
    jsonl_rows_.insert(kind_of_row(step, columns_, [&](const std::string& name) { return row.contains(name); }));
    return true;
  });
  write_file_atomically(csv_path, head + "\n" + rows);
  write_file_atomically(jsonl_path, objects);
  csv_.open(csv_path, std::ios::app);
  jsonl_.open(jsonl_path, std::ios::app);
}

void MetricsLog::write(int64_t step, const Values& values) {
  const auto value_of = [&](const std::string& name) {
    return std::find_if(values.begin(), values.end(), [&](const auto& v) { return v.first == name; });
  };
  const std::string kind =
      kind_of_row(step, columns_, [&](const std::string& name) { return value_of(name) != values.end(); });
  const bool in_csv = csv_rows_.contains(kind);
  std::ostringstream row;
  row.precision(9);
  row << step;
  nlohmann::ordered_json object = {{"step", step}};
  for (const std::string& name : columns_) {
    row << ",";
    const auto found = value_of(name);
    if (found == values.end()) continue;
    row << found->second;
    if (std::isfinite(found->second))
      object[name] = found->second;
    else
      object[name] = nullptr;
    if (!in_csv) events_.scalar(now(), step, name, found->second);
  }
  if (!in_csv) csv_ << row.str() << "\n" << std::flush;
  if (!jsonl_rows_.contains(kind)) jsonl_ << object.dump() << "\n" << std::flush;
  events_.flush();
  if (!csv_ || !jsonl_)
    throw IoError("cannot write '" + folder_ + "/metrics.csv' and metrics.jsonl. Free space on that disk, then go on " +
                  "with --resume");
}

}  // namespace graupel::train
