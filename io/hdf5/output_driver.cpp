#include "io/hdf5/output_driver.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <vector>

namespace graupel::io::hdf5 {

namespace {

constexpr haddr_t largest_file = (haddr_t(1) << 62) - 1;

/// A node, header or heap of the file, as it will be on disk.
struct MetadataWrite {
  H5FD_mem_t kind;
  haddr_t address;
  std::vector<std::byte> bytes;
};

/// An open file. The library knows its first member only.
struct OutputFile {
  H5FD_t library{};
  int descriptor = -1;
  haddr_t end_of_space = 0, end_of_file = 0;
  haddr_t end_at_flush = 0;             ///< of the space that the metadata on disk refer to
  std::vector<MetadataWrite> metadata;  ///< of the flush that has begun
  int error = 0;                        ///< errno of the first write that failed
};

/// errno of the file that this thread closed last.
thread_local int error_when_closed = 0;

OutputFile& of(H5FD_t* file) { return *reinterpret_cast<OutputFile*>(file); }
const OutputFile& of(const H5FD_t* file) { return *reinterpret_cast<const OutputFile*>(file); }

/// In the form of the library's own driver.
void push_error(const char* what) {
  H5Epush2(H5E_DEFAULT, __FILE__, what, __LINE__, H5E_ERR_CLS, H5E_FILE, H5E_CANTOPENFILE,
           "unable to %s file: error message = '%s'", what, std::strerror(errno));
}

H5FD_t* open(const char* name, unsigned flags, hid_t, haddr_t) {
  int mode = (flags & H5F_ACC_RDWR) != 0 ? O_RDWR : O_RDONLY;
  if ((flags & H5F_ACC_TRUNC) != 0) mode |= O_TRUNC;
  if ((flags & H5F_ACC_CREAT) != 0) mode |= O_CREAT;
  if ((flags & H5F_ACC_EXCL) != 0) mode |= O_EXCL;
  const int descriptor = ::open(name, mode | O_CLOEXEC, 0666);
  struct stat status {};
  if (descriptor < 0 || ::fstat(descriptor, &status) != 0) {
    push_error("open");
    return nullptr;
  }
  auto* const file = new (std::nothrow) OutputFile;
  if (file == nullptr) {
    ::close(descriptor);
    return nullptr;
  }
  file->descriptor = descriptor;
  file->end_of_file = static_cast<haddr_t>(status.st_size);
  return &file->library;
}

void write_bytes(OutputFile& file, haddr_t address, const std::byte* from, std::size_t size) {
  while (size > 0 && file.error == 0) {
    const ssize_t n = ::pwrite(file.descriptor, from, size, static_cast<off_t>(address));
    if (n < 0) {
      if (errno != EINTR) file.error = errno;
      continue;
    }
    from += n;
    address += static_cast<haddr_t>(n);
    size -= static_cast<std::size_t>(n);
  }
}

/// Place in the order of a flush: what is new, then the end of the file, then what is overwritten: nodes of B-trees
/// (specification 3.0, III.A.1), the upper ones first, then headers, which say how many frames there are.
int turn(const MetadataWrite& one, haddr_t end_at_flush) {
  constexpr std::size_t level_at = 5;
  if (one.kind == H5FD_MEM_SUPER) return 1;
  if (one.address >= end_at_flush) return 0;
  const bool is_node = one.bytes.size() > level_at && std::memcmp(one.bytes.data(), "TREE", 4) == 0;
  return is_node ? 300 - static_cast<int>(one.bytes[level_at]) : 400;
}

void write_metadata(OutputFile& file) {
  std::stable_sort(file.metadata.begin(), file.metadata.end(), [&](const MetadataWrite& a, const MetadataWrite& b) {
    return turn(a, file.end_at_flush) < turn(b, file.end_at_flush);
  });
  for (const MetadataWrite& one : file.metadata) write_bytes(file, one.address, one.bytes.data(), one.bytes.size());
  file.metadata.clear();
  file.end_at_flush = file.end_of_space;
}

/// Unlocked by name: a process that another thread has just forked holds the descriptor and its lock until its exec.
herr_t close(H5FD_t* pointer) {
  OutputFile* const file = &of(pointer);
  write_metadata(*file);
  ::flock(file->descriptor, LOCK_UN);
  if (::close(file->descriptor) != 0 && file->error == 0 && errno != EINTR) file->error = errno;
  error_when_closed = file->error;
  delete file;
  return 0;
}

int compare(const H5FD_t* a, const H5FD_t* b) {
  struct stat of_a {
  }, of_b{};
  ::fstat(of(a).descriptor, &of_a);
  ::fstat(of(b).descriptor, &of_b);
  if (of_a.st_dev != of_b.st_dev) return of_a.st_dev < of_b.st_dev ? -1 : 1;
  return of_a.st_ino == of_b.st_ino ? 0 : of_a.st_ino < of_b.st_ino ? -1 : 1;
}

herr_t query(const H5FD_t*, unsigned long* flags) {
  *flags = H5FD_FEAT_DATA_SIEVE | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t end_of_space(const H5FD_t* file, H5FD_mem_t) { return of(file).end_of_space; }
haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) { return of(file).end_of_file; }
herr_t set_end_of_space(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  of(file).end_of_space = end;
  return 0;
}

/// What the library's users ask for is the failure.
herr_t handle(H5FD_t* file, hid_t, void** out) {
  *out = &of(file).error;
  return 0;
}

/// Bytes of [address, address + size) that have not been written yet.
void read_waiting(const OutputFile& file, haddr_t address, std::size_t size, std::byte* out) {
  for (const MetadataWrite& one : file.metadata) {
    const haddr_t begin = std::max(address, one.address);
    const haddr_t end = std::min(address + size, one.address + one.bytes.size());
    if (begin < end) std::memcpy(out + (begin - address), one.bytes.data() + (begin - one.address), end - begin);
  }
}

/// Zeros behind the end of the file, as the library expects.
herr_t read(H5FD_t* pointer, H5FD_mem_t, hid_t, haddr_t from, std::size_t bytes, void* buffer) {
  const OutputFile& file = of(pointer);
  auto* out = static_cast<std::byte*>(buffer);
  haddr_t address = from;
  std::size_t size = bytes;
  while (size > 0) {
    const ssize_t n = ::pread(file.descriptor, out, size, static_cast<off_t>(address));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      push_error("read");
      return -1;
    }
    if (n == 0) break;
    out += n;
    address += static_cast<haddr_t>(n);
    size -= static_cast<std::size_t>(n);
  }
  std::memset(out, 0, size);
  read_waiting(file, from, bytes, static_cast<std::byte*>(buffer));
  return 0;
}

/// Chunks at once, metadata when the flush ends.
herr_t write(H5FD_t* pointer, H5FD_mem_t kind, hid_t, haddr_t address, std::size_t size, const void* buffer) {
  OutputFile& file = of(pointer);
  const auto* const from = static_cast<const std::byte*>(buffer);
  file.end_of_file = std::max(file.end_of_file, address + size);  // also of what was dropped
  if (kind == H5FD_MEM_DRAW) {
    write_bytes(file, address, from, size);
    return 0;
  }
  try {
    file.metadata.push_back({kind, address, {from, from + size}});
  } catch (const std::bad_alloc&) {
    if (file.error == 0) file.error = ENOMEM;
  }
  return 0;
}

herr_t flush(H5FD_t* file, hid_t, hbool_t) {
  write_metadata(of(file));
  return 0;
}

herr_t truncate(H5FD_t* pointer, hid_t, hbool_t) {
  OutputFile& file = of(pointer);
  if (file.end_of_space == file.end_of_file) return 0;
  while (file.error == 0 && ::ftruncate(file.descriptor, static_cast<off_t>(file.end_of_space)) != 0)
    if (errno != EINTR) file.error = errno;
  file.end_of_file = file.end_of_space;
  return 0;
}

herr_t lock(H5FD_t* file, hbool_t exclusive) {
  if (::flock(of(file).descriptor, (exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB) == 0 || errno == ENOSYS) return 0;
  push_error("lock");
  return -1;
}

herr_t unlock(H5FD_t* file) {
  ::flock(of(file).descriptor, LOCK_UN);
  return 0;
}

hid_t output_driver() {
  static const hid_t id = [] {
    static H5FD_class_t driver{};
#ifdef H5FD_CLASS_VERSION
    driver.version = H5FD_CLASS_VERSION;
    driver.value = 512;  // of drivers that are not registered with the library's makers
#endif
    driver.name = "graupel_output";
    driver.maxaddr = largest_file;
    driver.fc_degree = H5F_CLOSE_WEAK;
    driver.open = open;
    driver.close = close;
    driver.cmp = compare;
    driver.query = query;
    driver.get_eoa = end_of_space;
    driver.set_eoa = set_end_of_space;
    driver.get_eof = end_of_file;
    driver.get_handle = handle;
    driver.read = read;
    driver.write = write;
    driver.flush = flush;
    driver.truncate = truncate;
    driver.lock = lock;
    driver.unlock = unlock;
    constexpr H5FD_mem_t one_list_of_free_space[] = H5FD_FLMAP_DICHOTOMY;
    std::copy(std::begin(one_list_of_free_space), std::end(one_list_of_free_space), driver.fl_map);
    return check(H5FDregister(&driver), "cannot set up HDF5");
  }();
  return id;
}

void throw_if(int error) {
  if (error == ENOMEM) throw std::bad_alloc();
  if (error != 0) throw Failure(std::strerror(error));
}

}  // namespace

void use_output_driver(hid_t access) { check(H5Pset_driver(access, output_driver(), nullptr), "cannot set up HDF5"); }

void check_written(hid_t file) {
  void* error = nullptr;
  check(H5Fget_vfd_handle(file, H5P_DEFAULT, &error), "cannot ask for failures");
  throw_if(*static_cast<const int*>(error));
}

void close_written(Handle& file) {
  error_when_closed = 0;
  file.close("cannot close the file");
  throw_if(error_when_closed);
}

}  // namespace graupel::io::hdf5
