// The program's commands. Each add_* declares one whose callback measures and prints.
#pragma once

#include "core/system/command_line.h"

namespace graupel::bench {

void add_mpm(const Command& program);
void add_graph(const Command& program);
void add_rom(const Command& program);
void add_validate(const Command& program);
void add_view(const Command& program);
void add_micro(const Command& program);

}  // namespace graupel::bench
