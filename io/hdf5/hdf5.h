// HDF5's C API with owned handles and checked return values. Files are written so that the same content gives the same
// bytes (no times), and so that a killed writer leaves a readable file (format bounds EARLIEST..V110).
#pragma once

#define H5_USE_110_API
#include <hdf5.h>

#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace graupel::io::hdf5 {

/// A failed call with the library's own words. Callers turn it into InputError or IoError with the file's name.
struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws Failure with the library's words, or std::bad_alloc where it lacked memory.
[[noreturn]] void fail(const std::string& what);

/// Whether the library takes calls of several threads (it then runs them one at a time).
bool threads_may_call();
/// Held around calls that several threads make: does nothing where threads may call.
std::unique_lock<std::recursive_mutex> library_lock();

template <typename Status>
Status check(Status status, const char* what) {
  if (status < 0) fail(what);
  return status;
}

/// Owns an identifier. The destructor closes without a check, close() with one.
class Handle {
 public:
  Handle() = default;
  Handle(hid_t id, herr_t (*closer)(hid_t), const char* what) : id_(check(id, what)), closer_(closer) {}
  ~Handle() { release(); }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), closer_(other.closer_) {}
  Handle& operator=(Handle&& other) noexcept {
    if (this != &other) {
      release();
      id_ = std::exchange(other.id_, -1);
      closer_ = other.closer_;
    }
    return *this;
  }
  operator hid_t() const { return id_; }
  bool is_open() const { return id_ >= 0; }
  void close(const char* what) {
    if (id_ >= 0) check(closer_(std::exchange(id_, -1)), what);
  }

 private:
  void release() noexcept {
    if (id_ >= 0) closer_(std::exchange(id_, -1));
  }
  hid_t id_ = -1;
  herr_t (*closer_)(hid_t) = nullptr;
};

Handle create_file(const std::string& path);
/// Read-only, after check_file(); plugins are never loaded.
Handle open_file(const std::string& path);
Handle create_group(hid_t parent, const std::string& name);

void write_attribute(hid_t object, const std::string& name, const std::string& value);
void write_attribute(hid_t object, const std::string& name, double value);
void write_attribute(hid_t object, const std::string& name, int64_t value);
void write_attribute(hid_t object, const std::string& name, uint64_t value);
void write_attribute(hid_t object, const std::string& name, const std::vector<std::string>& values);
void write_attribute(hid_t object, const std::string& name, const std::vector<double>& values);

/// Empty when there is none, or one of another kind.
std::optional<std::string> string_attribute(hid_t object, const std::string& name);
std::optional<double> real_attribute(hid_t object, const std::string& name);
std::optional<int64_t> integer_attribute(hid_t object, const std::string& name);
std::optional<uint64_t> natural_attribute(hid_t object, const std::string& name);
/// At most 4096 values; empty also where there are more.
std::vector<std::string> string_list_attribute(hid_t object, const std::string& name);
std::vector<double> real_list_attribute(hid_t object, const std::string& name);
std::vector<std::string> attribute_names(hid_t object);

/// Names of the hard links in a group, sorted. Fails for links that lead elsewhere.
std::vector<std::string> member_names(hid_t group);
bool has_member(hid_t group, const std::string& name);

}  // namespace graupel::io::hdf5
