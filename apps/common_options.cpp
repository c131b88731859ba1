#include "apps/common_options.h"

#include <csignal>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/error.h"

namespace graupel::apps {

namespace {
volatile std::sig_atomic_t stop_signal = 0;
extern "C" void remember_signal(int signal) { stop_signal = signal; }
}  // namespace

void CommonOptions::add_to(CLI::App& verb) {
  verb.add_option("--seed", seed, "Seed of all random numbers")->each([this](const std::string&) {
    seed_given = true;
  });
  verb.add_option("--device", device, "auto, cpu or cuda")->capture_default_str();
  verb.add_option("--threads", threads, "CPU threads (0: all)")->check(CLI::Range(0, 4096))->capture_default_str();
  verb.add_option("--json", json, "Write the result as JSON to this file (-: standard output)");
}

Device CommonOptions::apply() {
  set_num_threads(threads);
  return parse_device(device);
}

void CommonOptions::write_json(const nlohmann::ordered_json& result) const {
  if (!json.empty()) write_file_atomically(json, result.dump(2) + "\n");
}

bool interrupted() { return stop_signal != 0; }

void stop_if_interrupted(const std::string& what_now) {
  if (interrupted()) throw Error(ExitCode::interrupted, "interrupted" + what_now);
}

void install_signal_handlers() {
  struct sigaction action {};
  action.sa_handler = remember_signal;
  action.sa_flags = SA_RESETHAND;  // a second Ctrl-C stops at once
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

std::string version_text() { return "graupel " GRAUPEL_VERSION; }

}  // namespace graupel::apps
