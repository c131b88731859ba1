// Files, groups and attributes of HDF5.
#include "io/hdf5/hdf5.h"

#include <algorithm>
#include <new>
#include <string_view>

#include "core/system/checks/file_check.h"
#include "core/system/last_resort.h"
#include "io/hdf5/output_driver.h"

namespace graupel::io::hdf5 {

namespace {

/// Turns off the library's own printing (kept per thread) and the loading of plugins. Its clean-up at exit is turned
/// off too: every handle here closes itself, and HDF5 1.10 crashes there on a file that a full disk kept from closing.
void prepare() {
  const BlameMemory blame;  // the library does not look whether it has memory when it starts
  H5dont_atexit();          // heeded only before the library's first other call
  check(H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr), "cannot set up HDF5");
  check(H5PLset_loading_state(0), "cannot set up HDF5");
}

/// What the library says of a failure. Where a call of the system failed, that call's words alone: the library adds
/// lines of times, addresses and sizes.
struct ErrorTexts {
  std::vector<std::string> all;
  std::string of_system;
  bool no_memory = false;
};

/// No exception passes through the library, which is in C.
template <typename Body>
herr_t without_exception(const Body& body) noexcept {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return -1;
  }
}

herr_t collect_error(unsigned, const H5E_error2_t* error, void* out) {
  auto& texts = *static_cast<ErrorTexts*>(out);
  const herr_t status = without_exception([&]() -> herr_t {
    if (error->desc == nullptr) return 0;
    std::string text = std::string(error->desc).substr(0, 1000);
    text.resize(std::min(text.size(), text.find(": current p")));  // addresses
    constexpr std::string_view key = "error message = '";
    if (const auto begin = text.find(key); begin != std::string::npos && texts.of_system.empty())
      texts.of_system = text.substr(begin + key.size(), text.find('\'', begin + key.size()) - begin - key.size());
    const bool off_its_end = text.starts_with("ran off the end of");  // of a damaged message, by the same numbers
    texts.no_memory = texts.no_memory ||
                      (error->maj_num == H5E_RESOURCE && error->min_num == H5E_NOSPACE && !off_its_end) ||
                      text.find("memory allocation failed") != std::string::npos ||
                      text.find("ID type allocation failed") != std::string::npos;
    if (texts.all.size() < 3) texts.all.push_back(text.substr(0, 200));
    return 0;
  });
  texts.no_memory = texts.no_memory || status < 0;
  return status;
}

Handle property_list(hid_t kind) { return {H5Pcreate(kind), H5Pclose, "cannot make an HDF5 property list"}; }
Handle scalar_space() { return {H5Screate(H5S_SCALAR), H5Sclose, "cannot make an HDF5 space"}; }

Handle string_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "cannot make an HDF5 type");
  check(H5Tset_size(type, H5T_VARIABLE), "cannot make an HDF5 type");
  check(H5Tset_cset(type, H5T_CSET_UTF8), "cannot make an HDF5 type");
  return type;
}

/// Metadata leaves memory in whole flushes only: what a kill leaves on disk is the state of the last flush.
void keep_metadata_until_flush(hid_t access) {
  H5AC_cache_config_t config;
  config.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  check(H5Pget_mdc_config(access, &config), "cannot set up HDF5");
  config.evictions_enabled = false;
  config.incr_mode = H5C_incr__off;
  config.flash_incr_mode = H5C_flash_incr__off;
  config.decr_mode = H5C_decr__off;
  check(H5Pset_mdc_config(access, &config), "cannot set up HDF5");
}

Handle list_space(std::size_t count) {
  const hsize_t size = count;
  return {H5Screate_simple(1, &size, nullptr), H5Sclose, "cannot make an HDF5 space"};
}

void write_values(hid_t object, const std::string& name, const Handle& space, hid_t stored, hid_t memory,
                  const void* values) {
  const std::string what = "cannot write the attribute '" + name + "'";
  Handle attribute;
  if (check(H5Aexists(object, name.c_str()), what.c_str()) > 0) {
    attribute = Handle(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose, what.c_str());
  } else {
    attribute =
        Handle(H5Acreate2(object, name.c_str(), stored, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, what.c_str());
  }
  check(H5Awrite(attribute, memory, values), what.c_str());
  attribute.close(what.c_str());
}

void write_scalar(hid_t object, const std::string& name, hid_t stored, hid_t memory, const void* value) {
  write_values(object, name, scalar_space(), stored, memory, value);
}

constexpr hssize_t longest_list = 4096;

/// The attribute when it is there, with the number of its values.
std::optional<std::pair<Handle, std::size_t>> open_list(hid_t object, const std::string& name) {
  if (check(H5Aexists(object, name.c_str()), "cannot look for an attribute") <= 0) return std::nullopt;
  Handle attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose, "cannot open an attribute");
  const Handle space(H5Aget_space(attribute), H5Sclose, "cannot read an attribute");
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (count < 1 || count > longest_list) return std::nullopt;
  return std::pair(std::move(attribute), static_cast<std::size_t>(count));
}

/// The attribute when it is there and holds one value.
std::optional<Handle> open_scalar(hid_t object, const std::string& name) {
  if (check(H5Aexists(object, name.c_str()), "cannot look for an attribute") <= 0) return std::nullopt;
  Handle attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose, "cannot open an attribute");
  const Handle space(H5Aget_space(attribute), H5Sclose, "cannot read an attribute");
  if (H5Sget_simple_extent_npoints(space) != 1) return std::nullopt;
  return attribute;
}

template <typename T>
std::optional<T> number_attribute(hid_t object, const std::string& name, hid_t memory) {
  const auto attribute = open_scalar(object, name);
  if (!attribute) return std::nullopt;
  const Handle type(H5Aget_type(*attribute), H5Tclose, "cannot read an attribute");
  const H5T_class_t kind = H5Tget_class(type);
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) return std::nullopt;
  T value{};
  check(H5Aread(*attribute, memory, &value), "cannot read an attribute");
  return value;
}

herr_t collect_link(hid_t, const char* name, const H5L_info_t* info, void* out) {
  return without_exception([&]() -> herr_t {
    if (info->type != H5L_TYPE_HARD) return -1;
    static_cast<std::vector<std::string>*>(out)->push_back(name);
    return 0;
  });
}

herr_t collect_attribute(hid_t, const char* name, const H5A_info_t*, void* out) {
  return without_exception([&]() -> herr_t {
    static_cast<std::vector<std::string>*>(out)->push_back(name);
    return 0;
  });
}

}  // namespace

void fail(const std::string& what) {
  ErrorTexts texts;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, collect_error, &texts);
  if (texts.no_memory || texts.all.empty()) {  // it had none to note its failure
    note_out_of_memory();
    throw std::bad_alloc();
  }
  if (!texts.of_system.empty()) texts.all = {texts.of_system};
  std::string message = what;
  for (std::size_t i = 0; i < texts.all.size(); ++i) message += (i == 0 ? ": " : "; ") + texts.all[i];
  throw Failure(message);
}

bool threads_may_call() {
  hbool_t safe = false;
  return H5is_library_threadsafe(&safe) >= 0 && safe;
}

std::unique_lock<std::recursive_mutex> library_lock() {
  static std::recursive_mutex mutex;
  static const bool needed = !threads_may_call();
  return needed ? std::unique_lock(mutex) : std::unique_lock<std::recursive_mutex>();
}

Handle create_file(const std::string& path) {
  prepare();
  const Handle access = property_list(H5P_FILE_ACCESS);
  check(H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V110), "cannot set up HDF5");
  use_output_driver(access);
  keep_metadata_until_flush(access);
  const Handle creation = property_list(H5P_FILE_CREATE);
  check(H5Pset_obj_track_times(creation, false), "cannot set up HDF5");
  return {H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access), H5Fclose, "cannot create the file"};
}

Handle open_file(const std::string& path) {
  check_file(path, FileFormat::hdf5);
  prepare();
  return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose, "cannot open the file"};
}

Handle create_group(hid_t parent, const std::string& name) {
  const Handle creation = property_list(H5P_GROUP_CREATE);
  check(H5Pset_obj_track_times(creation, false), "cannot set up HDF5");
  return {H5Gcreate2(parent, name.c_str(), H5P_DEFAULT, creation, H5P_DEFAULT), H5Gclose, "cannot create a group"};
}

void write_attribute(hid_t object, const std::string& name, const std::string& value) {
  const Handle type = string_type();
  const char* text = value.c_str();
  write_scalar(object, name, type, type, &text);
}

void write_attribute(hid_t object, const std::string& name, double value) {
  write_scalar(object, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &value);
}

void write_attribute(hid_t object, const std::string& name, int64_t value) {
  write_scalar(object, name, H5T_STD_I64LE, H5T_NATIVE_INT64, &value);
}

void write_attribute(hid_t object, const std::string& name, uint64_t value) {
  write_scalar(object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, &value);
}

void write_attribute(hid_t object, const std::string& name, const std::vector<std::string>& values) {
  const Handle type = string_type();
  std::vector<const char*> texts;
  texts.reserve(values.size());
  for (const std::string& value : values) texts.push_back(value.c_str());
  write_values(object, name, list_space(values.size()), type, type, texts.data());
}

void write_attribute(hid_t object, const std::string& name, const std::vector<double>& values) {
  write_values(object, name, list_space(values.size()), H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data());
}

std::optional<std::string> string_attribute(hid_t object, const std::string& name) {
  const auto attribute = open_scalar(object, name);
  if (!attribute) return std::nullopt;
  const Handle type(H5Aget_type(*attribute), H5Tclose, "cannot read an attribute");
  if (H5Tget_class(type) != H5T_STRING) return std::nullopt;
  if (check(H5Tis_variable_str(type), "cannot read an attribute") > 0) {
    const Handle memory(H5Tcopy(type), H5Tclose, "cannot read an attribute");
    char* text = nullptr;
    check(H5Aread(*attribute, memory, &text), "cannot read an attribute");
    std::string value = text ? text : "";
    H5free_memory(text);
    return value;
  }
  const std::size_t size = H5Tget_size(type);
  if (size > (std::size_t(1) << 24)) return std::nullopt;
  std::string value(size, '\0');
  check(H5Aread(*attribute, type, value.data()), "cannot read an attribute");
  value.resize(std::min(value.find('\0'), value.size()));
  return value;
}

std::optional<double> real_attribute(hid_t object, const std::string& name) {
  return number_attribute<double>(object, name, H5T_NATIVE_DOUBLE);
}

std::optional<int64_t> integer_attribute(hid_t object, const std::string& name) {
  return number_attribute<int64_t>(object, name, H5T_NATIVE_INT64);
}

std::optional<uint64_t> natural_attribute(hid_t object, const std::string& name) {
  return number_attribute<uint64_t>(object, name, H5T_NATIVE_UINT64);
}

std::vector<std::string> string_list_attribute(hid_t object, const std::string& name) {
  const auto list = open_list(object, name);
  if (!list) return {};
  const auto& [attribute, count] = *list;
  const Handle type(H5Aget_type(attribute), H5Tclose, "cannot read an attribute");
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) <= 0) return {};
  std::vector<char*> texts(count, nullptr);
  check(H5Aread(attribute, type, texts.data()), "cannot read an attribute");
  std::vector<std::string> values;
  for (char* text : texts) {
    values.emplace_back(text ? text : "");
    H5free_memory(text);
  }
  return values;
}

std::vector<double> real_list_attribute(hid_t object, const std::string& name) {
  const auto list = open_list(object, name);
  if (!list) return {};
  const auto& [attribute, count] = *list;
  const Handle type(H5Aget_type(attribute), H5Tclose, "cannot read an attribute");
  const H5T_class_t kind = H5Tget_class(type);
  if (kind != H5T_INTEGER && kind != H5T_FLOAT) return {};
  std::vector<double> values(count);
  check(H5Aread(attribute, H5T_NATIVE_DOUBLE, values.data()), "cannot read an attribute");
  return values;
}

std::vector<std::string> attribute_names(hid_t object) {
  std::vector<std::string> names;
  check(H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect_attribute, &names), "cannot list attributes");
  return names;
}

std::vector<std::string> member_names(hid_t group) {
  std::vector<std::string> names;
  if (H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect_link, &names) < 0)
    fail("it has links that lead elsewhere, or its list of members is damaged");
  return names;
}

bool has_member(hid_t group, const std::string& name) {
  return check(H5Lexists(group, name.c_str(), H5P_DEFAULT), "cannot look for a member") > 0;
}

}  // namespace graupel::io::hdf5
