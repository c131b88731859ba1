// How a program ends that can no longer end as usual: an exception in a destructor, a crash of a library without
// memory. A message with a remedy and an exit code take the place of a signal.
#pragma once

namespace graupel {

/// From now on the program that cannot have memory, or start a thread, where no exception may pass ends with
/// "<program>: out of memory. <remedy>" or with what lacks, and ExitCode::failed; so does a crash after memory ran out.
/// Other crashes stay as they are. Once a process; `program` and `remedy` have at most 400 bytes together.
void install_last_resort(const char* program, const char* remedy);

/// While one lives, a crash is laid to lack of memory: around calls of libraries in C that crash for nothing else.
class BlameMemory {
 public:
  BlameMemory() noexcept;
  ~BlameMemory();
  BlameMemory(const BlameMemory&) = delete;
  BlameMemory& operator=(const BlameMemory&) = delete;
};

/// Tells that a library in C had no memory (operator new tells it by itself).
void note_out_of_memory() noexcept;

}  // namespace graupel
