#include "experiments/inspection/doctor.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "core/parallel/cuda_runtime.h"
#include "core/parallel/device.h"
#include "core/parallel/hardware.h"
#include "core/parallel/instruction_set.h"
#include "core/parallel/memory.h"
#include "core/parallel/parallel_for.h"
#include "core/system/checks/file_check.h"
#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/process/sibling_program.h"
#include "nn/bf16_gemm.h"

namespace graupel::experiments {

namespace {

constexpr double gibibyte = 1024.0 * 1024.0 * 1024.0;

/// Seconds of `items` pieces of arithmetic of one size.
double seconds_of(int64_t items) {
  std::vector<double> result(static_cast<std::size_t>(items));
  Stopwatch watch;
  parallel_for_cpu(items,
                   [&](int64_t i) {
                     double x = 1 + static_cast<double>(i);
                     for (int k = 0; k < 4'000'000; ++k) x = x * 0.999999 + 1e-7;
                     result[static_cast<std::size_t>(i)] = x;
                   },
                   {1});
  return watch.seconds() + (result[0] > 1e300 ? 1 : 0);
}

/// How many times the arithmetic of one thread all threads do: by the least times of some tries, in turn, since other
/// programs make some longer. More tries where one thread was held up in all, which gives more than there are threads.
double parallel_speed() {
  const int threads = num_threads();
  if (threads == 1) return 1;
  constexpr int usual = 3, most = 12;
  double alone = 1e30, all = 1e30;
  for (int t = 0; t < usual || (t < most && threads * alone > 1.1 * threads * all); ++t) {
    alone = std::min(alone, seconds_of(1));
    all = std::min(all, seconds_of(threads));
  }
  return std::min<double>(threads, threads * alone / all);
}

/// Files of this process' libraries, by what /proc tells, of those that matter for results and speed.
std::vector<std::string> libraries() {
  std::set<std::string> found;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const auto slash = line.find('/');
    if (slash == std::string::npos) continue;
    const std::string file = std::filesystem::path(line.substr(slash)).filename();
    for (const char* name : {"libhdf5", "libopenvdb", "libtbb.", "libgomp", "libopenblas", "libtorch", "libcudart"})
      if (file.starts_with(name)) found.insert(file);
  }
  return {found.begin(), found.end()};
}

bool is_installed(const std::string& program) {
  const char* const path = std::getenv("PATH");
  std::string folders = path == nullptr ? "" : path;
  for (std::size_t begin = 0; begin < folders.size();) {
    const std::size_t end = std::min(folders.find(':', begin), folders.size());
    if (::access((folders.substr(begin, end - begin) + "/" + program).c_str(), X_OK) == 0) return true;
    begin = end + 1;
  }
  return false;
}

bool is_there(const SiblingProgram& program) {
  try {
    return !path_of(program).empty();
  } catch (const ConfigError&) {
    return false;
  }
}

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

double load_average() {
  double load = 0;
  std::ifstream("/proc/loadavg") >> load;
  return load;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "none" : text;
}

void examine_processor(MachineReport& report) {
  const auto sets = available_instruction_sets();
  std::vector<std::string> names;
  names.reserve(sets.size());
  for (const InstructionSet set : sets) names.emplace_back(name_of(set));
  const int threads = num_threads(), cores = static_cast<int>(std::thread::hardware_concurrency());
  report.facts.push_back({"processor", processor_name()});
  report.facts.push_back({"threads", fmt::format("{} of {} logical processors", threads, cores)});
  report.facts.push_back(
      {"instruction set", fmt::format("{} (available: {})", name_of(instruction_set()), joined(names))});
  report.facts.push_back({"matrix products of networks", nn::gemm_precision_name()});
  report.facts.push_back({"memory available", fmt::format("{:.1f} GiB", available_bytes(Device::cpu) / gibibyte)});
  if (instruction_set() != sets.back())
    report.hints.push_back(fmt::format("kernels run with {} (GRAUPEL_SIMD={}, available: {}). Unset GRAUPEL_SIMD",
                                       name_of(instruction_set()), environment("GRAUPEL_SIMD"), joined(names)));
  if (sets.back() == InstructionSet::baseline)
    report.hints.emplace_back(
        "the processor has no AVX2 (kernels run with baseline, about half as fast). Use another machine for large "
        "scenes");
  if (nn::bf16_units_in_use() != nn::fastest_bf16_units())
    report.hints.push_back(
        fmt::format("networks multiply without the fastest units (GRAUPEL_PRODUCTS={}). Unset GRAUPEL_PRODUCTS",
                    environment("GRAUPEL_PRODUCTS")));
  if (threads < cores) {
    const std::string asked = environment("OMP_NUM_THREADS");
    report.hints.push_back(fmt::format("{} of {} logical processors are used ({}). Ask for more", threads, cores,
                                       asked.empty()
                                           ? "by --threads, or since the system lets this process have no others"
                                           : "by --threads or OMP_NUM_THREADS=" + asked));
  }
  const double speed = parallel_speed(), share = speed / threads;
  report.facts.push_back({"arithmetic of all threads", fmt::format("{:.1f} times that of one", speed)});
  const double load = load_average();
  report.facts.push_back({"load average", fmt::format("{:.1f}", load)});
  if (share < 0.6)
    report.hints.push_back(
        fmt::format("{} threads do {:.1f} times the work of one (load average {:.1f}): other programs run, threads "
                    "share cores, or a quota holds them back. Take --threads {}",
                    threads, speed, load, std::max(1L, std::lround(speed))));
  else if (load > 1.5 * cores)
    report.hints.push_back(
        fmt::format("other programs want more than the machine has (load average {:.1f}, {} logical processors). Wait "
                    "for them, or take another machine",
                    load, cores));
  if (available_bytes(Device::cpu) < 1.0 * gibibyte)
    report.hints.push_back(
        fmt::format("{:.2f} GiB of memory are available (a million particles take about 1). Free some",
                    available_bytes(Device::cpu) / gibibyte));
#ifndef NDEBUG
  report.hints.emplace_back("this is a debug build (several times slower). Configure with -DCMAKE_BUILD_TYPE=Release");
#endif
}

void examine_gpu(MachineReport& report) {
  if (cuda_available()) {
    report.facts.push_back({"GPU", fmt::format("{} of {}", cuda_device_name(), cuda::device_count())});
    report.facts.push_back(
        {"memory of the GPU available", fmt::format("{:.1f} GiB", available_bytes(Device::cuda) / gibibyte)});
    return;
  }
  report.facts.push_back({"GPU", "none"});
  if (!cuda::is_built_in())
    report.hints.emplace_back(
        "this build has no CUDA. Build where nvcc is, with -DGRAUPEL_CUDA=ON, to use an NVIDIA GPU");
  else if (std::filesystem::exists("/proc/driver/nvidia/version"))
    report.hints.emplace_back("there is an NVIDIA driver, but no GPU can be used (CUDA_VISIBLE_DEVICES='" +
                              environment("CUDA_VISIBLE_DEVICES") +
                              "'). Unset it; where it is not set, the driver is older than this build");
}

/// Whether files of this kind can be checked before they are read, and by what.
void examine_checker(const char* kind, FileFormat format, MachineReport& report) {
  const std::string name = fmt::format("check of {} files", kind), checker = checker_of(format);
  if (checks_are_off()) {
    report.facts.push_back({name, "off (GRAUPEL_CHECKERS=none)"});
    return;
  }
  try {
    if (checker.empty() && std::getenv("GRAUPEL_CHECKERS") == nullptr) {
      report.facts.push_back({name, "not there: files are read unchecked"});
      return;
    }
    check_file("/proc/self/exe", format);  // of another kind, which is no matter: the checker answers
    report.facts.push_back({name, checker + " runs"});
  } catch (const Error& error) {
    report.facts.push_back({name, checker.empty() ? "not there" : checker + " does not run"});
    report.hints.push_back(fmt::format("no {} file can be read: {}", kind, error.what()));
  }
}

void examine_programs(MachineReport& report) {
  report.facts.push_back({"libraries", joined(libraries())});
  report.facts.push_back({"graupel-train", is_there(training_program) ? "there" : "not there: train, launch"});
  report.facts.push_back({"graupel-bench", is_there(bench_program) ? "there" : "not there: bench"});
  report.facts.push_back({"python3", is_installed("python3") ? "there" : "not there: convert of data sets"});
  report.facts.push_back({"ffmpeg", is_installed("ffmpeg") ? "there" : "not there: videos"});
  examine_checker("HDF5", FileFormat::hdf5, report);
  examine_checker("VDB", FileFormat::vdb, report);
}

}  // namespace

MachineReport examine_machine() {
  MachineReport report;
  examine_processor(report);
  examine_gpu(report);
  examine_programs(report);
  return report;
}

void doctor(CommonOptions& options) {
  options.apply();
  const MachineReport report = examine_machine();
  nlohmann::ordered_json result = {{"kind", "machine"}, {"facts", nlohmann::ordered_json::object()}};
  for (const MachineFact& fact : report.facts) result["facts"][fact.name] = fact.value;
  result["hints"] = report.hints;
  options.write_json(result);
  for (const MachineFact& fact : report.facts) std::printf("%-30s %s\n", fact.name.c_str(), fact.value.c_str());
  for (const std::string& hint : report.hints) std::printf("\nhint: %s\n", hint.c_str());
  if (report.hints.empty()) std::printf("\nnothing here makes runs slow\n");
}

}  // namespace graupel::experiments
