// A library for LD_PRELOAD that makes system calls and allocations of graupel and graupel-train fail, one chosen call
// or all from then on. faults_test.py sets it up by the environment:
//   GRAUPEL_FAULT_REPORT   file that takes the Report below, also of a run that is killed
//   GRAUPEL_FAULT_FOLDER   only files in this folder (absolute, no link in it) are counted; allocations all
//   GRAUPEL_FAULT_KIND     open, write, sync, truncate, close, rename, allocate or thread; none counts only
//   GRAUPEL_FAULT_AT       which call of that kind, from 1
//   GRAUPEL_FAULT_ERROR    an errno; "short": half of the bytes are written; "kill": SIGKILL before the call
//   GRAUPEL_FAULT_LASTING  1: all later calls of the kind too (after a short write with ENOSPC)
//   GRAUPEL_FAULT_CALLERS  program: allocations by the program's own code; any: also by its libraries
// Allocations are counted between the beginning and the end of main.
#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string_view>

#include <stdio_ext.h>

namespace {

enum Kind { of_open, of_write, of_sync, of_truncate, of_close, of_rename, of_allocate, of_thread, kinds };
constexpr const char* kind_names[kinds] = {"open",  "write",  "sync",     "truncate",
                                           "close", "rename", "allocate", "thread"};

struct Report {
  std::atomic<uint64_t> calls[kinds];
  std::atomic<uint64_t> failed;  ///< calls that were made to fail
  char first[240];               ///< file of the first of them
};
static_assert(sizeof(Report) == 8 * kinds + 8 + 240, "as faults_test.py reads it");

struct Settings {
  Report* report = nullptr;  ///< null: nothing is counted
  const char* folder = "";
  int kind = kinds;
  uint64_t at = 0;
  int error = 0;
  bool short_write = false, kill = false, lasting = false, any_caller = false;
  uintptr_t program_begin = 0, program_end = 0;

  Settings();
};

int find_program(dl_phdr_info* info, std::size_t, void* out) {  // the first object is the program
  auto& settings = *static_cast<Settings*>(out);
  settings.program_begin = ~uintptr_t(0);
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const auto& header = info->dlpi_phdr[i];
    if (header.p_type != PT_LOAD) continue;
    const uintptr_t begin = info->dlpi_addr + header.p_vaddr, end = begin + header.p_memsz;
    if (begin < settings.program_begin) settings.program_begin = begin;
    if (end > settings.program_end) settings.program_end = end;
  }
  return 1;
}

const char* variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

Settings::Settings() {
  const std::string_view program = program_invocation_short_name;
  const char* file = variable("GRAUPEL_FAULT_REPORT");
  if (*file == 0 || (program != "graupel" && program != "graupel-train")) return;
  folder = variable("GRAUPEL_FAULT_FOLDER");
  for (int k = 0; k < kinds; ++k)
    if (std::strcmp(kind_names[k], variable("GRAUPEL_FAULT_KIND")) == 0) kind = k;
  at = std::strtoull(variable("GRAUPEL_FAULT_AT"), nullptr, 10);
  const std::string_view how = variable("GRAUPEL_FAULT_ERROR");
  short_write = how == "short";
  kill = how == "kill";
  error = short_write || kill ? ENOSPC : std::atoi(how.data());
  lasting = *variable("GRAUPEL_FAULT_LASTING") == '1';
  any_caller = std::strcmp(variable("GRAUPEL_FAULT_CALLERS"), "any") == 0;
  ::dl_iterate_phdr(find_program, this);
  const int descriptor = next<int(const char*, int, ...)>("open")(file, O_RDWR);
  if (descriptor < 0) std::abort();
  void* memory =
      next<decltype(::mmap)>("mmap")(nullptr, sizeof(Report), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  next<int(int)>("close")(descriptor);
  if (memory == MAP_FAILED) std::abort();
  report = static_cast<Report*>(memory);
}

const Settings& settings() {
  static const Settings values;
  return values;
}

enum class Outcome { as_it_is, failed, cut };

/// Counts a call; what is to become of it. Sets errno where it fails.
Outcome count(Kind kind, const char* file) {
  const Settings& s = settings();
  if (s.report == nullptr) return Outcome::as_it_is;
  const uint64_t number = ++s.report->calls[kind];
  if (kind != s.kind || number < s.at || (number > s.at && !s.lasting)) return Outcome::as_it_is;
  if (s.report->failed++ == 0) std::strncpy(s.report->first, file, sizeof(s.report->first) - 1);
  if (s.kill) ::raise(SIGKILL);
  if (s.short_write && number == s.at) return Outcome::cut;
  errno = s.error;
  return Outcome::failed;
}

/// What is open in the folder; itself too.
constexpr int most_files = 4096;
enum Use : char { elsewhere, read_only, written };
std::atomic<Use> uses[most_files];
char names[most_files][240];

Use use_of(int descriptor) { return descriptor >= 0 && descriptor < most_files ? uses[descriptor].load() : elsewhere; }
void forget(int descriptor) {
  if (use_of(descriptor) != elsewhere) uses[descriptor] = elsewhere;
}

bool in_folder(const char* path) {
  const Settings& s = settings();
  if (s.report == nullptr || path == nullptr) return false;
  char full[4096];
  if (path[0] != '/') {
    if (::getcwd(full, sizeof(full)) == nullptr) return false;
    std::strncat(full, "/", sizeof(full) - std::strlen(full) - 1);
    std::strncat(full, path, sizeof(full) - std::strlen(full) - 1);
    path = full;
  }
  const std::size_t length = std::strlen(s.folder);
  return length > 0 && std::strncmp(path, s.folder, length) == 0 && (path[length] == '/' || path[length] == 0);
}

bool writes(int flags) { return (flags & O_ACCMODE) != O_RDONLY; }

void watch(int descriptor, const char* path, Use use) {
  if (descriptor < 0 || descriptor >= most_files) return;
  std::strncpy(names[descriptor], path, sizeof(names[descriptor]) - 1);
  uses[descriptor] = use;
}

template <typename Open>
int open_file(const char* path, int flags, const Open& open) {
  if (!in_folder(path)) return open();
  if (writes(flags) && count(of_open, path) == Outcome::failed) return -1;
  const int descriptor = open();
  watch(descriptor, path, writes(flags) ? written : read_only);
  return descriptor;
}

mode_t mode_of(int flags, va_list rest) { return (flags & (O_CREAT | __O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0; }

/// write(length) where it is not to fail; half of the bytes where it is cut.
template <typename Write>
ssize_t write_bytes(int descriptor, std::size_t length, const Write& write) {
  if (use_of(descriptor) != written) return write(length);
  const Outcome outcome = count(of_write, names[descriptor]);
  if (outcome == Outcome::failed) return -1;
  return write(outcome == Outcome::cut && length > 1 ? length / 2 : length);
}

template <typename Call>
int call_on(Kind kind, int descriptor, const Call& call) {
  return use_of(descriptor) != elsewhere && count(kind, names[descriptor]) == Outcome::failed ? -1 : call();
}

std::FILE* open_stream(const char* name, const char* path, const char* mode) {
  const auto open = next<std::FILE*(const char*, const char*)>(name);
  const bool write = std::strpbrk(mode, "wa+") != nullptr && in_folder(path);
  if (write && count(of_open, path) == Outcome::failed) return nullptr;
  std::FILE* const file = open(path, mode);
  if (write && file != nullptr) watch(::fileno(file), path, written);
  return file;
}

/// What stdio holds back would be written now: whether that is to fail. The bytes are then lost, as on a full disk.
bool fails_to_flush(std::FILE* file) {
  if (file == nullptr || use_of(::fileno(file)) != written || ::__fpending(file) == 0) return false;
  if (count(of_write, names[::fileno(file)]) != Outcome::failed) return false;
  const int error = errno;
  ::__fpurge(file);
  errno = error;
  return true;
}

bool in_main = false;

/// Whether an allocation that `caller` asks for is to fail.
bool fails_to_allocate(const void* caller) {
  if (!in_main) return false;
  const Settings& s = settings();
  const auto from = reinterpret_cast<uintptr_t>(caller);
  if (!s.any_caller && (from < s.program_begin || from >= s.program_end)) return false;
  return count(of_allocate, "") == Outcome::failed;
}

/// Whether the system has no pages left either: allocations fail for good.
bool is_out_of_pages() {
  if (!in_main) return false;
  const Settings& s = settings();
  return s.report != nullptr && s.kind == of_allocate && s.lasting && s.report->failed > 0;
}

/// Says where a program that aborts or crashes is.
void print_frames(int number) {
  void* frames[48];
  ::backtrace_symbols_fd(frames, ::backtrace(frames, 48), STDERR_FILENO);
  ::signal(number, SIG_DFL);
  ::raise(number);
}

int (*real_main)(int, char**, char**) = nullptr;
int counted_main(int argc, char** argv, char** environment) {
  if (settings().report != nullptr)
    for (const int number : {SIGABRT, SIGSEGV}) ::signal(number, print_frames);
  in_main = true;
  const int code = real_main(argc, argv, environment);
  in_main = false;
  return code;
}

}  // namespace

#define GRAUPEL_FAILS_TO_ALLOCATE() fails_to_allocate(__builtin_return_address(0))

extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(), void (*fini)(),
                      void (*loader_fini)(), void* stack_end) {
  real_main = main;
  using Start = int(int (*)(int, char**, char**), int, char**, void (*)(), void (*)(), void (*)(), void*);
  return next<Start>("__libc_start_main")(counted_main, argc, argv, init, fini, loader_fini, stack_end);
}

#define GRAUPEL_OPEN(name, at)                                                      \
  int name(const char* path, int flags, ...) {                                      \
    va_list rest;                                                                   \
    va_start(rest, flags);                                                          \
    const mode_t mode = mode_of(flags, rest);                                       \
    va_end(rest);                                                                   \
    static const auto real = next<int(const char*, int, ...)>(#name);               \
    return open_file(path, flags, [&] { return real(path, flags, mode); });         \
  }                                                                                 \
  int at(int folder, const char* path, int flags, ...) {                            \
    va_list rest;                                                                   \
    va_start(rest, flags);                                                          \
    const mode_t mode = mode_of(flags, rest);                                       \
    va_end(rest);                                                                   \
    static const auto real = next<int(int, const char*, int, ...)>(#at);            \
    return open_file(path, flags, [&] { return real(folder, path, flags, mode); }); \
  }

GRAUPEL_OPEN(open, openat)
GRAUPEL_OPEN(open64, openat64)

std::FILE* fopen(const char* path, const char* mode) { return open_stream("fopen", path, mode); }
std::FILE* fopen64(const char* path, const char* mode) { return open_stream("fopen64", path, mode); }

ssize_t write(int descriptor, const void* bytes, std::size_t length) {
  static const auto real = next<decltype(::write)>("write");
  return write_bytes(descriptor, length, [&](std::size_t n) { return real(descriptor, bytes, n); });
}
ssize_t pwrite(int descriptor, const void* bytes, std::size_t length, off_t at) {
  static const auto real = next<decltype(::pwrite)>("pwrite");
  return write_bytes(descriptor, length, [&](std::size_t n) { return real(descriptor, bytes, n, at); });
}
ssize_t pwrite64(int descriptor, const void* bytes, std::size_t length, off64_t at) {
  static const auto real = next<decltype(::pwrite64)>("pwrite64");
  return write_bytes(descriptor, length, [&](std::size_t n) { return real(descriptor, bytes, n, at); });
}
ssize_t writev(int descriptor, const iovec* pieces, int count) {
  static const auto real = next<decltype(::writev)>("writev");
  return write_bytes(descriptor, 2, [&](std::size_t n) -> ssize_t {
    if (n == 2) return real(descriptor, pieces, count);
    iovec half = pieces[0];  // cut: half of the first piece
    half.iov_len = (half.iov_len + 1) / 2;
    return real(descriptor, &half, 1);
  });
}
int fflush(std::FILE* file) {
  static const auto real = next<decltype(::fflush)>("fflush");
  return fails_to_flush(file) ? EOF : real(file);
}
int fclose(std::FILE* file) {
  static const auto real = next<decltype(::fclose)>("fclose");
  const int descriptor = ::fileno(file);
  bool failed = fails_to_flush(file);
  int error = errno;
  if (!failed && use_of(descriptor) == written && count(of_close, names[descriptor]) == Outcome::failed) {
    failed = true;
    error = errno;
  }
  forget(descriptor);
  const int status = real(file);
  if (!failed) return status;
  errno = error;
  return EOF;
}
int close(int descriptor) {
  static const auto real = next<decltype(::close)>("close");
  const bool failed = use_of(descriptor) == written && count(of_close, names[descriptor]) == Outcome::failed;
  const int error = errno;
  forget(descriptor);
  const int status = real(descriptor);  // Linux frees the descriptor also where it tells of an error
  if (!failed) return status;
  errno = error;
  return -1;
}
int fsync(int descriptor) {
  static const auto real = next<decltype(::fsync)>("fsync");
  return call_on(of_sync, descriptor, [&] { return real(descriptor); });
}
int fdatasync(int descriptor) {
  static const auto real = next<decltype(::fdatasync)>("fdatasync");
  return call_on(of_sync, descriptor, [&] { return real(descriptor); });
}
int ftruncate(int descriptor, off_t length) {
  static const auto real = next<decltype(::ftruncate)>("ftruncate");
  return call_on(of_truncate, descriptor, [&] { return real(descriptor, length); });
}
int ftruncate64(int descriptor, off64_t length) {
  static const auto real = next<decltype(::ftruncate64)>("ftruncate64");
  return call_on(of_truncate, descriptor, [&] { return real(descriptor, length); });
}
int rename(const char* from, const char* to) {
  static const auto real = next<decltype(::rename)>("rename");
  return in_folder(to) && count(of_rename, to) == Outcome::failed ? -1 : real(from, to);
}
int renameat(int from_folder, const char* from, int to_folder, const char* to) {
  static const auto real = next<decltype(::renameat)>("renameat");
  return in_folder(to) && count(of_rename, to) == Outcome::failed ? -1 : real(from_folder, from, to_folder, to);
}
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*body)(void*), void* argument) {
  static const auto real = next<decltype(::pthread_create)>("pthread_create");
  return in_main && count(of_thread, "") == Outcome::failed ? EAGAIN : real(thread, attributes, body, argument);
}

void* malloc(std::size_t size) { return GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_malloc(size); }
void* calloc(std::size_t count, std::size_t size) {
  return GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) { return GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_realloc(old, size); }
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  void* const memory = GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_memalign(alignment, size);
  if (memory == nullptr) return ENOMEM;
  *out = memory;
  return 0;
}

void* mmap(void* place, std::size_t length, int protection, int flags, int descriptor, off_t at) noexcept {
  static const auto real = next<decltype(::mmap)>("mmap");
  if ((flags & MAP_ANONYMOUS) == 0 || !is_out_of_pages()) return real(place, length, protection, flags, descriptor, at);
  errno = ENOMEM;
  return MAP_FAILED;
}

}  // extern "C"

namespace {
/// As operator new does: the program's handler is asked first.
void* checked(void* memory) {
  if (memory != nullptr) return memory;
  if (const std::new_handler handler = std::get_new_handler()) handler();
  throw std::bad_alloc();
}
void* null_where_it_throws(void* memory) noexcept {
  try {
    return checked(memory);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
std::size_t at_least_one(std::size_t size) { return size == 0 ? 1 : size; }
}  // namespace

#define GRAUPEL_NEW(name)                                                                                     \
  void* name(std::size_t size) {                                                                              \
    return checked(GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_malloc(at_least_one(size)));                \
  }                                                                                                           \
  void* name(std::size_t size, const std::nothrow_t&) noexcept {                                              \
    return null_where_it_throws(GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_malloc(at_least_one(size)));   \
  }                                                                                                           \
  void* name(std::size_t size, std::align_val_t alignment) {                                                  \
    return checked(GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr : __libc_memalign(std::size_t(alignment), size));    \
  }                                                                                                           \
  void* name(std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {                  \
    return null_where_it_throws(GRAUPEL_FAILS_TO_ALLOCATE() ? nullptr                                         \
                                                            : __libc_memalign(std::size_t(alignment), size)); \
  }
GRAUPEL_NEW(operator new)
GRAUPEL_NEW(operator new[])
