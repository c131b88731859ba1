// Rows of 'graupel-bench rom', on the terminal and as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "bench/reduced/baselines.h"
#include "bench/reduced/rom_gpu_steps.h"
#include "bench/reduced/rom_measurement.h"

namespace graupel::bench {

nlohmann::ordered_json json_of(const Baselines& naive);
nlohmann::ordered_json json_of(const SpeedComparison& speed);
/// `factor`: the step over that of the training.
nlohmann::ordered_json json_of(const RomMeasurement& m, double factor);
nlohmann::ordered_json json_of(const GpuSteps& steps, double factor);

void print_header();
void print_row(const RomMeasurement& m, double factor, const std::optional<Baselines>& naive);
void print_speed(const SpeedComparison& speed);
void print_gpu_steps(const GpuSteps& s);

}  // namespace graupel::bench
