// The program's verbs. Each add_* registers a subcommand whose callback does the work and throws the errors of
// core/system/error.h; main.cpp turns them into messages and exit codes.
#pragma once

#include <CLI/CLI.hpp>

namespace graupel::apps {

void add_demo(CLI::App& app);
void add_bench(CLI::App& app);
void add_bench_graph(CLI::App& bench);
void add_bench_rom(CLI::App& bench);
void add_bench_validate(CLI::App& bench);
void add_generate(CLI::App& app);
void add_simulate(CLI::App& app);
void add_train(CLI::App& app);
/// Sets `exit_code` to that of the ranks.
void add_launch(CLI::App& app, int& exit_code);
void add_rollout(CLI::App& app);
void add_compare(CLI::App& app);
void add_export(CLI::App& app);
void add_convert(CLI::App& app);
void add_inspect(CLI::App& app);

}  // namespace graupel::apps
