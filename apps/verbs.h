// The program's verbs. Each add_* declares a command whose callback does the work and throws the errors of
// core/system/error.h; run_program turns them into messages and exit codes.
#pragma once

#include "core/system/command_line.h"

namespace graupel::apps {

void add_demo(const Command& program);
void add_compare(const Command& program);
void add_generate(const Command& program);
void add_simulate(const Command& program);
void add_train(const Command& program);
/// Sets `exit_code` to that of the ranks.
void add_launch(const Command& program, int& exit_code);
void add_rollout(const Command& program);
void add_export(const Command& program);
void add_convert(const Command& program);
void add_inspect(const Command& program);
void add_validate(const Command& program);
void add_view(const Command& program);
void add_doctor(const Command& program);
void add_bench(const Command& program);
void add_man(const Command& program);
void add_completion(const Command& program);

}  // namespace graupel::apps
