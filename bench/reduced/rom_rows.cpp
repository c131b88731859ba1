#include "bench/reduced/rom_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

namespace graupel::bench {

using namespace experiments;

using Json = nlohmann::ordered_json;

namespace {

Json json_of(const BaselineErrors& errors) {
  return {{"delta", errors.delta}, {"displacement_relative_error", errors.displacement_relative}};
}

Json cost_json(const RomMeasurement& m) {
  const rom::StepTiming& t = m.statistics.timing;
  const auto steps = static_cast<double>(std::max<int64_t>(1, t.steps));
  return {{"integration_mean", m.statistics.mean_integration},
          {"integration_max", m.statistics.most_integration},
          {"steps", t.steps},
          {"reduced_steps", m.statistics.reduced_steps},
          {"seconds", m.seconds},
          {"seconds_per_step",
           {{"decode", t.decode / steps},
            {"grid", t.grid / steps},
            {"inversion", t.inversion / steps},
            {"search", t.search / steps},
            {"gpu", t.device / steps},
            {"all", t.total() / steps}}},
          {"iterations", m.statistics.mean_iterations},
          {"condition", m.statistics.largest_condition},
          {"accounted_bytes", m.statistics.bytes},
          {"process_added_bytes", m.added_bytes}};
}

Json trust_json(const RomMeasurement& m) {
  rom::ErrorIndicator worst;
  Json frames = Json::object();
  for (const rom::ErrorIndicator& frame : m.trust) {
    worst.residual = std::max(worst.residual, frame.residual);
    worst.down_weighted = std::max(worst.down_weighted, frame.down_weighted);
    worst.latent_distance = std::max(worst.latent_distance, frame.latent_distance);
    frames["residual"].push_back(frame.residual);
    frames["down_weighted"].push_back(frame.down_weighted);
    frames["latent_distance"].push_back(frame.latent_distance);
  }
  frames["number"] = m.trust_numbers;
  return {{"number", m.trust_number},
          {"error_bound", m.error_bound ? Json(*m.error_bound) : Json()},
          {"verdict", rom::verdict_text(m.verdict)},
          {"residual", worst.residual},
          {"down_weighted", worst.down_weighted},
          {"latent_distance", worst.latent_distance},
          {"frames", frames}};
}

std::string parameters_text(const RomMeasurement& m) {
  std::string text;
  for (const double value : m.parameters) text += fmt::format("{:g} ", value);
  return text;
}

}  // namespace

Json json_of(const Baselines& naive) {
  Json json = {{"nothing_moves", json_of(naive.nothing_moves)}, {"nearest_run", json_of(naive.nearest)}};
  json["between_runs"] = naive.linear ? json_of(*naive.linear) : Json();
  return json;
}

Json json_of(const SpeedComparison& speed) {
  return {{"against", speed.against},
          {"diverged", speed.diverged},
          {"mpm_seconds_per_frame", speed.mpm_frame},
          {"rom_seconds_per_frame", speed.rom_frame},
          {"speedup", speed.rom_frame > 0 ? speed.mpm_frame / speed.rom_frame : 0},
          {"mpm_substeps_per_frame", speed.substeps},
          {"search_seconds", speed.search_seconds}};
}

Json json_of(const RomMeasurement& m, double factor) {
  Json json = {{"parameters", m.parameters}, {"step_factor", factor}, {"diverged", m.diverged}};
  if (m.diverged) {
    json["trouble"] = m.trouble;
  } else {
    json["delta"] = m.delta;
    json["displacement_relative_error"] = m.displacement_relative;
    json["error_cells"] = m.error_cells;
    if (m.stress) json["stress_error"] = {{"particles", m.stress->particles}, {"clusters", m.stress->clusters}};
  }
  json["samples"] = m.statistics.samples;
  json.update(cost_json(m));
  json["trust"] = trust_json(m);
  json["frame_displacement_relative_error"] = m.frame_error;
  return json;
}

Json json_of(const GpuSteps& steps, double factor) {
  return {{"instances", steps.instances},
          {"step_factor", factor},
          {"us_per_step", steps.median},
          {"us_per_step_low", steps.low},
          {"us_per_step_high", steps.high},
          {"steps_per_frame", steps.steps_per_frame},
          {"integration_mean", steps.statistics.mean_integration},
          {"kernel_seconds", std::map<std::string, double>(steps.kernels.begin(), steps.kernels.end())},
          {"bytes", steps.statistics.bytes},
          {"diverged", steps.diverged}};
}

void print_gpu_steps(const GpuSteps& s) {
  std::printf(
      "on the GPU, %lld instances: %.2f us a step of all (median of %lld frames of %lld steps; %.2f to %.2f), %.3f us "
      "an instance; %lld samples, %.0f integration points, %.2f GB; %lld diverged\neach kernel alone [us]:",
      static_cast<long long>(s.instances), s.median, static_cast<long long>(s.frames),
      static_cast<long long>(s.steps_per_frame), s.low, s.high, s.median / static_cast<double>(s.instances),
      static_cast<long long>(s.statistics.samples), s.statistics.mean_integration,
      1e-9 * static_cast<double>(s.statistics.bytes), static_cast<long long>(s.diverged));
  for (const auto& [name, seconds] : s.kernels) std::printf(" %s %.1f", name.c_str(), 1e6 * seconds);
  std::printf("\n");
}

void print_header() {
  std::printf("%12s %6s %5s %8s %8s %7s %8s | %7s %7s %7s | %6s %7s %-12s | %7s %7s %7s %7s %7s %7s %7s %7s\n",
              "parameters", "factor", "|S|", "delta %", "displ. %", "cells", "stress %", "still %", "near %", "line %",
              "trust", "bound %", "verdict", "|N|", "most", "us/step", "decode", "grid", "invert", "search", "MiB");
}

void print_row(const RomMeasurement& m, double factor, const std::optional<Baselines>& naive) {
  const rom::StepTiming& t = m.statistics.timing;
  const double per_step = 1e6 / static_cast<double>(std::max<int64_t>(1, t.steps));
  std::printf("%12s %6.2f %5lld ", parameters_text(m).c_str(), factor, static_cast<long long>(m.statistics.samples));
  if (m.diverged) {
    std::printf("diverged after %lld steps: %s\n", static_cast<long long>(t.steps), m.trouble.c_str());
    return;
  }
  const auto percent = [](double fraction) { return fmt::format("{:.2f}", 100 * fraction); };
  const std::string stress = m.stress ? percent(m.stress->clusters) : "-";
  const std::string still = naive ? percent(naive->nothing_moves.displacement_relative) : "-",
                    near = naive ? percent(naive->nearest.displacement_relative) : "-",
                    line = naive && naive->linear ? percent(naive->linear->displacement_relative) : "-";
  const std::string bound = m.error_bound ? percent(*m.error_bound) : "-";
  std::printf("%8.4f %8.3f %7.3f %8s | %7s %7s %7s | %6.2f %7s %-12s | ", 100 * m.delta, 100 * m.displacement_relative,
              m.error_cells, stress.c_str(), still.c_str(), near.c_str(), line.c_str(), m.trust_number, bound.c_str(),
              rom::verdict_text(m.verdict));
  std::printf("%7.0f %7lld %7.0f %7.0f %7.0f %7.0f %7.0f %7.1f\n", m.statistics.mean_integration,
              static_cast<long long>(m.statistics.most_integration), per_step * t.total(), per_step * t.decode,
              per_step * t.grid, per_step * t.inversion, per_step * t.search, m.added_bytes / (1 << 20));
}

void print_speed(const SpeedComparison& speed) {
  std::printf("%12s %s: %.3g ms a frame in %.1f steps, the reduced model %.3g ms: %.2f times as fast%s\n", "",
              speed.against.c_str(), 1e3 * speed.mpm_frame, speed.substeps, 1e3 * speed.rom_frame,
              speed.rom_frame > 0 ? speed.mpm_frame / speed.rom_frame : 0, speed.diverged ? " (one diverged)" : "");
}

}  // namespace graupel::bench
