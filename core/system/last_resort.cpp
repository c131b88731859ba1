#include "core/system/last_resort.h"

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "core/system/error.h"
#include "core/system/unfinished_file.h"

namespace graupel {

namespace {

constexpr int signals[] = {SIGSEGV, SIGBUS, SIGABRT};
constexpr std::size_t reserve_bytes = std::size_t(2) << 20;

char name[401], out_of_memory[600];
std::atomic<bool> ran_out = false;
std::atomic<int> blamed = 0;  ///< living BlameMemory
/// Given back when memory runs out, so that what follows can close files and tell the user.
std::atomic<void*> reserve = nullptr;
struct sigaction before[std::size(signals)];

void print(const char* text) {
  for (std::size_t left = std::strlen(text); left > 0;) {
    const ssize_t n = ::write(STDERR_FILENO, text, left);
    if (n <= 0) return;
    text += n;
    left -= static_cast<std::size_t>(n);
  }
}

[[noreturn]] void end(const char* text) {
  remove_unfinished_files();
  print(text);
  ::_exit(static_cast<int>(ExitCode::failed));
}

/// Whether the system gives some more memory. Libraries in C that had none do not say so before they crash.
bool has_memory() {
  constexpr std::size_t bytes = std::size_t(1) << 20;
  void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  return memory != MAP_FAILED && ::munmap(memory, bytes) == 0;
}

/// Only what a signal's handler may call.
extern "C" void on_crash(int signal) {
  if (ran_out || blamed > 0 || !has_memory()) end(out_of_memory);
  for (std::size_t i = 0; i < std::size(signals); ++i)
    if (signals[i] == signal) ::sigaction(signal, &before[i], nullptr);
  if (signal == SIGABRT) ::raise(signal);  // the others come again when the instruction is run again
}

/// HDF5 ends the program by exit(-1) where it has no memory to begin a call; nothing else does.
extern "C" void on_library_exit(int status, void*) {
  if (status == -1) end(out_of_memory);
}

[[noreturn]] void on_failed_new() {
  note_out_of_memory();
  throw std::bad_alloc();
}

/// TBB's errors are std::runtime_error with the system's words.
bool is_lack_of_threads(const std::exception& error) {
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  if (system != nullptr) return system->code() == std::errc::resource_unavailable_try_again;
  return std::strstr(error.what(), "Resource temporarily unavailable") != nullptr;
}

[[noreturn]] void on_terminate() {
  if (ran_out) end(out_of_memory);
  if (std::current_exception()) try {
      throw;
    } catch (const std::bad_alloc&) {
      end(out_of_memory);
    } catch (const std::exception& error) {
      print(name);
      print(": ");
      print(error.what());
      if (is_lack_of_threads(error))
        end(". The system starts no more threads. Use --threads 1, or allow more (ulimit -u)\n");
      print("\n");
    } catch (...) {
    }
  std::abort();
}

}  // namespace

void install_last_resort(const char* program, const char* remedy) {
  std::snprintf(name, sizeof(name), "%s", program);
  std::snprintf(out_of_memory, sizeof(out_of_memory), "%s: out of memory. %s\n", program, remedy);
  reserve = std::malloc(reserve_bytes);
  std::set_new_handler(on_failed_new);
  std::set_terminate(on_terminate);
  ::on_exit(on_library_exit, nullptr);
  // HDF5 without memory reports an error of its reports, and so on to the end of the stack.
  static std::array<char, std::size_t(64) << 10> spare_stack;
  const stack_t stack{.ss_sp = spare_stack.data(), .ss_flags = 0, .ss_size = spare_stack.size()};
  ::sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = on_crash;
  action.sa_flags = SA_ONSTACK;
  for (std::size_t i = 0; i < std::size(signals); ++i) ::sigaction(signals[i], &action, &before[i]);
}

BlameMemory::BlameMemory() noexcept { ++blamed; }
BlameMemory::~BlameMemory() { --blamed; }

void note_out_of_memory() noexcept {
  ran_out = true;
  std::free(reserve.exchange(nullptr));
}

}  // namespace graupel
